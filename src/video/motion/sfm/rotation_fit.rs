//! The homography of a purely rotating camera, `H = K R K⁻¹`, with unknown focal length.
//!
//! Image coordinates are normalized by an assumed focal length `f₀`; the true one is `f = s f₀`, so that
//! `K = diag(s, s, 1)`. The transfer error of the pair `x₁`, `x₂` is `e = π(H x₁) − x₂`; with noise in both views the
//! squared distance to the nearest pair that satisfies the homography is to first order
//!
//! ```text
//! r² = eᵀ (1 + J Jᵀ)⁻¹ e,    J = ∂π(H x)/∂x.
//! ```
//!
//! A rotating camera with a *wrong* assumed focal length is still a rotating camera: `s` is estimated together with
//! `R`. A plane seen by a moving camera has four more degrees of freedom and is distinguished by the residuals.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 4.2.6 (Sampson error) and 8.4 (conjugate rotation);
//! M. Brown, R. Hartley, D. Nistér, *Minimal solutions for panoramic stitching*, CVPR 2007.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Rotation3, SMatrix, UnitQuaternion, Vector4};

use super::correspondence::Correspondence;
use plumbline_camera::Vec3;
use plumbline_num::math::golden_section;

/// Maximum number of iterations of the fit.
const MAX_ITERATIONS: usize = 40;

/// Samples per factor of two in the scan over the conjugating focal length of a homography.
const SCAN_PER_OCTAVE: f64 = 16.0;

/// A camera rotation and the focal length of its conjugate rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConjugateRotation {
    /// `second_from_first`.
    pub rotation: UnitQuaternion<f64>,
    /// `s`: true focal length in units of the assumed one.
    pub focal_ratio: f64,
}

impl ConjugateRotation {
    /// `K R K⁻¹`.
    pub fn homography(&self) -> Matrix3<f64> {
        let s = self.focal_ratio;
        let k = Matrix3::from_diagonal(&Vec3::new(s, s, 1.0));
        let inverse = Matrix3::from_diagonal(&Vec3::new(1.0 / s, 1.0 / s, 1.0));
        k * self.rotation.to_rotation_matrix().matrix() * inverse
    }
}

/// `r²` of a pair under a homography; infinite if the point has no image.
pub(super) fn homography_squared_distance(h: &Matrix3<f64>, pair: &Correspondence) -> f64 {
    let Some((e, by_point)) = transfer_error(h, pair) else { return f64::INFINITY };
    let j = by_point * h.fixed_columns::<2>(0);
    let spread = Matrix2::identity() + j * j.transpose();
    spread.try_inverse().map_or(f64::INFINITY, |inverse| e.dot(&(inverse * e)))
}

/// `e` and `∂π/∂Y` at `Y = H x₁`.
pub(super) fn transfer_error(
    h: &Matrix3<f64>,
    pair: &Correspondence,
) -> Option<(nalgebra::Vector2<f64>, Matrix2x3<f64>)> {
    let y = h * pair.first;
    if !(y.z > 0.0) {
        return None;
    }
    let seen = y.xy() / y.z;
    Some((seen - pair.second.xy(), Matrix2x3::new(1.0, 0.0, -seen.x, 0.0, 1.0, -seen.y) / y.z))
}

/// Deviation of `K⁻¹ H K`, scaled to determinant 1, from a rotation: `‖MᵀM − 1‖` (Frobenius).
fn orthogonality(h: &Matrix3<f64>, s: f64) -> f64 {
    let m = conjugated(h, s);
    (m.transpose() * m - Matrix3::identity()).norm()
}

/// `K⁻¹ H K` with determinant 1.
fn conjugated(h: &Matrix3<f64>, s: f64) -> Matrix3<f64> {
    let k = Matrix3::from_diagonal(&Vec3::new(s, s, 1.0));
    let m = Matrix3::from_diagonal(&Vec3::new(1.0 / s, 1.0 / s, 1.0)) * h * k;
    m / m.determinant().cbrt()
}

