//! Blend shapes as morph targets.
//!
//! A channel has a weight in percent and shapes, each with the offsets of some vertices. Of several shapes of a channel (in-betweens) the
//! last is read.

use nalgebra::{Matrix3, Vector3};

use super::document::{Document, Kind};
use super::properties::properties;
use crate::mesh::MeshError;
use crate::mesh::model::articulation::MorphTarget;

/// A morph target with the channel whose weight it has.
pub(super) struct ShapeTarget {
    pub(super) target: MorphTarget,
    pub(super) channel: u32,
}

/// The morph targets of a mesh of `count` vertices from `first`; second, the number of shapes that are left out.
pub(super) fn read(
    document: &Document<'_, '_>,
    geometry: u32,
    (first, count): (usize, usize),
    [linear, of_normals]: [&Matrix3<f64>; 2],
) -> Result<(Vec<ShapeTarget>, usize), MeshError> {
    let (mut targets, mut left_out) = (Vec::new(), 0);
    for blend in document.parts(geometry, Kind::BlendShape) {
        document.open(blend)?;
        for channel in document.parts(blend, Kind::BlendShapeChannel) {
            document.open(channel)?;
            let shapes = document.parts(channel, Kind::Shape);
            let (number, last) = shapes.fold((0, None), |(n, _), shape| (n + 1, Some(shape)));
            let Some(shape) = last else { continue };
            left_out += number - 1;
            let mut target = offsets(document, shape, (first, count), [linear, of_normals])?;
            target.name = Some(document.name(channel)).filter(|n| !n.is_empty());
            target.weight = weight(document, channel);
            targets.push(ShapeTarget { target, channel });
        }
    }
    Ok((targets, left_out))
}

/// The weight of a channel at rest, 1 for the whole shape.
fn weight(document: &Document<'_, '_>, channel: u32) -> f64 {
    let tree = &document.reader.tree;
    let record = document.object(channel).record;
    let mut percent = 0.0;
    let stored = tree.child(Some(record), "DeformPercent").and_then(|r| tree.record(r).value(0)?.real());
    if let Some(stored) = stored.filter(|p| p.is_finite()) {
        percent = stored;
    }
    for (name, numbers) in properties(tree, record) {
        if name == b"DeformPercent" {
            numbers.set(&mut percent);
        }
    }
    percent / 100.0
}

/// Offsets of the vertices of a shape.
fn offsets(
    document: &Document<'_, '_>,
    shape: u32,
    (first, count): (usize, usize),
    [linear, of_normals]: [&Matrix3<f64>; 2],
) -> Result<MorphTarget, MeshError> {
    let (reader, record) = (document.reader, document.object(shape).record);
    document.open(shape)?;
    let indices = reader.integers(record, "Indexes")?;
    let offsets = reader.reals(record, "Vertices")?;
    let normals = reader.reals(record, "Normals")?;
    if offsets.len() != 3 * indices.len() {
        let told = format!("{} vertices and {} numbers of offsets; it needs three each", indices.len(), offsets.len());
        return Err(document.fault(shape, told));
    }
    let mut order: Vec<usize> = (0..indices.len()).collect();
    order.sort_by_key(|&k| indices[k]);
    order.dedup_by_key(|&mut k| indices[k]);
    let with_normals = normals.len() == offsets.len();
    let mut target = MorphTarget::default();
    for k in order {
        let Some(vertex) = usize::try_from(indices[k]).ok().filter(|&v| v < count) else {
            let told = format!("it moves vertex {}, but the mesh has {count}, numbered from 0", indices[k]);
            return Err(document.fault(shape, told));
        };
        let moved = |numbers: &[f64], by: &Matrix3<f64>| by * Vector3::from_column_slice(&numbers[3 * k..3 * k + 3]);
        let offset = moved(&offsets, linear);
        if !offset.iter().all(|x| x.is_finite()) {
            return Err(document.fault(shape, format!("the offset of vertex {vertex} is not finite")));
        }
        target.vertices.push((first + vertex) as u32);
        target.offsets.push(offset.into());
        if with_normals {
            let normal = moved(&normals, of_normals);
            target.normals.push(if normal.iter().all(|x| x.is_finite()) { normal.into() } else { [0.0; 3] });
        }
    }
    Ok(target)
}
