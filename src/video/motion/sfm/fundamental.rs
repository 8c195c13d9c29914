//! Fundamental matrices: the seven-point algorithm, and robust estimation.
//!
//! Seven pairs leave a pencil `F = a F₁ + F₂` with `x₂ᵀ F x₁ = 0`; `det F = 0` is a cubic in `a`, solved in
//! homogeneous form, in normalized coordinates, with centroid 0 and mean square distance 2. A refit inside the search
//! minimizes the Sampson distance over `F = U diag(1, s, 0) Vᵀ`, with rotation updates of `U` and `V` and a shift of `s`.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 11.1 to 11.4.

use nalgebra::{Matrix3, Rotation3, SVector};

use super::correspondence::{Correspondence, matrix_of_rows};
use super::epipolar::{Epipolar, EpipolarFamily};
use super::null_space::null_space;
use super::polynomial::real_roots;
use super::sampson::Chart;
use plumbline_camera::Vec3;
use plumbline_num::math::Vec2;

/// All fundamental matrices of unit norm that satisfy seven pairs, in any affine image coordinates. Pushed to
/// `solutions`: one to three, none if the seven are linearly dependent.
pub fn seven_point(sample: &[Correspondence; 7], solutions: &mut Vec<Matrix3<f64>>) {
    let Some((first, second)) = normalizing(sample) else { return };
    let rows = sample.map(|c| Correspondence { first: first * c.first, second: second * c.second }.epipolar_row());
    let Some(basis) = null_space::<7, 2>(&rows) else { return };
    let [f1, f2] = basis.map(|b| matrix_of_rows(&b));
    // det(a F₁ + F₂), from its values at a = 0, ∞, 1, −1.
    let (c0, c3) = (f2.determinant(), f1.determinant());
    let (plus, minus) = ((f1 + f2).determinant(), (f2 - f1).determinant());
    let c2 = 0.5 * (plus + minus) - c0;
    let c1 = 0.5 * (plus - minus) - c3;
    for &a in real_roots(&[c0, c1, c2, c3]).as_slice() {
        let f = second.transpose() * (f1 * a + f2) * first;
        solutions.push(f / f.norm());
    }
}

/// Normalizing transformations of the points of the two views to centroid 0 and mean square distance 2.
fn normalizing(pairs: &[Correspondence]) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    let count = pairs.len() as f64;
    let of = |point: fn(&Correspondence) -> Vec2| {
        let mean: Vec2 = pairs.iter().map(point).sum::<Vec2>() / count;
        let spread = pairs.iter().map(|c| (point(c) - mean).norm_squared()).sum::<f64>() / count;
        let s = (2.0 / spread).sqrt();
        (s.is_finite() && s > 0.0).then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
    };
    Some((of(|c| c.first.xy())?, of(|c| c.second.xy())?))
}

/// `U diag(1, s, 0) Vᵀ`, with coordinates `(ω_U, ω_V, δs)` around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct FundamentalChart {
    u: Rotation3<f64>,
    v: Rotation3<f64>,
    s: f64,
}

impl FundamentalChart {
    fn sigma(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal(&Vec3::new(1.0, self.s, 0.0))
    }
}

impl Chart<7> for FundamentalChart {
    fn matrix(&self) -> Matrix3<f64> {
        self.u.matrix() * self.sigma() * self.v.matrix().transpose()
    }

    fn tangents(&self) -> [Matrix3<f64>; 7] {
        let (u, v_t, sigma) = (self.u.matrix(), self.v.matrix().transpose(), self.sigma());
        let axes = [Vec3::x(), Vec3::y(), Vec3::z()].map(|a| a.cross_matrix());
        let left = axes.map(|a| u * a * sigma * v_t);
        let right = axes.map(|a| u * sigma * a.transpose() * v_t);
        let stretch = u * Matrix3::from_diagonal(&Vec3::y()) * v_t;
        [left[0], left[1], left[2], right[0], right[1], right[2], stretch]
    }