/// The conjugate rotation nearest to a homography, `1/max_ratio ≤ s ≤ max_ratio`, and its orthogonality residual `‖MᵀM
/// − 1‖`.
///
/// `h` maps image coordinates normalized by the assumed focal length. `None` for a singular matrix.
pub fn conjugate_rotation(h: &Matrix3<f64>, max_ratio: f64) -> Option<(ConjugateRotation, f64)> {
    let octaves = 2.0 * max_ratio.log2();
    let count = (octaves * SCAN_PER_OCTAVE).ceil().max(1.0) as usize;
    let candidates = (0..=count).map(|k| max_ratio.powf(2.0 * k as f64 / count as f64 - 1.0));
    let best = candidates.min_by(|a, b| orthogonality(h, *a).total_cmp(&orthogonality(h, *b)))?;
    let step = max_ratio.powf(2.0 / count as f64);
    let (low, high) = ((best / step).max(1.0 / max_ratio), (best * step).min(max_ratio));
    let s =
        golden_section(|ln| orthogonality(h, ln.exp()), low.ln(), high.ln()).exp().clamp(1.0 / max_ratio, max_ratio);
    let m = conjugated(h, s);
    if !m.iter().all(|v| v.is_finite()) {
        return None;
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&m));
    Some((ConjugateRotation { rotation, focal_ratio: s }, orthogonality(h, s)))
}

