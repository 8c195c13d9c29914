//! Essential matrices `E = [t]× R`: robust estimation and nonlinear refinement.
//!
//! Minimal samples are solved by [`super::five_point()`]; a refit minimizes the Sampson distance over `R ← Exp(ω) R`
//! and `t` on the unit sphere.

use nalgebra::{Matrix3, Rotation3, SVector, UnitQuaternion};

use super::correspondence::Correspondence;
use super::epipolar::{Epipolar, EpipolarFamily};
use super::five_point::five_point;
use super::sampson::Chart;
use plumbline_camera::{CameraPose, Vec3};

/// A pose with a unit translation, and the coordinates `(ω, a, b)` around it: `t` moves along two tangents of the sphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct EssentialChart {
    pub(super) rotation: Rotation3<f64>,
    pub(super) translation: Vec3,
}

impl EssentialChart {
    /// The chart around a pose; its translation must be nonzero.
    pub(super) fn at(pose: &CameraPose) -> Self {
        Self { rotation: pose.rotation.to_rotation_matrix(), translation: pose.translation.normalize() }
    }

    pub(super) fn pose(&self) -> CameraPose {
        let rotation = UnitQuaternion::from_rotation_matrix(&self.rotation);
        CameraPose { rotation, translation: self.translation }
    }

    /// Two unit vectors perpendicular to `t` and to each other.
    fn sphere_tangents(&self) -> [Vec3; 2] {
        let t = self.translation;
        let mut axis = Vec3::zeros();
        axis[t.iamin()] = 1.0;
        let a = t.cross(&axis).normalize();
        [a, t.cross(&a)]
    }
}

impl Chart<5> for EssentialChart {
    fn matrix(&self) -> Matrix3<f64> {
        self.translation.cross_matrix() * self.rotation.matrix()
    }

    fn tangents(&self) -> [Matrix3<f64>; 5] {
        let (cross, r) = (self.translation.cross_matrix(), self.rotation.matrix());
        let [a, b] = self.sphere_tangents();
        let angular = |axis: Vec3| cross * axis.cross_matrix() * r;
        [angular(Vec3::x()), angular(Vec3::y()), angular(Vec3::z()), a.cross_matrix() * r, b.cross_matrix() * r]
    }

    fn moved(&self, step: &SVector<f64, 5>) -> Self {
        let [a, b] = self.sphere_tangents();
        Self {
            rotation: Rotation3::new(step.fixed_rows::<3>(0).into_owned()) * self.rotation,
            translation: (self.translation + a * step[3] + b * step[4]).normalize(),
        }
    }
}

/// The two rotations of an essential matrix: `U W Vᵀ` and `U Wᵀ Vᵀ` with `W` a rotation by 90° about z.
///
/// # Reference
/// Hartley, Zisserman, *Multiple View Geometry*, 2nd ed., section 9.6.2.
pub(super) fn rotations_of(e: &Matrix3<f64>) -> Option<[Rotation3<f64>; 2]> {
    let svd = e.try_svd(true, true, 1e-15, 100)?;
    let (mut u, mut v_t) = (svd.u?, svd.v_t?);
    if u.determinant() < 0.0 {
        u = -u;
    }
    if v_t.determinant() < 0.0 {
        v_t = -v_t;
    }
    let quarter = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    Some([quarter, quarter.transpose()].map(|w| Rotation3::from_matrix_unchecked(u * w * v_t)))
}

/// The unit vector `t` with `tᵀ E = 0`.
pub(super) fn left_null_vector(e: &Matrix3<f64>) -> Option<Vec3> {
    let columns = [e.column(0).into_owned(), e.column(1).into_owned(), e.column(2).into_owned()];
    let crossed = [columns[0].cross(&columns[1]), columns[1].cross(&columns[2]), columns[2].cross(&columns[0])];
    crossed.into_iter().max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?.try_normalize(0.0)
}

