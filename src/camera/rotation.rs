//! Rotations: the derivatives of their exponential map, and the one nearest to a matrix.
//!
//! ```text
//! Exp(θ + δ) ≈ Exp(J(θ) δ) Exp(θ),      Log(Exp(δ) R) ≈ Log R + J(Log R)⁻¹ δ,
//! J(θ) = I + (1 − cos θ)/θ² [θ]× + (θ − sin θ)/θ³ [θ]×²
//! ```
//!
//! `J` is the left Jacobian; the right one is its transpose, `J(−θ) = J(θ)ᵀ`.
//!
//! # Reference
//! J. Solà, J. Deray, D. Atchuthan, *A micro Lie theory for state estimation in robotics*, arXiv:1812.01537, eq. 143–146.

use nalgebra::{Matrix3, Rotation3};

use super::Vec3;
use plumbline_num::math::without_reflection;

/// Angle, rad, below which the closed forms lose digits and the fourth-order series is exact to rounding.
const SMALL: f64 = 1e-2;

/// `argmax tr(Rᵀ M)` over rotations (W. Kabsch, Acta Cryst. A32, 1976): the rotation nearest to `M`. `None` where `M` is not
/// finite.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let svd = m.try_svd(true, true, 1e-15, 100)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    let rotation = without_reflection(u, &v_t);
    rotation.iter().all(|x| x.is_finite()).then(|| Rotation3::from_matrix_unchecked(rotation))
}

/// `[v]×`, so that `[v]× x = v × x`.
pub fn skew(v: &Vec3) -> Matrix3<f64> {
    v.cross_matrix()
}

/// `J(θ)`.
pub fn left_jacobian(theta: &Vec3) -> Matrix3<f64> {
    let (s, k) = (theta.norm_squared(), skew(theta));
    let angle = s.sqrt();
    let (a, b) = if angle < SMALL {
        (0.5 - s / 24.0 + s * s / 720.0, 1.0 / 6.0 - s / 120.0 + s * s / 5040.0)
    } else {
        ((1.0 - angle.cos()) / s, (angle - angle.sin()) / (s * angle))
    };
    Matrix3::identity() + a * k + b * k * k
}

/// `J(θ)⁻¹`, `|θ| < 2π`.
pub fn left_jacobian_inverse(theta: &Vec3) -> Matrix3<f64> {
    let (s, k) = (theta.norm_squared(), skew(theta));
    let angle = s.sqrt();
    let b = if angle < SMALL {
        1.0 / 12.0 + s / 720.0 + s * s / 30240.0
    } else {
        1.0 / s - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() - 0.5 * k + b * k * k
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    /// On both sides of the switch to the series, and far from it.
    fn angles() -> [Vec3; 4] {
        let axis = Vec3::new(0.6, -0.48, 0.64);
        [axis * 1.1, axis * 0.0101, axis * 0.0099, axis * 1e-9]
    }

    #[test]
    fn the_left_jacobian_agrees_with_central_differences() {
        let h = 1e-5;
        for theta in angles() {
            let turned = |step: Vec3| UnitQuaternion::from_scaled_axis(theta + step);
            for k in 0..3 {
                let step = Vec3::ith(k, h);
                let slope = (turned(step) * turned(-step).inverse()).scaled_axis() / (2.0 * h);
                assert!((slope - left_jacobian(&theta).column(k)).norm() < 1e-9, "{theta:?}");
            }
        }
    }

    #[test]
    fn the_inverse_undoes_and_the_right_jacobian_is_the_transpose() {
        for theta in angles() {
            let product = left_jacobian(&theta) * left_jacobian_inverse(&theta);
            assert!((product - Matrix3::identity()).norm() < 1e-13, "{theta:?}");
            assert!((left_jacobian(&-theta) - left_jacobian(&theta).transpose()).norm() < 1e-15);
        }
    }
}
