//! glTF writer.
//!
//! One node per object if objects have no common vertices, otherwise one node for all; one primitive per group and material. A
//! vertex with several texture coordinates or normals is duplicated. Coordinates are 32-bit numbers: for a mesh far from the
//! origin they are relative to the center of its bounding box, and the node has the translation. An articulated model keeps its
//! own nodes instead, and each mesh is written in the space of its node.

mod articulation;
mod parts;

use std::collections::BTreeMap;
use std::io::{self, Write};

use nalgebra::Vector3;
use serde_json::{Map, Value, json};

use crate::mesh::{Model, NO_VALUE};
pub(in crate::mesh::io) use articulation::MAX_INFLUENCES;
use parts::{Part, origin, parts};
use plumbline_num::document::gltf::{ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER, GltfBuffer};

/// Component type of indices: `UNSIGNED_INT` of the glTF specification, which covers the 32-bit vertex indices of a model.
const UNSIGNED_INT: u32 = 5125;

/// Indices of vertex, texture coordinate and normal: the identity of a written vertex.
type Key = [u32; 3];

/// Writes the model, as GLB if `binary`.
pub(in crate::mesh::io) fn write(model: &Model, binary: bool, out: &mut impl Write) -> io::Result<()> {
    let mut file = File::of(model);
    let meshes: Vec<_> = parts(model).iter().map(|part| file.part(part)).collect();
    if let Some(articulation) = model.articulation() {
        file.articulation(articulation, &meshes);
    }
    file.assets();
    let buffer = std::mem::take(&mut file.buffer);
    buffer.write(file.document(), binary, out)?;
    if binary { Ok(()) } else { out.write_all(b"\n") }
}

/// Names an item, unless the name is empty.
fn named(item: &mut Value, name: Option<&str>) {
    if let Some(name) = name.filter(|name| !name.is_empty()) {
        item["name"] = json!(name);
    }
}

struct File<'a> {
    model: &'a Model,
    buffer: GltfBuffer,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    roots: Vec<usize>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    assets: Map<String, Value>,
    normals: bool,
}

impl<'a> File<'a> {
    fn of(model: &'a Model) -> Self {
        // The specification requires unit normals at every vertex; 10⁻³ is a tolerance for rounding.
        let unit = |n: &[f64; 3]| (Vector3::from(*n).norm() - 1.0).abs() < 1e-3;
        let all =
            |n: &crate::mesh::CornerData<3>| n.of_corner.iter().all(|&i| n.values.get(i as usize).is_some_and(unit));
        Self {
            model,
            buffer: GltfBuffer::default(),
            meshes: Vec::new(),
            nodes: Vec::new(),
            roots: Vec::new(),
            skins: Vec::new(),
            animations: Vec::new(),
            assets: Map::new(),
            normals: model.normals().is_some_and(all),
        }
    }

    fn key(&self, corner: usize) -> Key {
        let texture = self.model.texture().map_or(NO_VALUE, |t| t.of_corner[corner]);
        let normal = self.model.normals().filter(|_| self.normals).map_or(NO_VALUE, |n| n.of_corner[corner]);
        [self.model.faces().vertices()[corner], texture, normal]
    }

    /// The distinct vertices of a part, sorted by vertex index.
    fn vertices(&self, part: &Part) -> Vec<Key> {
        let corners = part.faces.iter().flat_map(|&face| self.model.faces().corners(face));
        let mut keys: Vec<_> = corners.map(|corner| self.key(corner)).collect();
        keys.extend(part.loose.iter().map(|&v| [v, NO_VALUE, NO_VALUE]));
        keys.sort_unstable();
        keys.dedup();
        keys
    }

    /// Writes a part, and its node if it has none; returns the index of its mesh.
    fn part(&mut self, part: &Part) -> Option<usize> {
        let keys = self.vertices(part);
        // glTF requires at least one primitive per mesh.
        if keys.is_empty() || part.faces.is_empty() {
            return None;
        }
        let attributes = self.attributes(part, &keys);
        let targets = self.targets(part, &keys);
        let mut mesh = json!({ "primitives": self.primitives(part, &keys, &attributes, &targets) });
        named(&mut mesh, Some(&part.mesh));
        if mesh["primitives"].as_array().is_none_or(Vec::is_empty) {
            return None;
        }
        self.meshes.push(mesh);
        if part.instance.is_none() {
            let mut node = json!({ "mesh": self.meshes.len() - 1 });
            named(&mut node, Some(&part.name));
            let origin = origin(self.model);
            if origin != Vector3::zeros() {
                node["translation"] = json!(origin.as_slice());
            }
            self.roots.push(self.nodes.len());
            self.nodes.push(node);
        }
        Some(self.meshes.len() - 1)
    }