/// Consensus problem: correspondences in normalized image coordinates explained by essential matrices.
pub(super) type ByEssential<'a> = Epipolar<'a, EssentialChart, 5>;

impl EpipolarFamily<5> for EssentialChart {
    const SAMPLE: usize = 5;

    fn fit_minimal(sample: &[Correspondence], models: &mut Vec<Matrix3<f64>>) {
        five_point(&std::array::from_fn(|k| sample[k]), models);
    }

    /// One of the four poses of an essential matrix: all have the same matrix up to sign.
    fn of_matrix(e: &Matrix3<f64>) -> Option<Self> {
        let [rotation, _] = rotations_of(e)?;
        Some(Self { rotation, translation: left_null_vector(e)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::essential_pose::pose_of_essential;
    use crate::motion::sfm::sampson;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, direction_error, random_pose, rotation_error};
    use plumbline_num::optim::ransac::{MsacOptions, msac};
    use plumbline_num::run::Run;

    const SEARCH: MsacOptions =
        MsacOptions { threshold: 2.0 / 576.0, min_samples: 50, max_samples: 1000, local_steps: 4 };

    #[test]
    fn the_tangents_agree_with_central_differences() {
        let mut rng = fastrand::Rng::with_seed(3);
        sampson::assert_tangents(&EssentialChart::at(&random_pose(&mut rng, 1.0, 1.0)));
    }

    #[test]
    fn the_matrix_of_a_chart_of_a_matrix_is_the_matrix() {
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..50 {
            let e = EssentialChart::at(&random_pose(&mut rng, 2.0, 1.0)).matrix();
            let again = EssentialChart::of_matrix(&e).expect("regular").matrix();
            assert!((e - again).norm().min((e + again).norm()) < 1e-12);
        }
    }

    #[test]
    fn noise_and_two_outliers_of_five_leave_the_pose() {
        for seed in 0..20 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let pose = random_pose(&mut rng, 0.2, 1.0);
            let views = TwoViews::general(pose, 200, &mut rng);
            let clean = views.correspondences.clone();
            let views = views.with_noise(0.3 / 576.0, &mut rng).with_outliers(0.4, &mut rng);
            let data = ByEssential::of(&views.correspondences);
            let found = msac(&data, &[1.0; 200], &SEARCH, None, &mut rng, &Run::default())
                .expect("a run that never stops")
                .expect("a pose exists");
            let (estimate, _) = pose_of_essential(&found.model, &views.correspondences, &[true; 200]).expect("a pose");
            // First-order error bound from the noise of the 120 inliers.
            let weights: Vec<f64> = (0..200).map(|k| f64::from(k >= 80)).collect();
            let truth = sampson::normal_equations(&EssentialChart::at(&pose), &clean, &weights);
            let covariance = truth.normal.try_inverse().expect("general position") * (0.3_f64 / 576.0).powi(2);
            let deviation = |k: usize, n: usize| (k..k + n).map(|i| covariance[(i, i)]).sum::<f64>().sqrt();
            assert!(rotation_error(&estimate, &pose) < 4.0 * deviation(0, 3), "seed {seed}");
            assert!(direction_error(&estimate, &pose) < 4.0 * deviation(3, 2), "seed {seed}");
        }
    }

    #[test]
    fn refinement_of_exact_data_reaches_the_truth() {
        let mut rng = fastrand::Rng::with_seed(7);
        let pose = random_pose(&mut rng, 0.3, 1.0);
        let views = TwoViews::general(pose, 40, &mut rng);
        let start = pose.perturbed(&Vec3::new(0.01, -0.01, 0.02), &Vec3::new(0.05, 0.02, -0.05));
        let refined = sampson::refined(EssentialChart::at(&start), &views.correspondences, &[1.0; 40], 30).pose();
        assert!(rotation_error(&refined, &pose) < 1e-9 && direction_error(&refined, &pose) < 1e-7);
    }
}