    fn moved(&self, step: &SVector<f64, 7>) -> Self {
        Self {
            u: self.u * Rotation3::new(step.fixed_rows::<3>(0).into_owned()),
            v: self.v * Rotation3::new(step.fixed_rows::<3>(3).into_owned()),
            s: self.s + step[6],
        }
    }
}

/// Consensus problem: correspondences in any affine image coordinates, scaled to about 1, explained by fundamental
/// matrices.
pub(super) type ByFundamental<'a> = Epipolar<'a, FundamentalChart, 7>;

impl EpipolarFamily<7> for FundamentalChart {
    const SAMPLE: usize = 7;

    fn fit_minimal(sample: &[Correspondence], models: &mut Vec<Matrix3<f64>>) {
        seven_point(&std::array::from_fn(|k| sample[k]), models);
    }

    /// The nearest matrix of rank two, scaled to largest singular value 1.
    fn of_matrix(f: &Matrix3<f64>) -> Option<Self> {
        let svd = f.try_svd(true, true, 1e-15, 100)?;
        let (u, v) = (svd.u?, svd.v_t?.transpose());
        let proper = |m: Matrix3<f64>| Rotation3::from_matrix_unchecked(if m.determinant() < 0.0 { -m } else { m });
        let s = svd.singular_values[1] / svd.singular_values[0];
        s.is_finite().then(|| Self { u: proper(u), v: proper(v), s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::sampson;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose};
    use plumbline_num::optim::ransac::{MsacOptions, msac};
    use plumbline_num::run::Run;

    fn distance(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
        let (a, b) = (a / a.norm(), b / b.norm());
        (a - b).norm().min((a + b).norm())
    }

    #[test]
    fn one_solution_of_seven_points_is_the_truth_and_all_satisfy_the_equations() {
        for seed in 0..500 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let views = TwoViews::general(random_pose(&mut rng, 0.5, 1.0), 7, &mut rng);
            let seven: [Correspondence; 7] = std::array::from_fn(|k| views.correspondences[k].scaled(576.0));
            let mut solutions = Vec::new();
            seven_point(&seven, &mut solutions);
            assert!((1..=4).contains(&solutions.len()));
            let pixels = Matrix3::from_diagonal(&Vec3::new(1.0 / 576.0, 1.0 / 576.0, 1.0));
            let truth = pixels * views.essential() * pixels;
            let best = solutions.iter().map(|f| distance(f, &truth)).fold(f64::INFINITY, f64::min);
            assert!(best < 1e-6, "seed {seed}: {best}");
            let worst = seven.iter().flat_map(|c| solutions.iter().map(|f| sampson::squared_distance(f, c)));
            assert!(worst.fold(0.0, f64::max) < 1e-12, "seed {seed}");
        }
    }

    #[test]
    fn the_tangents_agree_with_central_differences() {
        let mut rng = fastrand::Rng::with_seed(4);
        let views = TwoViews::general(random_pose(&mut rng, 0.5, 1.0), 7, &mut rng);
        let skewed = views.essential() * Matrix3::from_diagonal(&Vec3::new(0.5, 1.3, 1.0));
        sampson::assert_tangents(&FundamentalChart::of_matrix(&skewed).expect("regular"));
    }

    #[test]
    fn noise_and_two_outliers_of_five_leave_the_epipolar_geometry() {
        let options = MsacOptions { threshold: 2.0 / 576.0, min_samples: 50, max_samples: 2000, local_steps: 4 };
        for seed in 0..10 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let views = TwoViews::general(random_pose(&mut rng, 0.2, 1.0), 200, &mut rng);
            let clean = views.correspondences.clone();
            let views = views.with_noise(0.3 / 576.0, &mut rng).with_outliers(0.4, &mut rng);
            let data = ByFundamental::of(&views.correspondences);
            let found = msac(&data, &[1.0; 200], &options, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .expect("a matrix exists");
            let mean = clean.iter().map(|c| sampson::squared_distance(&found.model, c)).sum::<f64>() / 200.0;
            assert!(mean.sqrt() * 576.0 < 0.3, "seed {seed}: {} px from the noise-free pairs", mean.sqrt() * 576.0);
        }
    }
}
