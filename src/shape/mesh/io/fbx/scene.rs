//! Assembly of the model: nodes, meshes at them, animations; then our units and axes.

use std::collections::HashMap;

use nalgebra::{Matrix4, Point3, Vector3};

use super::super::gltf::normal_matrix;
use super::animation::{self, Animated, Morphed};
use super::document::{Document, Kind};
use super::fault;
use super::geometry::{self, LeftOut, Placement};
use super::shapes;
use super::skin::{self, Joints};
use super::transform::{Coordinates, Inherited, NodeParts, place};
use crate::mesh::model::articulation::{Articulation, Instance, Node, NodeTransform, cycle};
use crate::mesh::model::{all_finite, articulated};
use crate::mesh::{Group, Material, MeshError, ModelBuilder, NO_VALUE};

/// Object without a node or a label.
const NONE: u32 = NO_VALUE;

/// The model, as far as it is read.
struct Scene<'d, 'r, 'a> {
    document: &'d Document<'r, 'a>,
    coordinates: Coordinates,
    builder: ModelBuilder,
    articulation: Articulation,
    world_from_nodes: Vec<Matrix4<f64>>,
    /// Node of each object that is a model.
    node_of: Vec<u32>,
    /// Label of each object that is a material, once a face may have it.
    label_of: Vec<u32>,
    morphed: Vec<Morphed>,
    left_out: LeftOut,
    /// Further skins of meshes, clusters without a joint, further shapes of channels, vertices whose weights do not sum to one.
    counts: [usize; 4],
}

/// Reads the objects of a document.
pub(super) fn read(document: &Document<'_, '_>) -> Result<ModelBuilder, MeshError> {
    let coordinates = Coordinates::of(&document.reader.tree);
    let models: Vec<u32> = document.all(Kind::Model).collect();
    let mut node_of = vec![NONE; document.objects.len()];
    for (node, &model) in models.iter().enumerate() {
        node_of[model as usize] = node as u32;
    }
    let mut builder = ModelBuilder::default();
    if coordinates.doubtful {
        builder.warnings.push("axes or unit of the file are not valid; y is up, and the unit a centimeter".to_owned());
    }
    // Nodes and their frames.
    let defaults = NodeParts::defaults(&document.reader.tree);
    let parts: Vec<NodeParts> = models
        .iter()
        .map(|&model| {
            let mut parts = defaults.clone();
            parts.read(&document.reader.tree, document.object(model).record);
            parts
        })
        .collect();
    let mut nodes = hierarchy(document, &models, &node_of)?;
    let placed = frames(&mut nodes, &parts);
    let animated: Vec<Animated<'_>> = models
        .iter()
        .zip(&parts)
        .zip(placed)
        .map(|((&model, parts), (scale, approximate))| Animated { model, parts, scale, approximate })
        .collect();
    let roots = (0..nodes.len() as u32).filter(|&n| nodes[n as usize].parent.is_none()).collect();
    let articulation = Articulation { nodes, roots, ..Articulation::default() };
    // Meshes at the nodes.
    let mut scene = Scene {
        document,
        coordinates,
        builder,
        world_from_nodes: articulation.world_from_nodes(),
        articulation,
        node_of,
        label_of: vec![NONE; document.objects.len()],
        morphed: Vec::new(),
        left_out: LeftOut::default(),
        counts: [0; 4],
    };
    let bind_pose = document.bind_pose()?;
    for (model, parts) in models.iter().zip(&parts) {
        scene.meshes(*model, parts, &bind_pose)?;
    }
    // Animations.
    let read = animation::read(document, &animated, &scene.morphed)?;
    scene.articulation.animations = read.animations;
    let unknown = parts.iter().filter(|p| p.has_unknown_order()).count();
    let inherited = animated.iter().filter(|a| a.approximate).count();
    scene.warn(&[
        (unknown, "rotation orders that are not known are read as x, y, z (nodes)"),
        (
            inherited - read.approximate.min(inherited),
            "nodes that inherit scale in an unusual way get matrices, or the usual way",
        ),
        (read.approximate, "animated nodes that inherit scale in an unusual way are approximated"),
        (read.layers, "animation layers after the first are left out (properties)"),
        (read.coarse, "animation channels are sampled more coarsely than usual: the file is small for them"),
    ]);
    if let Some(node) = too_large(&scene.articulation) {
        return Err(document.fault(models[node], "its transform or its animation is too large for a number"));
    }
    scene.finish()
}

