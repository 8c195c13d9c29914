//! Skins: clusters of weights, one per joint.
//!
//! A cluster stores `Transform` = joint_from_mesh and `TransformLink` = world_from_joint of the bind pose, so that the mesh is at
//! M = `TransformLink` `Transform` in that pose, M the same for all clusters of a skin. Positions are read in the world of the bind pose,
//! and the inverse bind matrix of a joint is `Transform` M⁻¹.

use std::collections::HashMap;

use nalgebra::{Matrix4, RowVector4};

use super::document::{Document, Kind};
use crate::mesh::MeshError;
use crate::mesh::model::articulation::NodeSkin;

/// Maximum deviation of a sum of weights from one without a warning.
const ROUNDED: f64 = 0.02;

/// A skin of a mesh.
pub(super) struct MeshSkin {
    pub(super) skin: NodeSkin,
    /// World of the bind pose from the node of the mesh.
    pub(super) bind: Matrix4<f64>,
    /// Vertex, joint of the skin and weight: sorted by vertex and joint.
    entries: Vec<(u32, u32, f64)>,
    /// Clusters without a joint.
    pub(super) loose: usize,
}

/// Nodes of models and their frames, by object.
pub(super) struct Joints<'a> {
    pub(super) node_of: &'a [u32],
    pub(super) world_from_nodes: &'a [Matrix4<f64>],
    /// The bind pose of the file.
    pub(super) bind_pose: &'a HashMap<u32, Matrix4<f64>>,
}

/// Reads the skin of a mesh at the node of `model`; `None` without a joint.
pub(super) fn read(
    document: &Document<'_, '_>,
    skin: u32,
    model: u32,
    joints: &Joints<'_>,
) -> Result<Option<MeshSkin>, MeshError> {
    document.open(skin)?;
    let world = |object: u32| {
        let of_node = joints.world_from_nodes[joints.node_of[object as usize] as usize];
        joints.bind_pose.get(&object).copied().unwrap_or(of_node)
    };
    let mut read = MeshSkin {
        skin: NodeSkin { name: Some(document.name(skin)).filter(|n| !n.is_empty()), ..NodeSkin::default() },
        bind: Matrix4::identity(),
        entries: Vec::new(),
        loose: 0,
    };
    let mut number_of: HashMap<u32, u32> = HashMap::new();
    let mut bind = None;
    for cluster in document.parts(skin, Kind::Cluster) {
        let record = document.object(cluster).record;
        document.open(cluster)?;
        let Some(joint) = document.parts(cluster, Kind::Model).next() else {
            read.loose += 1;
            continue;
        };
        // A joint of several clusters is bound by the first.
        let node = joints.node_of[joint as usize];
        let number = *number_of.entry(node).or_insert(read.skin.joints.len() as u32);
        if number as usize == read.skin.joints.len() {
            let world_from_joint = document.matrix(record, "TransformLink")?.unwrap_or_else(|| world(joint));
            let joint_from_mesh = if let Some(matrix) = document.matrix(record, "Transform")? {
                matrix
            } else {
                let flat = || document.fault(cluster, "the matrix TransformLink of its joint has no inverse");
                world_from_joint.try_inverse().ok_or_else(flat)? * world(model)
            };
            bind = bind.or_else(|| Some(world_from_joint * joint_from_mesh).filter(invertible));
            read.skin.joints.push(node);
            read.skin.inverse_binds.push(joint_from_mesh);
        }
        weights(document, cluster, number, &mut read.entries)?;
    }
    if read.skin.joints.is_empty() {
        return Ok(None);
    }
    // Without an invertible M the mesh stays in its own space.
    if let Some((bind, back)) = bind.and_then(|m| Some((m, m.try_inverse()?))) {
        read.bind = bind;
        read.skin.inverse_binds.iter_mut().for_each(|matrix| *matrix *= back);
    }
    // Products of inverses miss the last row by rounding.
    read.skin.inverse_binds.iter_mut().for_each(|matrix| matrix.set_row(3, &RowVector4::new(0.0, 0.0, 0.0, 1.0)));
    // Formats that are written have single precision.
    if let Some(k) = read.skin.inverse_binds.iter().position(|m| !m.iter().all(|x| (*x as f32).is_finite())) {
        return Err(document.fault(skin, format!("the bind matrix of its joint {k} is too large for a number")));
    }
    read.entries.sort_by_key(|&(vertex, joint, _)| (vertex, joint));
    Ok(Some(read))
}

fn invertible(matrix: &Matrix4<f64>) -> bool {
    matrix.try_inverse().is_some_and(|inverse| inverse.iter().all(|x| x.is_finite()))
}

/// Adds the weights of a cluster.
fn weights(
    document: &Document<'_, '_>,
    cluster: u32,
    joint: u32,
    entries: &mut Vec<(u32, u32, f64)>,
) -> Result<(), MeshError> {
    let (reader, record) = (document.reader, document.object(cluster).record);
    let indices = reader.integers(record, "Indexes")?;
    let weights = reader.reals(record, "Weights")?;
    if indices.len() != weights.len() {
        let told = format!("{} vertices and {} weights; it needs as many", indices.len(), weights.len());
        return Err(document.fault(cluster, told));
    }
    for (&vertex, &weight) in indices.iter().zip(&weights) {
        let Ok(number) = u32::try_from(vertex) else {
            return Err(document.fault(cluster, format!("it names vertex {vertex}")));
        };
        if !(weight >= 0.0 && weight.is_finite()) {
            return Err(document.fault(cluster, format!("vertex {vertex}: weight {weight} (expected 0 or more)")));
        }
        if weight > 0.0 {
            entries.push((number, joint, weight));
        }
    }
    Ok(())
}

impl MeshSkin {
    /// Adds rows of joints and normalized weights of `vertices` vertices; returns the number of those whose weights did not sum to one.
    ///
    /// # Errors
    /// The number of a vertex that the mesh does not have.
    pub(super) fn rows(&self, vertices: usize, mut push: impl FnMut(&[(u32, f64)])) -> Result<usize, u32> {
        if let Some(&(vertex, ..)) = self.entries.last().filter(|&&(vertex, ..)| vertex as usize >= vertices) {
            return Err(vertex);
        }
        let (mut next, mut odd, mut row) = (0, 0, Vec::new());
        for vertex in 0..vertices as u32 {
            row.clear();
            while let Some(&(_, joint, weight)) = self.entries.get(next).filter(|&&(v, ..)| v == vertex) {
                match row.last_mut() {
                    Some((last, sum)) if *last == joint => *sum += weight,
                    _ => row.push((joint, weight)),
                }
                next += 1;
            }
            let sum: f64 = row.iter().map(|(_, w)| w).sum();
            if sum > 0.0 && sum.is_finite() {
                for (_, weight) in &mut row {
                    *weight /= sum;
                }
            } else {
                row.clear();
            }
            odd += usize::from(sum > 0.0 && (sum - 1.0).abs() > ROUNDED);
            push(&row);
        }
        Ok(odd)
    }
}
