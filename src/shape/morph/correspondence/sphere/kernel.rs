//! The Chebyshev center of the kernel of a spherical polygon.

use nalgebra::{Matrix3, Vector3};

/// Minimum distance from the sides, above rounding.
const MIN_DEPTH: f64 = 1e-13;

/// The unit vector with the largest minimum `n_k · x` over the sides' normals; `None` if the kernel is empty.
///
/// At the optimum of this linear program in three unknowns two or three constraints are active: all pairs and triples are tried.
pub(super) fn deepest(polygon: &[Vector3<f64>]) -> Option<Vector3<f64>> {
    let n = polygon.len();
    let normals: Vec<Vector3<f64>> =
        (0..n).map(|k| polygon[k].cross(&polygon[(k + 1) % n]).try_normalize(0.0)).collect::<Option<_>>()?;
    let least = |x: &Vector3<f64>| normals.iter().map(|m| m.dot(x)).fold(f64::INFINITY, f64::min);
    let mut best: Option<(f64, Vector3<f64>)> = None;
    let mut consider = |x: Option<Vector3<f64>>| {
        let Some(x) = x else { return };
        let depth = least(&x);
        if depth > MIN_DEPTH && best.is_none_or(|b| depth > b.0) {
            best = Some((depth, x));
        }
    };
    for i in 0..n {
        for j in i + 1..n {
            consider((normals[i] + normals[j]).try_normalize(1e-12));
            for k in j + 1..n {
                let sides =
                    Matrix3::from_rows(&[normals[i].transpose(), normals[j].transpose(), normals[k].transpose()]);
                consider(sides.try_inverse().and_then(|m| (m * Vector3::repeat(1.0)).try_normalize(0.0)));
            }
        }
    }
    best.map(|b| b.1)
}