/// The first node of a number that is not finite in single precision, which is that of the formats that are written.
fn too_large(articulation: &Articulation) -> Option<usize> {
    let fits = |numbers: &[f64]| numbers.iter().all(|x| (*x as f32).is_finite());
    let fits_transform = |transform: &NodeTransform| match transform {
        NodeTransform::Trs { translation, rotation, scale } => fits(translation) && fits(rotation) && fits(scale),
        NodeTransform::Matrix(matrix) => fits(matrix.as_slice()),
    };
    let resting = articulation.nodes.iter().position(|node| !fits_transform(&node.transform));
    let channels = articulation.animations.iter().flat_map(|animation| &animation.channels);
    let mut moving = channels.filter(|channel| !(fits(&channel.times) && fits(&channel.values)));
    resting.or_else(|| moving.next().map(|channel| channel.node as usize))
}

/// The nodes with their parents.
fn hierarchy(document: &Document<'_, '_>, models: &[u32], node_of: &[u32]) -> Result<Vec<Node>, MeshError> {
    let named = |&model: &u32| Node { name: Some(document.name(model)).filter(|n| !n.is_empty()), ..Node::default() };
    let mut nodes: Vec<Node> = models.iter().map(named).collect();
    for (parent, &model) in models.iter().enumerate() {
        for child in document.parts(model, Kind::Model) {
            // The first of several parents.
            nodes[node_of[child as usize] as usize].parent.get_or_insert(parent as u32);
        }
    }
    match cycle(&nodes) {
        Some(node) => Err(document.fault(models[node], "it is its own ancestor by the connections of the file")),
        None => Ok(nodes),
    }
}

/// Sets the transforms of the nodes; returns the factor of the scale of each, and whether its animation is approximate.
fn frames(nodes: &mut [Node], parts: &[NodeParts]) -> Vec<(f64, bool)> {
    let mut passed_on: Vec<Option<Inherited>> = vec![None; nodes.len()];
    let mut results = vec![(1.0, false); nodes.len()];
    for start in 0..nodes.len() {
        // The nodes from `start` up to the first ancestor that is known, then down again.
        let mut path = vec![start];
        let mut above = nodes[start].parent;
        while let Some(node) = above.filter(|&node| passed_on[node as usize].is_none()) {
            path.push(node as usize);
            above = nodes[node as usize].parent;
        }
        for node in path.into_iter().rev() {
            if passed_on[node].is_some() {
                continue;
            }
            let parent = nodes[node].parent.and_then(|p| passed_on[p as usize]).unwrap_or_default();
            let placed = place(&parts[node], &parent);
            nodes[node].transform = placed.transform;
            passed_on[node] = Some(placed.passed_on);
            results[node] = (placed.scale, placed.approximate);
        }
    }
    results
}

