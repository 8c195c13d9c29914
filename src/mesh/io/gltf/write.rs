//! The writing of glTF.
//!
//! One node per object where objects share no vertex, one for all otherwise; one primitive per group and material. A vertex with
//! several texture coordinates or normals becomes several. Coordinates are 32-bit numbers: where the mesh lies far from the
//! origin they are taken from its middle, and the node moves them back.

use std::collections::BTreeMap;
use std::io::{self, Write};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Vector3;
use serde_json::{Map, Value, json};

use super::{BINARY_CHUNK, JSON_CHUNK, MAGIC};
use crate::mesh::{Model, NO_VALUE};

/// How many diagonals from the origin a mesh may lie before 32-bit coordinates lose a millionth of it.
const FAR: f64 = 16.0;

/// Vertex, texture coordinate, normal.
type Key = [u32; 3];

/// Writes the model; `binary` as GLB.
pub(in crate::mesh::io) fn write(model: &Model, binary: bool, out: &mut impl Write) -> io::Result<()> {
    let mut file = File::of(model);
    for part in parts(model) {
        file.part(&part);
    }
    file.assets();
    let buffer = std::mem::take(&mut file.buffer);
    let mut json = file.document();
    if buffer.is_empty() {
        return finish(&json, &[], binary, out);
    }
    json["buffers"] = if binary {
        json!([{ "byteLength": buffer.len() }])
    } else {
        let uri = format!("data:application/octet-stream;base64,{}", STANDARD.encode(&buffer));
        json!([{ "byteLength": buffer.len(), "uri": uri }])
    };
    finish(&json, &buffer, binary, out)
}

fn finish(json: &Value, buffer: &[u8], binary: bool, out: &mut impl Write) -> io::Result<()> {
    let mut text = json.to_string().into_bytes();
    if !binary {
        text.push(b'\n');
        return out.write_all(&text);
    }
    text.resize(text.len().next_multiple_of(4), b' ');
    let chunk = |bytes: &[u8]| if bytes.is_empty() { 0 } else { 8 + bytes.len() };
    let size = |n: usize| u32::try_from(n).map_err(|_| io::Error::other("GLB holds at most 4 GiB; write PLY instead"));
    out.write_all(MAGIC)?;
    out.write_all(&2_u32.to_le_bytes())?;
    out.write_all(&size(12 + chunk(&text) + chunk(buffer))?.to_le_bytes())?;
    for (kind, bytes) in [(JSON_CHUNK, &text[..]), (BINARY_CHUNK, buffer)] {
        if !bytes.is_empty() {
            out.write_all(&size(bytes.len())?.to_le_bytes())?;
            out.write_all(&kind.to_le_bytes())?;
            out.write_all(bytes)?;
        }
    }
    Ok(())
}

/// Faces that go into one node, in order of group and material.
struct Part {
    name: String,
    faces: Vec<usize>,
    /// Vertices that no face names go with the first part.
    loose: bool,
}

fn parts(model: &Model) -> Vec<Part> {
    let object = |face: usize| model.groups().get(face).map_or("", |group| &group.object);
    let mut objects: BTreeMap<&str, (usize, Vec<usize>)> = BTreeMap::new();
    let mut owner: Vec<Option<&str>> = vec![None; model.mesh().vertex_count()];
    let mut shared = false;
    for face in 0..model.faces().len() {
        let name = object(face);
        let order = objects.len();
        objects.entry(name).or_insert((order, Vec::new())).1.push(face);
        for &vertex in model.faces().get(face) {
            shared |= owner[vertex as usize].replace(name).is_some_and(|other| other != name);
        }
    }
    if shared || objects.len() < 2 {
        let name = objects.keys().next().filter(|_| !shared).map_or(String::new(), |name| (*name).to_owned());
        return vec![Part { name, faces: (0..model.faces().len()).collect(), loose: true }];
    }
    let mut parts: Vec<_> = objects.into_iter().collect();
    parts.sort_by_key(|(_, (order, _))| *order);
    let part =
        |(name, (order, faces)): (&str, (usize, Vec<usize>))| Part { name: name.to_owned(), faces, loose: order == 0 };
    parts.into_iter().map(part).collect()
}

