//! The triangles of a scene, transformed by its nodes.

use nalgebra::{Matrix3, Matrix4, Point3, Vector3};

use super::super::triangles_of_strip;
use super::accessor::Values;
use super::articulation::{animations, nodes, skins, targets};
use super::document::Primitive;
use super::input::Input;
use super::{fault, item};
use crate::mesh::model::articulation::{Articulation, Instance, MorphTarget};
use crate::mesh::{Group, Material, MeshError, ModelBuilder, NO_VALUE};
use plumbline_num::run::Run;

/// Triangles of one primitive, as indices of its vertices.
type Triangles = Vec<[u32; 3]>;

/// Transform, skin and morph targets of the instance that is being read.
struct Placement {
    matrix: Matrix4<f64>,
    skin: Option<usize>,
    targets: Vec<MorphTarget>,
}

struct Scene<'a> {
    input: &'a Input<'a>,
    builder: ModelBuilder,
    articulation: Articulation,
    world_from_nodes: Vec<Matrix4<f64>>,
    /// Counts of ignored contents: primitives of points and lines, animation channels, influences beyond the second set.
    skipped: [usize; 3],
    /// Number of vertices whose skinning weights do not sum to one.
    odd_weights: usize,
}

/// Reads the default scene; all meshes if there are no nodes.
pub(super) fn read(input: &Input<'_>, run: &Run) -> Result<ModelBuilder, MeshError> {
    let document = input.document;
    let mut builder = ModelBuilder::default();
    for (k, material) in document.materials.iter().enumerate() {
        let name = material.get("name").and_then(|n| n.as_str()).map_or_else(|| format!("material {k}"), str::to_owned);
        builder.materials.all.push(Material { name, gltf: Some(material.clone()) });
    }
    let articulation =
        Articulation { nodes: nodes::read(document)?, skins: skins::read(input)?, ..Articulation::default() };
    let world_from_nodes = articulation.world_from_nodes();
    let mut scene = Scene { input, builder, articulation, world_from_nodes, skipped: [0; 3], odd_weights: 0 };
    if document.nodes.is_empty() {
        for mesh in 0..document.meshes.len() {
            scene.mesh(mesh, None, run)?;
        }
    } else {
        scene.nodes(run)?;
    }
    scene.finish()
}

