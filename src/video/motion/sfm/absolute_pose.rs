//! Absolute pose of a calibrated camera from 2D–3D correspondences with outliers.
//!
//! Robust search over minimal samples ([`super::three_point()`]) minimizes the truncated squared reprojection error.
//! Each refit is a sequence of Gauss–Newton steps over `R ← Exp(ω) R`, `t ← t + δ` with
//!
//! ```text
//! e = Y_xy/Y_z − ŷ,    Y = R x + t,    ∂e/∂Y = [1 0 −Y_x/Y_z; 0 1 −Y_y/Y_z]/Y_z,    ∂Y/∂ω = −[R x]×,    ∂Y/∂δ = 1.
//! ```

use nalgebra::{Matrix2x3, Matrix6, SMatrix, Vector6};

use super::robust_search::robust_search;
use super::three_point::{PointRay, three_point};
use plumbline_camera::{CameraPose, Vec3};
use plumbline_num::optim::ransac::{Consensus, MsacOptions, Solution};
use plumbline_num::run::{Run, Stopped};

/// Gauss–Newton steps of one refit inside the search. A few are enough: a refit starts near its minimum and is
/// repeated by the search.
const REFIT_STEPS: usize = 4;

/// The pose `cam_from_world` of minimum truncated squared reprojection error, in units of normalized image
/// coordinates.
///
/// `initial`, if given, competes with the poses of the samples, which depend on `seed` alone. `None` for fewer than three
/// points, or if no sample determines a pose.
///
/// # Errors
/// [`Stopped`].
pub fn absolute_pose(
    points: &[PointRay],
    options: &MsacOptions,
    initial: Option<CameraPose>,
    seed: u64,
    run: &Run,
) -> Result<Option<Solution<CameraPose>>, Stopped> {
    robust_search(&ByPointRays(points), options, initial, seed, run)
}

struct ByPointRays<'a>(&'a [PointRay]);

impl Consensus for ByPointRays<'_> {
    type Model = CameraPose;

    fn len(&self) -> usize {
        self.0.len()
    }

    fn sample_size(&self) -> usize {
        3
    }

    fn fit_minimal(&self, sample: &[usize], models: &mut Vec<CameraPose>) {
        three_point(&[0, 1, 2].map(|k| self.0[sample[k]]), models);
    }

    fn fit_weighted(&self, weights: &[f64], initial: &CameraPose) -> Option<CameraPose> {
        let mut pose = *initial;
        for _ in 0..REFIT_STEPS {
            let (normal, gradient) = normal_equations(self.0, weights, &pose);
            let step = -normal.cholesky()?.solve(&gradient);
            pose = pose.perturbed(&step.fixed_rows::<3>(0).into_owned(), &step.fixed_rows::<3>(3).into_owned());
        }
        Some(pose)
    }

    fn squared_residual(&self, pose: &CameraPose, i: usize) -> f64 {
        let y = pose.apply(&self.0[i].point);
        if y.z > 0.0 { (y.coords.xy() / y.z - self.0[i].ray).norm_squared() } else { f64::INFINITY }
    }

    fn group(&self, i: usize) -> u32 {
        i as u32
    }
}

fn normal_equations(points: &[PointRay], weights: &[f64], pose: &CameraPose) -> (Matrix6<f64>, Vector6<f64>) {
    let (mut normal, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
    for (s, &w) in points.iter().zip(weights) {
        let rotated: Vec3 = pose.rotation * s.point.coords;
        let y = rotated + pose.translation;
        if !(w > 0.0 && y.z > 0.0) {
            continue;
        }
        let seen = y.xy() / y.z;
        let by_point = Matrix2x3::new(1.0, 0.0, -seen.x, 0.0, 1.0, -seen.y) / y.z;
        let mut slope = SMatrix::<f64, 2, 6>::zeros();
        slope.fixed_columns_mut::<3>(0).copy_from(&(-by_point * rotated.cross_matrix()));
        slope.fixed_columns_mut::<3>(3).copy_from(&by_point);
        normal += slope.transpose() * slope * w;
        gradient += slope.transpose() * (seen - s.ray) * w;
    }
    (normal, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose, rotation_error};

    const SEARCH: MsacOptions =
        MsacOptions { threshold: 2.0 / 576.0, min_samples: 20, max_samples: 500, local_steps: 4 };

    fn points(views: &TwoViews) -> Vec<PointRay> {
        let pairs = views.points.iter().zip(&views.correspondences);
        pairs.map(|(p, c)| PointRay { point: *p, ray: c.second.xy() }).collect()
    }

    #[test]
    fn noise_and_two_outliers_of_five_leave_the_pose() {
        for seed in 0..30 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let pose = random_pose(&mut rng, 0.5, 1.0);
            let views = TwoViews::general(pose, 150, &mut rng);
            let views = views.with_noise(0.3 / 576.0, &mut rng).with_outliers(0.4, &mut rng);
            let data = points(&views);
            let found = absolute_pose(&data, &SEARCH, None, seed, &Run::default())
                .expect("a run that never stops")
                .expect("a pose exists");
            assert!((found.support - 0.6).abs() < 0.05, "seed {seed}: {}", found.support);
            assert!(rotation_error(&found.model, &pose) < 0.1_f64.to_radians(), "seed {seed}");
            assert!((found.model.center() - pose.center()).norm() < 0.02, "seed {seed}");
        }
    }

    #[test]
    fn exact_data_give_the_exact_pose() {
        let mut rng = fastrand::Rng::with_seed(1);
        let pose = random_pose(&mut rng, 0.5, 1.0);
        let data = points(&TwoViews::general(pose, 30, &mut rng));
        let found = absolute_pose(&data, &SEARCH, None, 1, &Run::default())
            .expect("a run that never stops")
            .expect("a pose exists");
        assert!(rotation_error(&found.model, &pose) < 1e-10);
        assert!((found.model.translation - pose.translation).norm() < 1e-10);
    }
}
