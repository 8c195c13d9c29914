//! Morph targets of meshes.

use nalgebra::{Matrix3, Vector3};

use super::super::document::{Mesh, Node, Primitive};
use super::super::{fault, input::Input};
use crate::mesh::MeshError;
use crate::mesh::model::articulation::MorphTarget;

/// The morph targets of a mesh at a node, without offsets.
pub(in super::super) fn of_mesh(mesh: &Mesh, node: Option<&Node>, at: &str) -> Result<Vec<MorphTarget>, MeshError> {
    let counts = mesh.primitives.iter().filter(|p| p.mode.is_none_or(|mode| mode > 3)).map(|p| p.targets.len());
    let (fewest, most) = counts.fold((usize::MAX, 0), |(low, high), n| (low.min(n), high.max(n)));
    if most > 0 && fewest != most {
        return Err(fault(at, format!("its primitives have {fewest} to {most} morph targets; all must have as many")));
    }
    let weights = node.and_then(|n| n.weights.as_ref()).or(mesh.weights.as_ref());
    if let Some(weights) = weights.filter(|w| w.len() != most) {
        return Err(fault(at, format!("has {} weights of {most} morph targets", weights.len())));
    }
    let names = mesh.extras.as_ref().and_then(|extras| extras.get("targetNames")).and_then(|names| names.as_array());
    let target = |k: usize| MorphTarget {
        name: names.and_then(|names| names.get(k)?.as_str()).map(str::to_owned),
        weight: weights.map_or(0.0, |weights| weights[k]),
        ..MorphTarget::default()
    };
    Ok((0..most).map(target).collect())
}

/// Adds the offsets of the vertices of a primitive, which start at `first`, to the targets. `linear` is the linear part of
/// the node transform, `of_normals` the transform of normals.
pub(in super::super) fn add(
    input: &Input<'_>,
    targets: &mut [MorphTarget],
    primitive: &Primitive,
    (first, count): (usize, usize),
    [linear, of_normals]: [&Matrix3<f64>; 2],
    at: &str,
) -> Result<(), MeshError> {
    let with_normals = primitive.targets.iter().any(|target| target.contains_key("NORMAL"));
    for (k, (target, attributes)) in targets.iter_mut().zip(&primitive.targets).enumerate() {
        let at = format!("{at}/targets/{k}");
        let read = |name: &str, transform: &Matrix3<f64>| -> Result<Option<Vec<Vector3<f64>>>, MeshError> {
            let Some(&accessor) = attributes.get(name) else { return Ok(None) };
            let values = input.values(accessor, &["VEC3"])?;
            if values.len() != count {
                return Err(fault(&at, format!("{name} has {} values for {count} vertices", values.len())));
            }
            let rows = values.rows::<3>().map(|row| transform * Vector3::from(row)).collect::<Vec<_>>();
            if let Some(vertex) = rows.iter().position(|row| !row.iter().all(|x| x.is_finite())) {
                return Err(fault(&at, format!("{name} of vertex {vertex} is not finite")));
            }
            Ok(Some(rows))
        };
        let (offsets, normals) = (read("POSITION", linear)?, read("NORMAL", of_normals)?);
        for vertex in 0..count {
            let of = |rows: &Option<Vec<Vector3<f64>>>| rows.as_ref().map_or(Vector3::zeros(), |rows| rows[vertex]);
            let (offset, normal) = (of(&offsets), of(&normals));
            if offset != Vector3::zeros() || normal != Vector3::zeros() {
                if with_normals || !target.normals.is_empty() {
                    // Preceding primitives may have no normal offsets: pad with zeros.
                    target.normals.resize(target.vertices.len(), [0.0; 3]);
                    target.normals.push(normal.into());
                }
                target.vertices.push((first + vertex) as u32);
                target.offsets.push(offset.into());
            }
        }
    }
    Ok(())
}
