//! Corner normals after a deformation.
//!
//! The corners of a vertex with a common normal form a smooth patch (a smoothing group at the vertex). Its new normal is the
//! area-weighted average of the face normals of the patch, with the sign that the old normal had relative to the old average.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::corner_data::{CornerData, NO_VALUE};
use super::faces::{Faces, newell};

/// Normals at the `new` positions that correspond to `old_normals` at the `old` positions.
pub(super) fn moved(
    old_normals: &CornerData<3>,
    faces: &Faces,
    old: &[Point3<f64>],
    new: &[Point3<f64>],
) -> CornerData<3> {
    let patches = Patches::of(old_normals, faces);
    let (before, after) = (patches.sums(faces, old), patches.sums(faces, new));
    let value = |(patch, &source): (usize, &u32)| {
        let old_normal = Vector3::from(old_normals.values[source as usize]);
        let side = if old_normal.dot(&before[patch]) < 0.0 { -1.0 } else { 1.0 };
        // A patch of zero area determines no normal: keep the old one.
        after[patch].try_normalize(0.0).map_or(old_normals.values[source as usize], |n| (n * side).into())
    };
    CornerData { values: patches.source.iter().enumerate().map(value).collect(), of_corner: patches.of_corner }
}

/// The normals, each flipped where necessary to the side of the face normals of its patch.
pub(super) fn facing_as_faces(mut normals: CornerData<3>, faces: &Faces, positions: &[Point3<f64>]) -> CornerData<3> {
    let patches = Patches::of(&normals, faces);
    let sums = patches.sums(faces, positions);
    let value = |(patch, &source): (usize, &u32)| {
        let normal = Vector3::from(normals.values[source as usize]);
        if normal.dot(&sums[patch]) < 0.0 { (-normal).into() } else { normal.into() }
    };
    normals.values = patches.source.iter().enumerate().map(value).collect();
    normals.of_corner = patches.of_corner;
    normals
}

/// Smooth patches: sets of corners with the same vertex and the same normal.
struct Patches {
    /// Index of the old normal of each patch.
    source: Vec<u32>,
    /// Patch of each corner; [`NO_VALUE`] for a corner without a normal.
    of_corner: Vec<u32>,
}

impl Patches {
    fn of(normals: &CornerData<3>, faces: &Faces) -> Self {
        let mut numbers = BTreeMap::new();
        let mut source = Vec::new();
        let mut patch = |(&value, &vertex): (&u32, &u32)| {
            if value as usize >= normals.values.len() {
                return NO_VALUE;
            }
            *numbers.entry((vertex, value)).or_insert_with(|| {
                source.push(value);
                source.len() as u32 - 1
            })
        };
        let of_corner = normals.of_corner.iter().zip(faces.vertices()).map(&mut patch).collect();
        Self { source, of_corner }
    }

    /// Sum of the area-weighted face normals of each patch.
    fn sums(&self, faces: &Faces, positions: &[Point3<f64>]) -> Vec<Vector3<f64>> {
        let mut sums = vec![Vector3::zeros(); self.source.len()];
        let mut outline = Vec::new();
        for face in 0..faces.len() {
            outline.clear();
            outline.extend(faces.get(face).iter().map(|&v| positions[v as usize]));
            let normal = newell(&outline);
            for corner in faces.corners(face) {
                if let Some(sum) = sums.get_mut(self.of_corner[corner] as usize) {
                    *sum += normal;
                }
            }
        }
        sums
    }
}