    /// The primitives of a part: its triangles grouped by group and material.
    fn primitives(&mut self, part: &Part, keys: &[Key], attributes: &Value, targets: &[Value]) -> Vec<Value> {
        let (model, mirrored) = (self.model, part.mirrored());
        let label = |of_face: &[u32], face: usize| of_face.get(face).copied().unwrap_or(NO_VALUE);
        let mut by_label: BTreeMap<[u32; 2], Vec<u32>> = BTreeMap::new();
        let inside: std::collections::HashSet<usize> = part.faces.iter().copied().collect();
        for (t, corners) in model.triangle_corners().iter().enumerate() {
            let face = model.face_of_triangle()[t] as usize;
            if inside.contains(&face) {
                let labels = [label(&model.groups().of_face, face), label(&model.materials().of_face, face)];
                let number =
                    |corner: u32| keys.binary_search(&self.key(corner as usize)).expect("all corners are listed");
                let [a, b, c] = corners.map(|corner| number(corner) as u32);
                by_label.entry(labels).or_default().extend(if mirrored { [a, c, b] } else { [a, b, c] });
            }
        }
        let mut primitives = Vec::new();
        for ([group, material], indices) in by_label {
            let bytes: Vec<u8> = indices.iter().flat_map(|i| i.to_le_bytes()).collect();
            let target = Some(ELEMENT_ARRAY_BUFFER);
            let indices = self.buffer.accessor(&bytes, UNSIGNED_INT, indices.len(), "SCALAR", target);
            let mut primitive = json!({ "attributes": attributes, "indices": indices });
            if !targets.is_empty() {
                primitive["targets"] = json!(targets);
            }
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

    fn attributes(&mut self, part: &Part, keys: &[Key]) -> Value {
        let model = self.model;
        let positions = model.mesh().positions();
        let moved = |k: &Key| part.from_model.transform_point(&positions[k[0] as usize]).coords;
        let xyz: Vec<[f32; 3]> = keys.iter().map(|k| moved(k).map(|x| x as f32).into()).collect();
        let mut attributes = Map::new();
        attributes.insert("POSITION".to_owned(), json!(self.buffer.bounded(&xyz, "VEC3", Some(ARRAY_BUFFER))));
        if let Some(normals) = model.normals().filter(|_| self.normals) {
            let value = |k: &Key| normals.values.get(k[2] as usize).map_or([0.0, 0.0, 1.0], |n| part.normal(n));
            let values: Vec<_> = keys.iter().map(|k| value(k).map(|x| x as f32)).collect();
            attributes.insert("NORMAL".to_owned(), json!(self.buffer.floats(&values, "VEC3", Some(ARRAY_BUFFER))));
        }
        if let Some(texture) = model.texture() {
            let value =
                |k: &Key| texture.values.get(k[1] as usize).map_or([0.0; 2], |&[u, v]| [u as f32, (1.0 - v) as f32]);
            let values: Vec<_> = keys.iter().map(value).collect();
            attributes.insert("TEXCOORD_0".to_owned(), json!(self.buffer.floats(&values, "VEC2", Some(ARRAY_BUFFER))));
        }
        if let Some(colors) = model.colors() {
            let values: Vec<_> = keys.iter().map(|k| colors[k[0] as usize]).collect();
            attributes.insert("COLOR_0".to_owned(), json!(self.buffer.floats(&values, "VEC4", Some(ARRAY_BUFFER))));
        }
        self.influences(part, keys, &mut attributes);
        Value::Object(attributes)
    }

    /// Materials, with their textures, samplers and images as they were read.
    fn assets(&mut self) {
        let model = self.model;
        let material = |m: &crate::mesh::Material| m.gltf.clone().unwrap_or_else(|| json!({ "name": m.name }));
        let mut lists = vec![("materials", model.materials().all.iter().map(material).collect::<Vec<_>>())];
        if let Some(assets) = model.assets() {
            let mut images = assets.images.clone();
            for (image, bytes) in images.iter_mut().zip(&assets.image_bytes) {
                if let Some(bytes) = bytes {
                    image["bufferView"] = json!(self.buffer.view(bytes, None));
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

    fn document(self) -> Map<String, Value> {
        let mut document = self.assets;
        document.insert("asset".to_owned(), json!({ "version": "2.0", "generator": "plumbline" }));
        for (name, list) in
            [("meshes", self.meshes), ("nodes", self.nodes), ("skins", self.skins), ("animations", self.animations)]
        {
            document.insert(name.to_owned(), Value::Array(list));
        }
        if !self.roots.is_empty() {
            document.insert("scenes".to_owned(), json!([{ "nodes": self.roots }]));
            document.insert("scene".to_owned(), json!(0));
        }
        document
    }
}
