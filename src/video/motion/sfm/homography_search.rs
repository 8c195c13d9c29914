//! Robust estimation of homographies between two views, for rotations of any size.
//!
//! The four correspondences of a sample give eight linear equations in the nine entries of `H`; a refit minimizes the
//! first-order geometric distance of [`super::rotation_fit`] over eight of the entries, the largest one fixed.
//!
//! # Reference
//! Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., sections 4.1 and 4.2.6.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector};

use super::correspondence::{Correspondence, matrix_of_rows};
use super::null_space::null_space;
use super::rotation_fit::{homography_squared_distance, transfer_error};
use plumbline_num::optim::ransac::Consensus;

/// Gauss–Newton steps of one refit inside the search. A few are enough: a refit starts near its minimum and is
/// repeated by the search.
const REFIT_STEPS: usize = 3;

/// Consensus problem: correspondences in normalized image coordinates explained by homographies.
pub(super) struct ByPlane<'a>(pub(super) &'a [Correspondence]);

impl Consensus for ByPlane<'_> {
    type Model = Matrix3<f64>;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn sample_size(&self) -> usize {
        4
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<Matrix3<f64>>) {
        models.extend(homography_of_four_rays(&[0, 1, 2, 3].map(|k| self.0[sample[k]])));
    }

    fn fit_weighted(&self, weights: &[f64], initial: &Matrix3<f64>) -> Option<Matrix3<f64>> {
        let mut h = initial / initial.norm();
        for _ in 0..REFIT_STEPS {
            let fixed = h.iamax_full();
            let (normal, gradient) = normal_equations(&h, fixed, self.0, weights);
            let step = normal.cholesky()?.solve(&gradient);
            for (entry, change) in free_entries(fixed).zip(step.iter()) {
                h[entry] -= change;
            }
            h /= h.norm();
        }
        h.iter().all(|v| v.is_finite()).then_some(h)
    }

    fn squared_residual(&self, model: &Matrix3<f64>, i: usize) -> f64 {
        homography_squared_distance(model, &self.0[i])
    }

    fn group(&self, i: usize) -> u32 {
        i as u32
    }
}

/// The homography of unit norm of four pairs that keeps all four in front; `None` if three are collinear or the
/// homography reverses orientation.
fn homography_of_four_rays(sample: &[Correspondence; 4]) -> Option<Matrix3<f64>> {
    let mut rows = [SVector::<f64, 9>::zeros(); 8];
    for (k, c) in sample.iter().enumerate() {
        for axis in 0..2 {
            let row = &mut rows[2 * k + axis];
            row.fixed_rows_mut::<3>(3 * axis).copy_from(&-c.first);
            row.fixed_rows_mut::<3>(6).copy_from(&(c.first * c.second[axis]));
        }
    }
    let [entries] = null_space::<8, 1>(&rows)?;
    let h = matrix_of_rows(&entries);
    let depths = sample.map(|c| (h * c.first).z);
    let h = if depths[0] < 0.0 { -h } else { h };
    (depths.iter().all(|d| d * depths[0] > 0.0) && h.determinant() > 0.0).then_some(h)
}

/// Indices of all entries of a matrix but one.
fn free_entries(fixed: (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    (0..9).map(|k| (k / 3, k % 3)).filter(move |entry| *entry != fixed)
}

type Normal = (SMatrix<f64, 8, 8>, SVector<f64, 8>);

fn normal_equations(h: &Matrix3<f64>, fixed: (usize, usize), pairs: &[Correspondence], weights: &[f64]) -> Normal {
    let (mut normal, mut gradient) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
    for (pair, &w) in pairs.iter().zip(weights).filter(|(_, w)| **w > 0.0) {
        let Some((e, by_point)) = transfer_error(h, pair) else { continue };
        let j = by_point * h.fixed_columns::<2>(0);
        let Some(metric) = (Matrix2::identity() + j * j.transpose()).try_inverse() else { continue };
        let mut slope = SMatrix::<f64, 2, 8>::zeros();
        for (k, (row, column)) in free_entries(fixed).enumerate() {
            slope.set_column(k, &(by_point.column(row) * pair.first[column]));
        }
        let weighted = slope.transpose() * metric * w;
        normal += weighted * slope;
        gradient += weighted * e;
    }
    (normal, gradient)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;
    use plumbline_num::run::Run;

    use super::*;
    use crate::motion::sfm::tests::synthetic_views::TwoViews;
    use plumbline_camera::{CameraPose, Vec3};
    use plumbline_num::optim::ransac::{MsacOptions, msac};

    #[test]
    fn a_rotation_by_forty_degrees_is_found_through_noise_and_two_outliers_of_five() {
        let options = MsacOptions { threshold: 2.0 / 576.0, min_samples: 40, max_samples: 500, local_steps: 4 };
        for (seed, angle) in [(0, 0.0), (1, 0.3), (2, 0.5), (3, 0.7)] {
            let mut rng = fastrand::Rng::with_seed(seed);
            let rotation = UnitQuaternion::from_scaled_axis(Vec3::y() * angle);
            let views = TwoViews::general(CameraPose { rotation, translation: Vec3::zeros() }, 200, &mut rng);
            let views = views.with_noise(0.3 / 576.0, &mut rng).with_outliers(0.4, &mut rng);
            let found = msac(&ByPlane(&views.correspondences), &[1.0; 200], &options, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .expect("found");
            assert!((found.support - 0.6).abs() < 0.05, "{angle}: {}", found.support);
            let h = found.model / found.model.determinant().cbrt();
            assert!((h - rotation.to_rotation_matrix().matrix()).norm() < 0.02, "{angle}: {h}");
        }
    }

    #[test]
    fn four_exact_pairs_give_the_homography_and_three_on_a_line_none() {
        let h = Matrix3::new(1.1, 0.1, 0.2, -0.1, 0.9, -0.1, 0.2, -0.3, 1.0);
        let pair = |x: f64, y: f64| {
            let first = Vec3::new(x, y, 1.0);
            let second = h * first;
            Correspondence { first, second: second / second.z }
        };
        let four = [pair(-0.5, -0.3), pair(0.5, -0.3), pair(0.4, 0.3), pair(-0.5, 0.2)];
        let found = homography_of_four_rays(&four).expect("general position");
        assert!((found / found[(2, 2)] - h).norm() < 1e-12);
        assert!(homography_of_four_rays(&[pair(0.0, 0.0), pair(0.1, 0.1), pair(0.3, 0.3), four[0]]).is_none());
    }
}