impl Scene<'_, '_, '_> {
    /// Reads the mesh at a model.
    fn meshes(
        &mut self,
        model: u32,
        parts: &NodeParts,
        bind_pose: &HashMap<u32, Matrix4<f64>>,
    ) -> Result<(), MeshError> {
        let document = self.document;
        let Some(geometry) = document.parts(model, Kind::Mesh).next() else { return Ok(()) };
        document.open(geometry)?;
        let node = self.node_of[model as usize];
        // Skin, and where the mesh is bound.
        let joints = Joints { node_of: &self.node_of, world_from_nodes: &self.world_from_nodes, bind_pose };
        let mut skin = None;
        for object in document.parts(geometry, Kind::Skin) {
            if skin.is_none() {
                skin = skin::read(document, object, model, &joints)?;
            } else {
                self.counts[0] += 1;
            }
        }
        let world = skin.as_ref().map_or(self.world_from_nodes[node as usize], |skin| skin.bind);
        let matrix = world * parts.node_from_geometry();
        // Labels of the faces.
        let materials: Vec<u32> = document.parts(model, Kind::Material).map(|m| self.label(m)).collect();
        let object = document.name(model);
        let group =
            if object.is_empty() { NO_VALUE } else { self.builder.group(Group { object, name: String::new() })? };
        let linear = matrix.fixed_view::<3, 3>(0, 0).into_owned();
        let mirrored = (linear.determinant() < 0.0) != self.coordinates.is_mirrored();
        let placement = Placement { matrix, mirrored, group, materials: &materials };
        let first = self.builder.positions.len();
        let count = geometry::add(document, geometry, &placement, &mut self.builder, &mut self.left_out)?;
        // Morph targets and weights.
        let (targets, further) = shapes::read(document, geometry, (first, count), [&linear, &normal_matrix(&matrix)])?;
        self.counts[2] += further;
        if !targets.is_empty() {
            let channels = targets.iter().map(|t| (t.channel, t.target.weight)).collect();
            self.morphed.push(Morphed { node, channels });
        }
        let instance = self.articulation.instances.len() as u32;
        self.articulation.instance_of_vertex.resize(first + count, instance);
        let skin = self.influences(skin, count, geometry)?;
        self.articulation.instances.push(Instance {
            node,
            skin,
            mesh: Some(document.name(geometry)).filter(|n| !n.is_empty()),
            targets: targets.into_iter().map(|t| t.target).collect(),
        });
        Ok(())
    }

    /// Adds the influences of the vertices of a mesh; returns the number of its skin.
    fn influences(
        &mut self,
        skin: Option<skin::MeshSkin>,
        count: usize,
        geometry: u32,
    ) -> Result<Option<u32>, MeshError> {
        let influences = &mut self.articulation.influences;
        let Some(skin) = skin else {
            (0..count).for_each(|_| influences.push([]));
            return Ok(None);
        };
        self.counts[1] += skin.loose;
        let odd = skin.rows(count, |row| influences.push(row.iter().copied())).map_err(|vertex| {
            self.document
                .fault(geometry, format!("its skin names vertex {vertex}, but it has {count}, numbered from 0"))
        })?;
        self.counts[3] += odd;
        self.articulation.skins.push(skin.skin);
        Ok(Some(self.articulation.skins.len() as u32 - 1))
    }

    /// The label of a material.
    fn label(&mut self, material: u32) -> u32 {
        let label = &mut self.label_of[material as usize];
        if *label == NONE {
            let all = &mut self.builder.materials.all;
            *label = all.len() as u32;
            all.push(Material { name: self.document.name(material), gltf: None });
        }
        *label
    }

    fn warn(&mut self, counted: &[(usize, &str)]) {
        for (count, what) in counted.iter().filter(|(count, _)| *count > 0) {
            self.builder.warnings.push(format!("{what} ({count})"));
        }
    }

    /// The builder in our units and axes, with the articulation if something in it moves.
    fn finish(mut self) -> Result<ModelBuilder, MeshError> {
        let document = self.document;
        let [skins, loose, shapes, odd] = self.counts;
        self.warn(&[
            (self.left_out.polygons, "polygons of fewer than three corners are left out"),
            (self.left_out.layers, "normals, texture coordinates or colors by edge are left out (layers)"),
            (self.left_out.colors, "corners of one vertex have several colors, of which the first is read"),
            (skins, "skins after the first of a mesh are left out"),
            (loose, "clusters without a joint are left out"),
            (shapes, "in-between shapes are left out"),
            (odd, "weights that do not sum to one are scaled so that they do (vertices)"),
            (
                document.all(Kind::OtherGeometry).count(),
                "curves, surfaces and other geometry without polygons are left out",
            ),
            (document.all(Kind::Texture).count(), "textures are left out"),
        ]);
        let Coordinates { rotation, meters, .. } = self.coordinates;
        for position in &mut self.builder.positions {
            *position = Point3::from(meters * (rotation * position.coords));
        }
        for normal in &mut self.builder.normals.values {
            *normal = (rotation * Vector3::from(*normal)).into();
        }
        articulated(&mut self.articulation, &rotation, meters);
        if !all_finite(&self.articulation) {
            return Err(fault(0, "a transform or an animation is too large for a number"));
        }
        let moving = &self.articulation;
        let skinned = moving.instances.iter().any(|i| i.skin.is_some() || !i.targets.is_empty());
        // Nodes without a mesh are a skeleton.
        let skeleton = moving.instances.is_empty() && !moving.nodes.is_empty();
        if skeleton || skinned || moving.animations.iter().any(|a| !a.channels.is_empty()) {
            self.builder.articulation = Some(self.articulation);
        }
        Ok(self.builder)
    }
}
