//! Deformation gradients of triangles.

use nalgebra::{Matrix3, Point3, Vector3};

/// The linear map from the edges and the unit normal of a triangle at rest to those in a pose; `None` if the triangle at rest has zero area.
pub(super) fn gradient(rest: &[Point3<f64>; 3], posed: &[Point3<f64>; 3]) -> Option<Matrix3<f64>> {
    let frame = |t: &[Point3<f64>; 3]| {
        let (u, v) = (t[1] - t[0], t[2] - t[0]);
        Matrix3::from_columns(&[u, v, u.cross(&v).try_normalize(0.0).unwrap_or_else(Vector3::zeros)])
    };
    Some(frame(posed) * frame(rest).try_inverse()?)
}
