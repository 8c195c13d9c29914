//! Assignment of faces to nodes.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Vector3};

use super::super::scene::normal_matrix;
use crate::mesh::Model;
use crate::mesh::model::articulation::Articulation;

/// Distance from the origin, in bounding box diagonals, beyond which coordinates are written relative to the center: the
/// rounding of 32-bit coordinates, 2⁻²⁴ of the distance, reaches a millionth of the diagonal at 16 diagonals.
const FAR: f64 = 16.0;

/// Faces of one node, in the order of group and material.
pub(super) struct Part {
    /// Name of the node.
    pub(super) name: String,
    /// Name of the mesh.
    pub(super) mesh: String,
    pub(super) faces: Vec<usize>,
    /// Isolated vertices assigned to the part.
    pub(super) loose: Vec<u32>,
    /// Index of the instance in the articulation.
    pub(super) instance: Option<usize>,
    /// Transform from model coordinates to the written coordinates.
    pub(super) from_model: Matrix4<f64>,
}

impl Part {
    /// A normal in the written coordinates.
    pub(super) fn normal(&self, normal: &[f64; 3]) -> [f64; 3] {
        if self.from_model == Matrix4::identity() {
            return *normal;
        }
        let turned = normal_matrix(&self.from_model) * Vector3::from(*normal);
        turned.try_normalize(0.0).unwrap_or_else(Vector3::z).into()
    }

    /// Whether the transform is a reflection, so that the orientation of the triangles is reversed.
    pub(super) fn mirrored(&self) -> bool {
        self.from_model.determinant() < 0.0
    }
}

/// One part per instance; without instances one per object if objects have no common vertices, else one for all.
pub(super) fn parts(model: &Model) -> Vec<Part> {
    match model.articulation() {
        Some(articulation) => of_instances(model, articulation),
        None => of_objects(model),
    }
}

fn of_instances(model: &Model, articulation: &Articulation) -> Vec<Part> {
    let world = articulation.world_from_nodes();
    let part = |(k, instance): (usize, &crate::mesh::model::articulation::Instance)| {
        let inverse = || world[instance.node as usize].try_inverse().filter(|m| m.iter().all(|x| x.is_finite()));
        let from_model = if instance.skin.is_some() { Some(Matrix4::identity()) } else { inverse() };
        let mesh = instance.mesh.clone().unwrap_or_default();
        let name = articulation.nodes[instance.node as usize].name.clone().unwrap_or_else(|| mesh.clone());
        // With a singular rest transform there is no inverse: the part is written in world coordinates, flat as it is.
        let from_model = from_model.unwrap_or_else(Matrix4::identity);
        Part { name, mesh, faces: Vec::new(), loose: Vec::new(), instance: Some(k), from_model }
    };
    let mut parts: Vec<Part> = articulation.instances.iter().enumerate().map(part).collect();
    for (face, vertices) in model.faces().iter().enumerate() {
        parts[articulation.instance_of_vertex[vertices[0] as usize] as usize].faces.push(face);
    }
    for vertex in model.mesh().referenced_and_isolated().1 {
        parts[articulation.instance_of_vertex[vertex as usize] as usize].loose.push(vertex);
    }
    parts
}

fn of_objects(model: &Model) -> Vec<Part> {
    // Faces of each object, in the order of the file; whether two objects have a common vertex.
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
    let from_model = Matrix4::new_translation(&-origin(model));
    let part = |name: &str, faces, loose| Part {
        name: name.to_owned(),
        mesh: name.to_owned(),
        faces,
        loose,
        instance: None,
        from_model,
    };
    let (_, isolated) = model.mesh().referenced_and_isolated();
    if shared || objects.len() < 2 {
        let name = objects.keys().next().filter(|_| !shared).copied().unwrap_or_default();
        return vec![part(name, (0..model.faces().len()).collect(), isolated)];
    }
    // One part per object; isolated vertices go to the first.
    let mut parts: Vec<_> = objects.into_iter().collect();
    parts.sort_by_key(|(_, (order, _))| *order);
    let first = |order: usize| if order == 0 { isolated.clone() } else { Vec::new() };
    parts.into_iter().map(|(name, (order, faces))| part(name, faces, first(order))).collect()
}

/// Offset subtracted from coordinates: the bounding box center of a mesh far from the origin, else zero.
pub(super) fn origin(model: &Model) -> Vector3<f64> {
    let mesh = model.mesh();
    let diagonal = mesh.diagonal();
    let far = mesh.positions().iter().any(|p| p.coords.amax() > FAR * diagonal);
    let middle = mesh.bounding_box().map(|(low, high)| nalgebra::center(&low, &high).coords);
    middle.filter(|_| far && diagonal > 0.0).unwrap_or_else(Vector3::zeros)
}