impl Scene<'_> {
    /// The builder with the warnings, and with the articulation if there is a skin, a morph target or an animation channel.
    fn finish(mut self) -> Result<ModelBuilder, MeshError> {
        let (animations, skipped) = animations::read(self.input, &self.articulation)?;
        self.articulation.animations = animations;
        self.skipped[1] = skipped;
        let told = [
            "primitives of points or lines",
            "channels of animations that move nothing known",
            "influences beyond eight a vertex",
        ];
        for (count, what) in self.skipped.into_iter().zip(told) {
            if count > 0 {
                self.builder.warnings.push(format!("{what} are left out ({count})"));
            }
        }
        if self.odd_weights > 0 {
            let told =
                format!("weights that do not sum to one are scaled so that they do ({} vertices)", self.odd_weights);
            self.builder.warnings.push(told);
        }
        let moving = &self.articulation;
        let skinned = moving.instances.iter().any(|i| i.skin.is_some() || !i.targets.is_empty());
        if skinned || moving.animations.iter().any(|a| !a.channels.is_empty()) {
            self.builder.articulation = Some(self.articulation);
        }
        Ok(self.builder)
    }

    /// Reads the meshes of the scene, by depth-first traversal of its nodes.
    fn nodes(&mut self, run: &Run) -> Result<(), MeshError> {
        let document = self.input.document;
        let mut seen = vec![false; document.nodes.len()];
        let roots = self.roots()?;
        self.articulation.roots = roots.iter().map(|&node| node as u32).collect();
        let mut open: Vec<usize> = roots.into_iter().rev().collect();
        while let Some(index) = open.pop() {
            let at = format!("/nodes/{index}");
            let node = item(&document.nodes, index, &at, "node")?;
            if std::mem::replace(&mut seen[index], true) {
                return Err(fault(at, "has two parents, or is its own ancestor"));
            }
            if !self.world_from_nodes[index].iter().all(|x| x.is_finite()) {
                return Err(fault(at, "its transformation is not finite"));
            }
            if let Some(mesh) = node.mesh {
                self.mesh(mesh, Some(index), run)?;
            }
            open.extend(node.children.iter().rev());
        }
        Ok(())
    }

    /// Root nodes: those of the default scene, or, without scenes, the nodes without a parent.
    fn roots(&self) -> Result<Vec<usize>, MeshError> {
        let document = self.input.document;
        let scene = document.scene.unwrap_or(0);
        if let Some(scene) = document.scenes.get(scene) {
            return Ok(scene.nodes.clone());
        }
        if document.scene.is_some() {
            return Err(fault("/scene", format!("{scene}; there are {} scenes", document.scenes.len())));
        }
        let nodes = self.articulation.nodes.iter().enumerate();
        Ok(nodes.filter(|(_, node)| node.parent.is_none()).map(|(k, _)| k).collect())
    }

    /// Reads a mesh as the instance at a node.
    fn mesh(&mut self, index: usize, node: Option<usize>, run: &Run) -> Result<(), MeshError> {
        let document = self.input.document;
        let at = format!("/meshes/{index}");
        let mesh = item(&document.meshes, index, &at, "mesh")?;
        // Name, skin, transform and morph targets of the instance.
        let described = node.map(|node| &document.nodes[node]);
        let object = described.and_then(|n| n.name.as_deref()).or(mesh.name.as_deref()).unwrap_or_default().to_owned();
        let skin = described.and_then(|n| n.skin);
        let mut placement = Placement {
            // A skinned mesh is in its bind pose: by the specification its node transform is ignored.
            matrix: node.filter(|_| skin.is_none()).map_or_else(Matrix4::identity, |n| self.world_from_nodes[n]),
            skin,
            targets: targets::of_mesh(mesh, described, &at)?,
        };
        // Primitives with the same attributes and targets have the same vertices: they are read once.
        let mut read: Vec<(&Primitive, u32)> = Vec::new();
        for (k, primitive) in mesh.primitives.iter().enumerate() {
            run.check()?;
            let at = format!("{at}/primitives/{k}");
            if primitive.mode.is_some_and(|mode| mode < 4) {
                self.skipped[0] += 1;
                continue;
            }
            let same =
                |other: &Primitive| (&other.attributes, &other.targets) == (&primitive.attributes, &primitive.targets);
            let first = match read.iter().find(|(other, _)| same(other)) {
                Some(&(_, first)) => first,
                None => self.vertices(primitive, &mut placement, &at)?,
            };
            read.push((primitive, first));
            // Object and group names: those of the writer of this crate in `extras`, else the node's or the mesh's.
            let extra = |key: &str| primitive.extras.as_ref()?.get(key)?.as_str().map(str::to_owned);
            let group = Group {
                object: extra("object").unwrap_or_else(|| object.clone()),
                name: extra("group").unwrap_or_default(),
            };
            let count = self.count_of(primitive);
            let triangles = self.triangles(primitive, count, &at)?;
            self.faces(primitive, group, first, triangles, placement.matrix.determinant() < 0.0, &at)?;
        }
        if let Some(node) = node {
            let (node, skin) = (node as u32, skin.map(|s| s as u32));
            self.articulation.instances.push(Instance {
                node,
                skin,
                mesh: mesh.name.clone(),
                targets: placement.targets,
            });
        }
        Ok(())
    }

    /// Number of vertices of a primitive.
    fn count_of(&self, primitive: &Primitive) -> usize {
        let accessors = &self.input.document.accessors;
        let accessor = primitive.attributes.get("POSITION").and_then(|&index| accessors.get(index));
        accessor.map_or(0, |a| a.count as usize)
    }

    /// Adds the vertices of a primitive; returns the index of the first.
    fn vertices(&mut self, primitive: &Primitive, placement: &mut Placement, at: &str) -> Result<u32, MeshError> {
        let (input, matrix) = (self.input, placement.matrix);
        let attribute = |name: &str| primitive.attributes.get(name).copied();
        let read = |index: usize, kinds: &[&str]| input.values(index, kinds);
        // Attributes, with equal counts.
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
        input.limits.check("number of vertices", first + count)?;
        // Positions in the space of the model.
        for (k, xyz) in positions.rows::<3>().enumerate() {
            let p = matrix.transform_point(&Point3::from(xyz));
            let at = || crate::mesh::Position::Json(format!("/accessors/{position}, item {k}"));
            super::super::add_vertex(builder, super::MeshFormat::Gltf, at, p.coords.into());
        }
        // Normals, texture coordinates and colors are indexed by vertex; zeros pad primitives without them, unreferenced.
        // v is flipped: glTF has its origin at the top, [`Model`](crate::mesh::Model) at the bottom.
        builder.normals.values.resize(if normals.is_some() { first } else { builder.normals.values.len() }, [0.0; 3]);
        let of_normals = normal_matrix(&matrix);
        for row in normals.iter().flat_map(Values::rows::<3>) {
            let normal =
                (of_normals * Vector3::from(row)).try_normalize(0.0).filter(|n| n.iter().all(|x| x.is_finite()));
            builder.normals.values.push(normal.unwrap_or_else(Vector3::zeros).into());
        }
        builder.texture.values.resize(if texture.is_some() { first } else { builder.texture.values.len() }, [0.0; 2]);
        for [u, v] in texture.iter().flat_map(Values::rows::<2>) {
            builder.texture.values.push([u, 1.0 - v].map(|x| if x.is_finite() { x } else { 0.0 }));
        }
        if let Some(colors) = colors {
            builder.colors.resize(first, [1.0; 4]);
            builder.colors.extend(colors.rows::<4>().map(|c| c.map(|x| if x.is_finite() { x as f32 } else { 0.0 })));
        }
        self.movement(primitive, placement, (first, count), &of_normals, at)?;
        Ok(first as u32)
    }

    /// Adds the instance, the skinning weights and the morph targets of the vertices of a primitive.
    fn movement(
        &mut self,
        primitive: &Primitive,
        placement: &mut Placement,
        (first, count): (usize, usize),
        of_normals: &Matrix3<f64>,
        at: &str,
    ) -> Result<(), MeshError> {
        let linear = placement.matrix.fixed_view::<3, 3>(0, 0).into_owned();
        targets::add(self.input, &mut placement.targets, primitive, (first, count), [&linear, of_normals], at)?;
        let instance = self.articulation.instances.len() as u32;
        self.articulation.instance_of_vertex.resize(first + count, instance);
        let Some(skin) = placement.skin else {
            (0..count).for_each(|_| self.articulation.influences.push([]));
            return Ok(());
        };
        self.skipped[2] += usize::from(primitive.attributes.contains_key("JOINTS_2"));
        let (rows, odd) = skins::influences(self.input, primitive, (skin, count), at)?;
        self.odd_weights += odd;
        for row in rows {
            self.articulation.influences.push(row);
        }
        Ok(())
    }

    /// Triangles of a primitive by its mode: 4 triangles, 5 triangle strip, 6 triangle fan.
    fn triangles(&self, primitive: &Primitive, count: usize, at: &str) -> Result<Triangles, MeshError> {
        let indices: Vec<u32> = match primitive.indices {
            None => {
                self.input.spend(count, at)?;
                (0..count as u32).collect()
            }
            Some(index) => {
                let read = self.input.values(index, &["SCALAR"])?;
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
            5 => Ok(triangles_of_strip(&indices).collect()),
            6 => Ok(indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect()),
            mode => Err(fault(format!("{at}/mode"), format!("{mode} is no mode (0 to 6)"))),
        }
    }

    /// Adds the triangles of a primitive, with reversed orientation if the transform is a reflection.
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
        self.input.limits.check("number of corners", builder.faces.corner_count() + 3 * triangles.len())?;
        let known = |&material: &usize| item(&builder.materials.all, material, at, "material");
        primitive.material.as_ref().map(known).transpose()?;
        let material = primitive.material.map_or(NO_VALUE, |m| m as u32);
        let label = if group == Group::default() { NO_VALUE } else { builder.group(group)? };
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

/// Transform of normals: the cofactor matrix, which is the inverse transpose up to a positive factor and exists for singular
/// matrices too.
pub(in crate::mesh::io) fn normal_matrix(matrix: &Matrix4<f64>) -> Matrix3<f64> {
    let m = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let column = |k: usize| m.column(k).into_owned();
    let [a, b, c] = [column(0), column(1), column(2)];
    let sign = if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    Matrix3::from_columns(&[b.cross(&c), c.cross(&a), a.cross(&b)]) * sign
}
