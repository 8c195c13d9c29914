//! Folds: triangles that oppose those around them.

use std::collections::BTreeSet;

use nalgebra::{Point3, Vector3};

/// The unit normal of the triangles around each one, those at its corners without itself, by area; zero where they have none.
pub(super) fn normals_around(triangles: &[[u32; 3]], x: &[Point3<f64>]) -> Vec<Vector3<f64>> {
    normals_and_around(triangles, x).map(|(_, around)| around).collect()
}

/// Triangles that oppose those around them.
pub(super) fn folds(triangles: &[[u32; 3]], x: &[Point3<f64>]) -> BTreeSet<u32> {
    (0..).zip(conformities(triangles, x)).filter(|(_, conformity)| *conformity < 0.0).map(|(t, _)| t).collect()
}

/// Cosine between the normal of each triangle and that of the triangles around it, negative for folds; zero where either has none.
pub(super) fn conformities(triangles: &[[u32; 3]], x: &[Point3<f64>]) -> Vec<f64> {
    let cosine = |(own, around): (Vector3<f64>, Vector3<f64>)| own.try_normalize(0.0).unwrap_or_default().dot(&around);
    normals_and_around(triangles, x).map(cosine).collect()
}

/// The area normal of each triangle, and the unit normal around it.
fn normals_and_around(triangles: &[[u32; 3]], x: &[Point3<f64>]) -> impl Iterator<Item = (Vector3<f64>, Vector3<f64>)> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| x[v as usize]);
        (b - a).cross(&(c - a)) * 0.5
    };
    let mut sums = vec![Vector3::zeros(); x.len()];
    for t in triangles {
        let normal = normal(t);
        for v in t {
            sums[*v as usize] += normal;
        }
    }
    triangles.iter().map(move |t| {
        let own = normal(t);
        let others: Vector3<f64> = t.iter().map(|v| sums[*v as usize] - own).sum();
        (own, others.try_normalize(0.0).unwrap_or_default())
    })
}
