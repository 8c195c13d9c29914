//! The rotation nearest to a matrix, and the polar decomposition.
//!
//! ```text
//! R(M) = argmax tr(Rᵀ M)   over R ∈ SO(3)
//! ```
//!
//! With `M = U Σ Vᵀ` it is `U diag(1, 1, det UVᵀ) Vᵀ`: the polar factor, with the direction of the least singular value reversed
//! over where that factor would be a reflection. For `M = Σ w e′ eᵀ` it is the rotation that carries the `e` best to the `e′`.
//!
//! # Reference
//! S. Umeyama, *Least-squares estimation of transformation parameters between two point patterns*, PAMI 13 (1991).

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};

/// The rotation nearest to `m`; the identity for a matrix that says nothing (zero, or not finite).
///
/// Where two singular values vanish, or where a reflection's two least ones are equal, the nearest rotation is not unique:
/// some nearest one is returned.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let size = m.amax();
    if !(size > 0.0 && size.is_finite()) {
        return Matrix3::identity();
    }
    // Singular values come in descending order, so the last column is the one to turn over.
    let svd = (m / size).svd(true, true);
    svd.u.zip(svd.v_t).map_or_else(Matrix3::identity, |(u, v_t)| without_reflection(u, &v_t))
}

/// `U diag(1, 1, det UVᵀ) Vᵀ` of the singular vectors of a matrix, those of its least singular value last: the orthogonal matrix
/// `UVᵀ`, reversed in its last direction where it is a reflection.
pub fn without_reflection(mut u: Matrix3<f64>, v_t: &Matrix3<f64>) -> Matrix3<f64> {
    if (u * v_t).determinant() < 0.0 {
        u.column_mut(2).neg_mut();
    }
    u * v_t
}

/// Rotation and symmetric stretch of a map: `M = R S`, `R` the [`nearest_rotation`].
pub fn polar(m: &Matrix3<f64>) -> (UnitQuaternion<f64>, Matrix3<f64>) {
    let rotation = nearest_rotation(m);
    (UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation)), rotation.transpose() * m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn turned(axis: [f64; 3], angle: f64) -> Matrix3<f64> {
        Rotation3::new(Vector3::from(axis).normalize() * angle).into_inner()
    }

    #[test]
    fn a_stretched_rotation_gives_the_rotation_back_even_where_it_is_flat() {
        for angle in [0.0, 1e-9, 0.3, 2.0, 3.1] {
            let r = turned([1.0, -2.0, 0.5], angle);
            for stretch in [[1.0, 2.0, 3.0], [1e-3, 5.0, 5.0], [4.0, 0.0, 1.0], [1e8, 2e8, 0.0]] {
                let s = turned([0.3, 0.4, -1.0], 0.7);
                let m = r * s * Matrix3::from_diagonal(&stretch.into()) * s.transpose();
                assert!((nearest_rotation(&m) - r).norm() < 1e-12, "{angle} {stretch:?}");
            }
        }
    }

    #[test]
    fn a_reflection_turns_over_its_weakest_direction() {
        let r = nearest_rotation(&Matrix3::from_diagonal(&Vector3::new(3.0, -0.5, 2.0)));
        assert!((r - Matrix3::identity()).norm() < 1e-12, "{r}");
        let r = nearest_rotation(&Matrix3::from_diagonal(&Vector3::new(-3.0, 0.5, 2.0)));
        assert!((r - Matrix3::from_diagonal(&Vector3::new(-1.0, -1.0, 1.0))).norm() < 1e-12, "{r}");
    }

    #[test]
    fn a_map_is_its_rotation_after_its_stretch() {
        let m = Matrix3::new(2.0, 0.3, -0.1, 0.5, -1.0, 0.2, 0.0, 0.4, 3.0);
        let (rotation, stretch) = polar(&m);
        assert!((rotation.to_rotation_matrix().matrix() * stretch - m).norm() < 1e-12);
        assert!((stretch - stretch.transpose()).norm() < 1e-12);
    }

    #[test]
    fn nothing_turns_nothing_and_a_line_gives_some_rotation() {
        assert_eq!(nearest_rotation(&Matrix3::zeros()), Matrix3::identity());
        assert_eq!(nearest_rotation(&Matrix3::repeat(f64::NAN)), Matrix3::identity());
        let r = nearest_rotation(&(Vector3::new(0.0, 1.0, 0.0) * Vector3::x().transpose()));
        assert!((r * r.transpose() - Matrix3::identity()).norm() < 1e-12 && (r.determinant() - 1.0).abs() < 1e-12);
        assert!((r * Vector3::x() - Vector3::y()).norm() < 1e-12);
    }
}