/// The rotation of minimum `Σ min(r², T²)` (smoothly truncated) from the initial guess `start`, `1/max_ratio ≤ s ≤
/// max_ratio`; `max_ratio = 1` fixes `s = 1`.
///
/// `threshold` is T, in units of the image coordinates.
pub fn fit_conjugate_rotation(
    initial: ConjugateRotation,
    pairs: &[Correspondence],
    threshold: f64,
    max_ratio: f64,
) -> ConjugateRotation {
    let mut best = initial;
    let (mut here, mut damping) = (truncated_energy(&best, pairs, threshold), 1e-6);
    for _ in 0..MAX_ITERATIONS {
        let (mut normal, gradient) = normal_equations(&best, pairs, threshold);
        for k in 0..4 {
            normal[(k, k)] *= 1.0 + damping;
            normal[(k, k)] += f64::MIN_POSITIVE;
        }
        let Some(factor) = normal.cholesky() else { break };
        let next = moved(&best, &-factor.solve(&gradient), max_ratio);
        let there = truncated_energy(&next, pairs, threshold);
        if there < here {
            let settled = here - there <= 1e-10 * here;
            (best, here, damping) = (next, there, damping * 0.1);
            if settled {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    best
}

fn moved(from: &ConjugateRotation, step: &Vector4<f64>, max_ratio: f64) -> ConjugateRotation {
    let rotation = UnitQuaternion::from_scaled_axis(step.xyz()) * from.rotation;
    let focal_ratio = (from.focal_ratio * step.w.clamp(-1.0, 1.0).exp()).clamp(1.0 / max_ratio, max_ratio);
    ConjugateRotation { rotation: UnitQuaternion::new_normalize(rotation.into_inner()), focal_ratio }
}

/// `Σ ρ(r²)` with `ρ′ = (1 − r²/T²)²` inside the threshold: the energy that corresponds to the weights of
/// [`normal_equations`].
fn truncated_energy(from: &ConjugateRotation, pairs: &[Correspondence], threshold: f64) -> f64 {
    let h = from.homography();
    let squared = threshold * threshold;
    let cost = |pair: &Correspondence| {
        let inside = (1.0 - homography_squared_distance(&h, pair) / squared).max(0.0);
        squared / 3.0 * (1.0 - inside * inside * inside)
    };
    pairs.iter().map(cost).sum()
}

fn normal_equations(
    from: &ConjugateRotation,
    pairs: &[Correspondence],
    threshold: f64,
) -> (SMatrix<f64, 4, 4>, Vector4<f64>) {
    let (h, s) = (from.homography(), from.focal_ratio);
    let k = Matrix3::from_diagonal(&Vec3::new(s, s, 1.0));
    let inverse = Matrix3::from_diagonal(&Vec3::new(1.0 / s, 1.0 / s, 1.0));
    let rotated = from.rotation.to_rotation_matrix().matrix() * inverse;
    // d(K R K⁻¹)/d ln s = D H − H D with D = diag(1, 1, 0).
    let flat = Matrix3::from_diagonal(&Vec3::new(1.0, 1.0, 0.0));
    let angular = [Vec3::x(), Vec3::y(), Vec3::z()].map(|axis| k * axis.cross_matrix() * rotated);
    let tangents = [angular[0], angular[1], angular[2], flat * h - h * flat];
    let (mut normal, mut gradient) = (SMatrix::<f64, 4, 4>::zeros(), Vector4::zeros());
    for pair in pairs {
        let Some((e, by_point)) = transfer_error(&h, pair) else { continue };
        let j = by_point * h.fixed_columns::<2>(0);
        let Some(metric) = (Matrix2::identity() + j * j.transpose()).try_inverse() else { continue };
        let inside = 1.0 - e.dot(&(metric * e)) / (threshold * threshold);
        if !(inside > 0.0) {
            continue;
        }
        let slope = SMatrix::<f64, 2, 4>::from_columns(&tangents.map(|t| by_point * (t * pair.first)));
        let weighted = slope.transpose() * metric * (inside * inside);
        normal += weighted * slope;
        gradient += weighted * e;
    }
    (normal, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_unit};
    use plumbline_camera::CameraPose;

    /// A camera that rotates by `angle`, observed with a focal length assumed too long by `1/ratio`.
    fn turning(angle: f64, ratio: f64, rng: &mut fastrand::Rng) -> (ConjugateRotation, Vec<Correspondence>) {
        let rotation = UnitQuaternion::from_scaled_axis(random_unit(rng) * angle);
        let pose = CameraPose { rotation, translation: Vec3::zeros() };
        let views = TwoViews::general(pose, 100, rng);
        let pairs = views.correspondences.iter().map(|c| c.scaled(ratio)).collect();
        (ConjugateRotation { rotation, focal_ratio: ratio }, pairs)
    }

    #[test]
    fn the_focal_length_of_a_rotation_is_found_from_a_wrong_one() {
        for (seed, ratio) in [(0, 0.7), (1, 1.0), (2, 1.4), (3, 1.6)] {
            let mut rng = fastrand::Rng::with_seed(seed);
            let (truth, pairs) = turning(0.2, ratio, &mut rng);
            let (start, residual) = conjugate_rotation(&truth.homography(), 1.8).expect("regular");
            assert!(residual < 1e-6 && (start.focal_ratio / ratio).ln().abs() < 1e-6, "{start:?}");
            let found = fit_conjugate_rotation(start, &pairs, 0.01, 1.8);
            assert!((found.focal_ratio / ratio - 1.0).abs() < 1e-7, "{found:?} against {truth:?}");
            assert!(found.rotation.angle_to(&truth.rotation) < 1e-7);
        }
    }

    #[test]
    fn a_ratio_of_one_keeps_the_focal_length() {
        let mut rng = fastrand::Rng::with_seed(8);
        let (truth, pairs) = turning(0.1, 1.0, &mut rng);
        let start = ConjugateRotation { rotation: UnitQuaternion::identity(), focal_ratio: 1.0 };
        let found = fit_conjugate_rotation(start, &pairs, 1.0, 1.0);
        assert!(found.focal_ratio == 1.0 && found.rotation.angle_to(&truth.rotation) < 1e-7);
    }

    #[test]
    fn the_distance_to_a_homography_is_half_the_squared_transfer_error_for_an_isometry() {
        let pair =
            Correspondence::new(plumbline_num::math::Vec2::new(0.1, 0.2), plumbline_num::math::Vec2::new(0.13, 0.16));
        let r = homography_squared_distance(&Matrix3::identity(), &pair);
        assert!((r - 0.5 * (0.03_f64.powi(2) + 0.04_f64.powi(2))).abs() < 1e-15);
    }

    #[test]
    fn a_moving_camera_before_a_plane_is_no_rotation() {
        let h = Matrix3::identity() + Vec3::new(0.1, 0.0, 0.1) * Vec3::new(0.2, 0.1, 0.9).transpose();
        assert!(conjugate_rotation(&h, 1.8).expect("regular").1 > 0.05);
    }
}