struct File<'a> {
    model: &'a Model,
    origin: Vector3<f64>,
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    assets: Map<String, Value>,
    normals: bool,
}

impl<'a> File<'a> {
    fn of(model: &'a Model) -> Self {
        let mesh = model.mesh();
        let far = mesh.positions().iter().any(|p| p.coords.amax() > FAR * mesh.diagonal());
        let middle = mesh.bounding_box().map(|(low, high)| nalgebra::center(&low, &high).coords);
        let origin = middle.filter(|_| far && mesh.diagonal() > 0.0).unwrap_or_else(Vector3::zeros);
        // The format asks for unit normals at every vertex.
        let unit = |n: &[f64; 3]| (Vector3::from(*n).norm() - 1.0).abs() < 1e-3;
        let all =
            |n: &crate::mesh::CornerData<3>| n.of_corner.iter().all(|&i| n.values.get(i as usize).is_some_and(unit));
        Self {
            model,
            origin,
            buffer: Vec::new(),
            views: Vec::new(),
            accessors: Vec::new(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            assets: Map::new(),
            normals: model.normals().is_some_and(all),
        }
    }

    fn key(&self, corner: usize) -> Key {
        let texture = self.model.texture().map_or(NO_VALUE, |t| t.of_corner[corner]);
        let normal = self.model.normals().filter(|_| self.normals).map_or(NO_VALUE, |n| n.of_corner[corner]);
        [self.model.faces().vertices()[corner], texture, normal]
    }

    /// The vertices of a part, in the order of the model's.
    fn vertices(&self, part: &Part) -> Vec<Key> {
        let corners = part.faces.iter().flat_map(|&face| self.model.faces().corners(face));
        let mut keys: Vec<_> = corners.map(|corner| self.key(corner)).collect();
        if part.loose {
            let mut named = vec![false; self.model.mesh().vertex_count()];
            self.model.faces().vertices().iter().for_each(|&v| named[v as usize] = true);
            keys.extend((0..named.len()).filter(|&v| !named[v]).map(|v| [v as u32, NO_VALUE, NO_VALUE]));
        }
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    fn part(&mut self, part: &Part) {
        let keys = self.vertices(part);
        if keys.is_empty() {
            return;
        }
        let attributes = self.attributes(&keys);
        let mut mesh = json!({ "primitives": self.primitives(part, &keys, &attributes) });
        let mut node = json!({ "mesh": self.meshes.len() });
        if !part.name.is_empty() {
            mesh["name"] = json!(part.name);
            node["name"] = json!(part.name);
        }
        if self.origin != Vector3::zeros() {
            node["translation"] = json!(self.origin.as_slice());
        }
        // A mesh without primitives is none.
        if mesh["primitives"].as_array().is_some_and(|p| !p.is_empty()) {
            self.meshes.push(mesh);
            self.nodes.push(node);
        }
    }

    fn primitives(&mut self, part: &Part, keys: &[Key], attributes: &Value) -> Vec<Value> {
        let model = self.model;
        let label = |of_face: &[u32], face: usize| of_face.get(face).copied().unwrap_or(NO_VALUE);
        let mut by_label: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        let inside: std::collections::HashSet<usize> = part.faces.iter().copied().collect();
        for (t, corners) in model.triangle_corners().iter().enumerate() {
            let face = model.face_of_triangle()[t] as usize;
            if inside.contains(&face) {
                let labels = [label(&model.groups().of_face, face), label(&model.materials().of_face, face)];
                let number =
                    |corner: u32| keys.binary_search(&self.key(corner as usize)).expect("all corners are listed");
                by_label.entry(labels).or_default().extend(corners.map(|corner| number(corner) as u32));
            }
        }
        let mut primitives = Vec::new();
        for ([group, material], indices) in by_label {
            let mut primitive = json!({ "attributes": attributes, "indices": self.indices(&indices) });
            if material != NO_VALUE {
                primitive["material"] = json!(material);
            }
            if let Some(group) = model.groups().all.get(group as usize) {
                let named = [("object", &group.object, &part.name), ("group", &group.name, &String::new())];
                let extras: Map<_, _> =
                    named.into_iter().filter(|(_, a, b)| a != b).map(|(k, a, _)| (k.to_owned(), json!(a))).collect();
                if !extras.is_empty() {
                    primitive["extras"] = Value::Object(extras);
                }
            }
            primitives.push(primitive);
        }
        primitives
    }

    fn attributes(&mut self, keys: &[Key]) -> Value {
        let model = self.model;
        let (origin, positions) = (self.origin, model.mesh().positions());
        let xyz: Vec<[f32; 3]> =
            keys.iter().map(|k| (positions[k[0] as usize].coords - origin).map(|x| x as f32).into()).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            xyz.iter().copied().reduce(|a, b| std::array::from_fn(|k| pick(a[k], b[k]))).unwrap_or_default()
        };
        let mut attributes = Map::new();
        let position = self.floats(&xyz, "VEC3");
        self.accessors[position]["min"] = json!(bound(f32::min));
        self.accessors[position]["max"] = json!(bound(f32::max));
        attributes.insert("POSITION".to_owned(), json!(position));
        if let Some(normals) = model.normals().filter(|_| self.normals) {
            let value = |k: &Key| normals.values.get(k[2] as usize).map_or([0.0, 0.0, 1.0], |n| n.map(|x| x as f32));
            let values: Vec<_> = keys.iter().map(value).collect();
            attributes.insert("NORMAL".to_owned(), json!(self.floats(&values, "VEC3")));
        }
        if let Some(texture) = model.texture() {
            let value =
                |k: &Key| texture.values.get(k[1] as usize).map_or([0.0; 2], |&[u, v]| [u as f32, (1.0 - v) as f32]);
            let values: Vec<_> = keys.iter().map(value).collect();
            attributes.insert("TEXCOORD_0".to_owned(), json!(self.floats(&values, "VEC2")));
        }
        if let Some(colors) = model.colors() {
            let values: Vec<_> = keys.iter().map(|k| colors[k[0] as usize]).collect();
            attributes.insert("COLOR_0".to_owned(), json!(self.floats(&values, "VEC4")));
        }
        Value::Object(attributes)
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34_962));
        self.accessors.push(json!({ "bufferView": view, "componentType": 5126, "count": values.len(), "type": kind }));
        self.accessors.len() - 1
    }

    fn indices(&mut self, indices: &[u32]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34_963));
        self.accessors
            .push(json!({ "bufferView": view, "componentType": 5125, "count": indices.len(), "type": "SCALAR" }));
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({ "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.buffer.extend_from_slice(bytes);
        self.buffer.resize(self.buffer.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Materials, and what they refer to as it was read.
    fn assets(&mut self) {
        let model = self.model;
        let material = |m: &crate::mesh::Material| m.gltf.clone().unwrap_or_else(|| json!({ "name": m.name }));
        let mut lists = vec![("materials", model.materials().all.iter().map(material).collect::<Vec<_>>())];
        if let Some(assets) = model.assets() {
            let mut images = assets.images.clone();
            for (image, bytes) in images.iter_mut().zip(&assets.image_bytes) {
                if let Some(bytes) = bytes {
                    image["bufferView"] = json!(self.view(bytes, None));
                }
            }
            let names = assets.extensions.iter().map(|name| json!(name)).collect();
            lists.extend([("textures", assets.textures.clone()), ("samplers", assets.samplers.clone())]);
            lists.extend([("images", images), ("extensionsUsed", names)]);
        }
        self.assets = lists
            .into_iter()
            .filter(|(_, list)| !list.is_empty())
            .map(|(name, list)| (name.to_owned(), Value::Array(list)))
            .collect();
    }

    fn document(self) -> Value {
        let mut document = self.assets;
        document.insert("asset".to_owned(), json!({ "version": "2.0", "generator": "plumbline" }));
        let scene: Vec<usize> = (0..self.nodes.len()).collect();
        // Empty lists are not allowed.
        for (name, list) in [
            ("bufferViews", self.views),
            ("accessors", self.accessors),
            ("meshes", self.meshes),
            ("nodes", self.nodes),
            ("scenes", if scene.is_empty() { vec![] } else { vec![json!({ "nodes": scene })] }),
        ] {
            if !list.is_empty() {
                document.insert(name.to_owned(), Value::Array(list));
            }
        }
        if !scene.is_empty() {
            document.insert("scene".to_owned(), json!(0));
        }
        Value::Object(document)
    }
}
