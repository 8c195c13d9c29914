//! Skins, and the skinning weights of the vertices of a primitive.

use nalgebra::Matrix4;

use super::super::document::Primitive;
use super::super::{fault, input::Input, item};
use crate::mesh::MeshError;
use crate::mesh::model::articulation::NodeSkin;

/// Maximum deviation of a sum of weights from one without a warning: rounding of eight weights stored in eight bits, by at most
/// ½/255 each, adds up to 0.016.
const ROUNDED: f64 = 0.02;

/// Maximum deviation of the last row of an inverse bind matrix from the 0, 0, 0, 1 that the specification requires: tolerates
/// rounding of exporters; the row is then set exactly. Larger deviations are no affine transform.
const AFFINE: f64 = 1e-3;

/// Number of sets of four influences that are read: `JOINTS_0` and `JOINTS_1`, eight influences per vertex.
const SETS: usize = 2;

/// All skins of the document.
pub(in super::super) fn read(input: &Input<'_>) -> Result<Vec<NodeSkin>, MeshError> {
    input.document.skins.iter().enumerate().map(|(k, _)| skin(input, k)).collect()
}

fn skin(input: &Input<'_>, index: usize) -> Result<NodeSkin, MeshError> {
    let document = input.document;
    let (skin, at) = (&document.skins[index], format!("/skins/{index}"));
    let there = document.nodes.len();
    if skin.joints.is_empty() {
        return Err(fault(format!("{at}/joints"), "is empty; a skin has at least one joint"));
    }
    let mut seen = vec![false; there];
    for &joint in &skin.joints {
        match seen.get_mut(joint) {
            None => return Err(fault(format!("{at}/joints"), format!("names node {joint}; there are only {there}"))),
            Some(true) => return Err(fault(format!("{at}/joints"), format!("names node {joint} twice"))),
            Some(seen) => *seen = true,
        }
    }
    let joints: Vec<u32> = skin.joints.iter().map(|&j| j as u32).collect();
    let inverse_binds = match skin.inverse_bind_matrices {
        None => vec![Matrix4::identity(); joints.len()],
        Some(accessor) => matrices(input, accessor, joints.len(), &at)?,
    };
    Ok(NodeSkin { name: skin.name.clone(), joints, inverse_binds })
}

fn matrices(input: &Input<'_>, accessor: usize, joints: usize, at: &str) -> Result<Vec<Matrix4<f64>>, MeshError> {
    let read = input.values(accessor, &["MAT4"])?;
    if read.len() < joints {
        let told =
            format!("has {joints} joints, but only {} matrices; give each joint one, or none at all", read.len());
        return Err(fault(at, told));
    }
    let mut matrices = Vec::with_capacity(joints);
    for (k, columns) in read.rows::<16>().take(joints).enumerate() {
        let mut matrix = Matrix4::from_column_slice(&columns);
        let row = matrix.row(3).transpose() - nalgebra::Vector4::new(0.0, 0.0, 0.0, 1.0);
        // NaN fails the comparison.
        if !(row.amax() <= AFFINE && matrix.iter().all(|x| x.is_finite())) {
            let at = format!("/accessors/{accessor}, item {k}");
            return Err(fault(at, "is no affine matrix (finite, with a last row of 0, 0, 0, 1)"));
        }
        matrix.set_row(3, &nalgebra::RowVector4::new(0.0, 0.0, 0.0, 1.0));
        matrices.push(matrix);
    }
    Ok(matrices)
}

/// Rows of joints and weights, one per vertex.
pub(in super::super) type Rows = Vec<Vec<(u32, f64)>>;

/// Joints and normalized weights of the vertices of a primitive, and the number of vertices whose weights did not sum to one.
pub(in super::super) fn influences(
    input: &Input<'_>,
    primitive: &Primitive,
    (skin, vertices): (usize, usize),
    at: &str,
) -> Result<(Rows, usize), MeshError> {
    // Rows from all sets of influences, checked; then normalization.
    let joints_there = item(&input.document.skins, skin, at, "skin")?.joints.len();
    let mut rows: Rows = vec![Vec::new(); vertices];
    for set in 0..SETS {
        let named = |what: &str| primitive.attributes.get(&format!("{what}_{set}")).copied();
        let (joints, weights) = match (named("JOINTS"), named("WEIGHTS")) {
            (None, None) => break,
            (Some(joints), Some(weights)) => (joints, weights),
            _ => return Err(fault(at, format!("has only one of JOINTS_{set} and WEIGHTS_{set}; it needs both"))),
        };
        let (joints, weights) = (input.values(joints, &["VEC4"])?, input.values(weights, &["VEC4"])?);
        if joints.len() != vertices || weights.len() != vertices {
            let told = format!("JOINTS_{set}, WEIGHTS_{set}: {}, {} values", joints.len(), weights.len());
            return Err(fault(at, format!("{told} for {vertices} vertices")));
        }
        for (vertex, (joints, weights)) in joints.rows::<4>().zip(weights.rows::<4>()).enumerate() {
            for (joint, weight) in joints.into_iter().zip(weights) {
                if !(weight >= 0.0 && weight.is_finite()) {
                    return Err(fault(at, format!("vertex {vertex}: weight {weight} (expected 0 to 1)")));
                }
                if weight > 0.0 && !(joint >= 0.0 && joint < joints_there as f64) {
                    let told = format!("vertex {vertex} follows joint {joint}; skin {skin} has {joints_there}");
                    return Err(fault(at, told));
                }
                if weight > 0.0 {
                    add(&mut rows[vertex], joint as u32, weight);
                }
            }
        }
    }
    let odd = rows.iter_mut().filter_map(|row| normalize(row)).filter(|sum| (sum - 1.0).abs() > ROUNDED).count();
    Ok((rows, odd))
}

/// Adds an influence; the weights of a repeated joint are summed.
fn add(row: &mut Vec<(u32, f64)>, joint: u32, weight: f64) {
    match row.iter_mut().find(|(j, _)| *j == joint) {
        Some((_, sum)) => *sum += weight,
        None => row.push((joint, weight)),
    }
}

/// Normalizes the weights; returns their sum, if positive.
fn normalize(row: &mut [(u32, f64)]) -> Option<f64> {
    let sum: f64 = row.iter().map(|(_, w)| w).sum();
    if !(sum > 0.0) {
        return None;
    }
    for (_, w) in row.iter_mut() {
        *w /= sum;
    }
    Some(sum)
}
