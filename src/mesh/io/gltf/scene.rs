//! The triangles of a scene, moved by its nodes.

use nalgebra::{Matrix3, Matrix4, Point3, Quaternion, Rotation3, UnitQuaternion, Vector3};

use super::super::ReadLimits;
use super::accessor::values;
use super::buffers::Buffers;
use super::document::{Document, Mesh, Node, Primitive};
use super::fault;
use crate::mesh::{Group, Material, MeshError, ModelBuilder, NO_VALUE};

/// Triangles of one primitive as numbers of its vertices.
type Triangles = Vec<[u32; 3]>;

struct Scene<'a> {
    document: &'a Document,
    buffers: &'a Buffers<'a>,
    limits: &'a ReadLimits,
    builder: ModelBuilder,
    skipped: [(usize, &'static str); 4],
}

/// Reads the scene that the file opens with; all meshes where it has no nodes.
pub(super) fn read(document: &Document, buffers: &Buffers<'_>, limits: &ReadLimits) -> Result<ModelBuilder, MeshError> {
    let mut builder = ModelBuilder::default();
    for (k, material) in document.materials.iter().enumerate() {
        let name = material.get("name").and_then(|n| n.as_str()).map_or_else(|| format!("material {k}"), str::to_owned);
        builder.materials.all.push(Material { name, gltf: Some(material.clone()) });
    }
    let skipped = [
        (0, "primitives of points or lines"),
        (0, "skins (the mesh stands in its bind pose)"),
        (0, "primitives' morph targets"),
        (document.animations.len(), "animations"),
    ];
    let mut scene = Scene { document, buffers, limits, builder, skipped };
    if document.nodes.is_empty() {
        for mesh in 0..document.meshes.len() {
            scene.mesh(mesh, None, &Matrix4::identity())?;
        }
    } else {
        scene.nodes()?;
    }
    for (count, what) in scene.skipped {
        if count > 0 {
            scene.builder.warnings.push(format!("{what} are left out ({count})"));
        }
    }
    Ok(scene.builder)
}

impl Scene<'_> {
    fn nodes(&mut self) -> Result<(), MeshError> {
        let document = self.document;
        let mut seen = vec![false; document.nodes.len()];
        let mut open: Vec<(usize, Matrix4<f64>)> =
            self.roots()?.into_iter().rev().map(|node| (node, Matrix4::identity())).collect();
        while let Some((index, world_from_parent)) = open.pop() {
            let at = format!("/nodes/{index}");
            let there = document.nodes.len();
            let node = document.nodes.get(index).ok_or_else(|| fault(&at, format!("there are only {there} nodes")))?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(fault(at, "has two parents, or is its own ancestor"));
            }
            let world_from_node = world_from_parent * local(node);
            if !world_from_node.iter().all(|x| x.is_finite()) {
                return Err(fault(at, "its transformation is not finite"));
            }
            if let Some(mesh) = node.mesh {
                self.skipped[1].0 += usize::from(node.skin.is_some());
                let matrix = if node.skin.is_some() { Matrix4::identity() } else { world_from_node };
                self.mesh(mesh, node.name.as_deref(), &matrix)?;
            }
            open.extend(node.children.iter().rev().map(|&child| (child, world_from_node)));
        }
        Ok(())
    }

    fn roots(&self) -> Result<Vec<usize>, MeshError> {
        let document = self.document;
        let scene = document.scene.unwrap_or(0);
        if let Some(scene) = document.scenes.get(scene) {
            return Ok(scene.nodes.clone());
        }
        if document.scene.is_some() {
            return Err(fault("/scene", format!("{scene}; there are {} scenes", document.scenes.len())));
        }
        let mut is_child = vec![false; document.nodes.len()];
        for &child in document.nodes.iter().flat_map(|node| &node.children) {
            if let Some(flag) = is_child.get_mut(child) {
                *flag = true;
            }
        }
        Ok((0..document.nodes.len()).filter(|&node| !is_child[node]).collect())
    }

    fn mesh(&mut self, index: usize, node_name: Option<&str>, matrix: &Matrix4<f64>) -> Result<(), MeshError> {
        let document = self.document;
        let at = format!("/meshes/{index}");
        let there = document.meshes.len();
        let mesh: &Mesh =
            document.meshes.get(index).ok_or_else(|| fault(&at, format!("there are only {there} meshes")))?;
        let object = node_name.or(mesh.name.as_deref()).unwrap_or_default().to_owned();
        // Primitives that share their vertices keep sharing them.
        let mut read: Vec<(&Primitive, u32)> = Vec::new();
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            let at = format!("{at}/primitives/{k}");
            if primitive.mode.is_some_and(|mode| mode < 4) {
                self.skipped[0].0 += 1;
                continue;
            }
            self.skipped[2].0 += usize::from(!primitive.targets.is_empty());
            let shared = read.iter().find(|(other, _)| other.attributes == primitive.attributes);
            let first = match shared {
                Some(&(_, first)) => first,
                None => self.vertices(primitive, matrix, &at)?,
            };
            read.push((primitive, first));
            let extra = |key: &str| primitive.extras.as_ref()?.get(key)?.as_str().map(str::to_owned);
            let group = Group {
                object: extra("object").unwrap_or_else(|| object.clone()),
                name: extra("group").unwrap_or_default(),
            };
            let count = self.count_of(primitive);
            let triangles = self.triangles(primitive, count, &at)?;
            self.faces(primitive, group, first, triangles, matrix.determinant() < 0.0, &at)?;
        }
        Ok(())
    }

    /// Number of a primitive's vertices.
    fn count_of(&self, primitive: &Primitive) -> usize {
        let accessor = primitive.attributes.get("POSITION").and_then(|&index| self.document.accessors.get(index));
        accessor.map_or(0, |a| a.count as usize)
    }

    /// Adds the vertices of a primitive; the number of the first.
    fn vertices(&mut self, primitive: &Primitive, matrix: &Matrix4<f64>, at: &str) -> Result<u32, MeshError> {
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let read = |index: usize, kinds: &[&str]| values(self.document, self.buffers, index, kinds, self.limits);
        let position = attribute("POSITION").ok_or_else(|| fault(at, "has no attribute POSITION"))?;
        let positions = read(position, &["VEC3"])?;
        let normals = attribute("NORMAL").map(|index| read(index, &["VEC3"])).transpose()?;
        let texture = attribute("TEXCOORD_0").map(|index| read(index, &["VEC2"])).transpose()?;
        let colors = attribute("COLOR_0").map(|index| read(index, &["VEC3", "VEC4"])).transpose()?;
        let count = positions.len();
        for (name, other) in [("NORMAL", &normals), ("TEXCOORD_0", &texture), ("COLOR_0", &colors)] {
            if let Some(other) = other.as_ref().filter(|other| other.len() != count) {
                return Err(fault(at, format!("{name} has {} values for {count} vertices", other.len())));
            }
        }
        let builder = &mut self.builder;
        let first = builder.positions.len();
        self.limits.check("number of vertices", first + count)?;
        for (k, xyz) in positions.rows::<3>().enumerate() {
            let p = matrix.transform_point(&Point3::from(xyz));
            let place = || crate::mesh::Position::Json(format!("/accessors/{position}, item {k}"));
            builder.positions.push(super::super::finite(super::MeshFormat::Gltf, place, first + k, p.coords.into())?);
        }
        // One value per vertex; where a primitive has none, zeros fill the gap and no corner refers to them.
        builder.normals.values.resize(if normals.is_some() { first } else { builder.normals.values.len() }, [0.0; 3]);
        let turn = normal_matrix(matrix);
        for row in normals.iter().flat_map(|normals| normals.rows::<3>()) {
            let normal = (turn * Vector3::from(row)).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
            builder.normals.values.push(normal.unwrap_or_else(Vector3::zeros).into());
        }
        builder.texture.values.resize(if texture.is_some() { first } else { builder.texture.values.len() }, [0.0; 2]);
        for [u, v] in texture.iter().flat_map(|texture| texture.rows::<2>()) {
            builder.texture.values.push([u, 1.0 - v].map(|x| if x.is_finite() { x } else { 0.0 }));
        }
        if let Some(colors) = colors {
            builder.colors.resize(first, [1.0; 4]);
            builder.colors.extend(colors.rows::<4>().map(|c| c.map(|x| if x.is_finite() { x as f32 } else { 0.0 })));
        }
        Ok(first as u32)
    }

    fn triangles(&self, primitive: &Primitive, count: usize, at: &str) -> Result<Triangles, MeshError> {
        let indices: Vec<u32> = match primitive.indices {
            None => (0..count as u32).collect(),
            Some(index) => {
                let read = values(self.document, self.buffers, index, &["SCALAR"], self.limits)?;
                let number = |&value: &f64| {
                    let fits = value >= 0.0 && value < count as f64 && value.fract() == 0.0;
                    let told = || fault(at, format!("a triangle names vertex {value}; the primitive has {count}"));
                    fits.then_some(value as u32).ok_or_else(told)
                };
                read.numbers.iter().map(number).collect::<Result<_, _>>()?
            }
        };
        match primitive.mode.unwrap_or(4) {
            4 if !indices.len().is_multiple_of(3) => {
                Err(fault(at, format!("{} corners make no triangles", indices.len())))
            }
            4 => Ok(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()),
            5 => {
                let turned = |(k, t): (usize, &[u32])| if k % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
                Ok(indices.windows(3).enumerate().map(turned).collect())
            }
            6 => Ok(indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect()),
            mode => Err(fault(format!("{at}/mode"), format!("{mode} is no mode (0 to 6)"))),
        }
    }

    fn faces(
        &mut self,
        primitive: &Primitive,
        group: Group,
        first: u32,
        triangles: Triangles,
        mirrored: bool,
        at: &str,
    ) -> Result<(), MeshError> {
        let builder = &mut self.builder;
        self.limits.check("number of corners", builder.faces.corner_count() + 3 * triangles.len())?;
        let materials = builder.materials.all.len();
        let material = match primitive.material {
            Some(material) if material >= materials => {
                return Err(fault(at, format!("refers to material {material}; there are {materials}")));
            }
            material => material.map_or(NO_VALUE, |m| m as u32),
        };
        let label = if group == Group::default() { NO_VALUE } else { builder.group(group) };
        let has = |name: &str| primitive.attributes.contains_key(name);
        let (normals, texture) = (has("NORMAL"), has("TEXCOORD_0"));
        for [a, b, c] in triangles {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] }.map(|v| v + first);
            builder.face(&corners, label, material);
            builder.normals.of_corner.extend(corners.map(|v| if normals { v } else { NO_VALUE }));
            builder.texture.of_corner.extend(corners.map(|v| if texture { v } else { NO_VALUE }));
        }
        Ok(())
    }
}

fn local(node: &Node) -> Matrix4<f64> {
    if let Some(columns) = node.matrix {
        return Matrix4::from_column_slice(&columns);
    }
    let [x, y, z, w] = node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
    let quaternion = Quaternion::new(w, x, y, z);
    let turn =
        if quaternion.norm() > 0.0 { UnitQuaternion::from_quaternion(quaternion) } else { UnitQuaternion::identity() };
    let scale = Matrix3::from_diagonal(&Vector3::from(node.scale.unwrap_or([1.0; 3])));
    let linear = Rotation3::from(turn).into_inner() * scale;
    let mut matrix = linear.to_homogeneous();
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(&Vector3::from(node.translation.unwrap_or([0.0; 3])));
    matrix
}

/// Cofactors: the inverse transpose but for a factor, which exists for singular matrices too.
fn normal_matrix(matrix: &Matrix4<f64>) -> Matrix3<f64> {
    let m = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let column = |k: usize| m.column(k).into_owned();
    let [a, b, c] = [column(0), column(1), column(2)];
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)]) * sign
}
