//! One focal length for many fundamental matrices, without their correspondences.
//!
//! With `K = diag(f, f, 1)` the matrix `E = Kᵀ F K` of a camera of focal length `f` has two equal nonzero singular
//! values. Their deviation, in a form without matrix square roots,
//! ```text
//! δ(f)² = (σ₁² − σ₂²)² / (σ₁² + σ₂²)² = 1 − 4 q / tr(E Eᵀ)²,     q = sum of the principal 2×2 minors of E Eᵀ,
//! ```
//!
//! is summed over the matrices with the Geman–McClure loss and minimized on a logarithmic scale; matrices without
//! information, and outliers, have no influence.
//!
//! # Reference
//! L. Pan, D. Baráth, M. Pollefeys, J. Schönberger, *Global structure-from-motion revisited* (GLOMAP), ECCV 2024,
//! section 3.1; P. Mendonça, R. Cipolla, *A simple technique for self-calibration*, CVPR 1999.

use nalgebra::Matrix3;

use plumbline_camera::Vec3;
use plumbline_num::math::golden_section;

/// `δ` at which the Geman–McClure weight of a matrix is a quarter: clean pairs stay below 0.02, wrong ones are
/// anywhere in [0, 1].
const DEVIATION_SCALE: f64 = 0.05;

/// Focal lengths scanned per factor of two, before the best one is refined.
const SCAN_PER_OCTAVE: f64 = 32.0;

/// The focal length, in the unit of the image coordinates, within `range` for which most of the matrices are
/// essential; `None` for no matrices.
///
/// `fundamentals` relate image coordinates whose origin is the principal point.
pub fn view_graph_focal(fundamentals: &[Matrix3<f64>], range: (f64, f64)) -> Option<f64> {
    if fundamentals.is_empty() {
        return None;
    }
    let (low, high) = (range.0.ln(), range.1.ln());
    let count = ((high - low) / std::f64::consts::LN_2 * SCAN_PER_OCTAVE).ceil().max(2.0);
    let step = (high - low) / count;
    let cost = |s: f64| fundamentals.iter().map(|f| robust(deviation_squared(f, s.exp()))).sum::<f64>();
    let scan = (0..=count as usize).map(|k| low + step * k as f64);
    let best = scan.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))?;
    Some(golden_section(cost, (best - step).max(low), (best + step).min(high)).exp())
}

/// `ρ(δ²) = δ²/(δ² + c²)`.
fn robust(squared: f64) -> f64 {
    squared / (squared + DEVIATION_SCALE * DEVIATION_SCALE)
}

/// `δ(f)²`, in [0, 1]; 1 if undefined.
fn deviation_squared(fundamental: &Matrix3<f64>, focal: f64) -> f64 {
    let k = Matrix3::from_diagonal(&Vec3::new(focal, focal, 1.0));
    let e = k * fundamental * k;
    let outer = e * e.transpose();
    let trace = outer.trace();
    let minor = |i: usize, j: usize| outer[(i, i)] * outer[(j, j)] - outer[(i, j)] * outer[(j, i)];
    let deviation = 1.0 - 4.0 * (minor(0, 1) + minor(0, 2) + minor(1, 2)) / (trace * trace);
    if deviation.is_finite() { deviation.clamp(0.0, 1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose};

    /// `F` of two random views of focal length `f` whose optical axes are at least 0.1 rad from intersecting.
    fn fundamental(f: f64, rng: &mut fastrand::Rng) -> Matrix3<f64> {
        let pose = loop {
            let pose = random_pose(rng, 0.4, 1.0);
            let second_axis = pose.inverse().rotation * Vec3::z();
            let baseline = pose.center().coords;
            if Vec3::z().cross(&second_axis).dot(&baseline).abs() > 0.1 {
                break pose;
            }
        };
        let views = TwoViews::general(pose, 1, rng);
        let inverse = Matrix3::from_diagonal(&Vec3::new(1.0 / f, 1.0 / f, 1.0));
        inverse * views.essential() * inverse
    }

    #[test]
    fn the_deviation_vanishes_at_the_true_focal_length_and_one_matrix_gives_it() {
        let mut rng = fastrand::Rng::with_seed(1);
        for f in [0.6, 0.9, 2.0] {
            let m = fundamental(f, &mut rng);
            assert!(deviation_squared(&m, f) < 1e-12 && deviation_squared(&m, 1.3 * f) > 1e-5);
            assert!((view_graph_focal(&[m], (0.4, 4.0)).expect("a matrix") / f - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn the_deviation_is_that_of_the_singular_values() {
        let mut rng = fastrand::Rng::with_seed(2);
        let m = fundamental(0.9, &mut rng);
        let k = Matrix3::from_diagonal(&Vec3::new(1.4, 1.4, 1.0));
        let s = (k * m * k).singular_values().map(|v| v * v);
        let expected = ((s[0] - s[1]) / (s[0] + s[1])).powi(2);
        assert!((deviation_squared(&m, 1.4) - expected).abs() < 1e-12);
    }

    #[test]
    fn a_third_of_wrong_matrices_is_outvoted() {
        for seed in 0..10 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut matrices: Vec<_> = (0..20).map(|_| fundamental(0.9, &mut rng)).collect();
            matrices.extend((0..10).map(|_| fundamental(0.5 + 2.0 * rng.f64(), &mut rng)));
            let f = view_graph_focal(&matrices, (0.4, 4.0)).expect("matrices");
            assert!((f / 0.9 - 1.0).abs() < 0.03, "seed {seed}: {f}");
        }
        assert!(view_graph_focal(&[], (0.4, 4.0)).is_none());
    }
}
