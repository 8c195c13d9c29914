//! Normals of corners after the vertices have moved.
//!
//! Corners of one vertex that shared a normal form a smooth patch around it; the new normal is the sum of the normals of the
//! patch's faces, weighted by area, turned to the side on which the old one stood.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::corner_data::{CornerData, NO_VALUE};
use super::faces::{Faces, newell};

/// The normals over `new` positions that correspond to `old_normals` over `old` ones.
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

/// The same normals, each on the side of its faces.
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

/// Corners of one vertex with one normal.
struct Patches {
    /// For each patch the value it had.
    source: Vec<u32>,
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
