//! Synthetic two-view data for the tests of this module.

use nalgebra::{Matrix3, UnitQuaternion};

use crate::motion::sfm::correspondence::Correspondence;
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::Vec2;

pub(crate) fn random_unit(rng: &mut fastrand::Rng) -> Vec3 {
    loop {
        let v = Vec3::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
        if v.norm() > 0.1 && v.norm() < 1.0 {
            return v.normalize();
        }
    }
}

/// A standard normal variable, approximated by the sum of twelve uniform ones: mean 0, variance 1.
pub(crate) fn normal(rng: &mut fastrand::Rng) -> f64 {
    (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0
}

/// A pose with a rotation of up to `angle` rad and a translation of length `baseline`.
pub(crate) fn random_pose(rng: &mut fastrand::Rng, angle: f64, baseline: f64) -> CameraPose {
    let rotation = UnitQuaternion::from_scaled_axis(random_unit(rng) * angle * rng.f64());
    CameraPose { rotation, translation: random_unit(rng) * baseline }
}

/// Points in front of both cameras of the pose `second_from_first`.
#[derive(Clone, Debug)]
pub(crate) struct TwoViews {
    pub(crate) second_from_first: CameraPose,
    pub(crate) points: Vec<Point3>,
    pub(crate) correspondences: Vec<Correspondence>,
}

impl TwoViews {
    /// Points at depths 4 to 12, image coordinates within 0.55 × 0.31 (a focal length of 0.9 widths).
    pub(crate) fn general(pose: CameraPose, n: usize, rng: &mut fastrand::Rng) -> Self {
        Self::from_depths(pose, n, rng, |_, rng| 4.0 + 8.0 * rng.f64())
    }

    /// Points on a slanted plane.
    pub(crate) fn planar(pose: CameraPose, n: usize, rng: &mut fastrand::Rng) -> Self {
        let normal = Vec3::new(0.3, -0.4, 1.0);
        Self::from_depths(pose, n, rng, |ray, _| 6.0 / normal.dot(&ray))
    }

    fn from_depths(
        pose: CameraPose,
        n: usize,
        rng: &mut fastrand::Rng,
        depth: impl Fn(Vec3, &mut fastrand::Rng) -> f64,
    ) -> Self {
        let mut views = Self { second_from_first: pose, points: Vec::new(), correspondences: Vec::new() };
        while views.points.len() < n {
            let ray = Vec3::new(1.1 * (rng.f64() - 0.5), 0.62 * (rng.f64() - 0.5), 1.0);
            let point = Point3::from(ray * depth(ray, rng));
            let seen = pose.apply(&point).coords;
            if seen.z > 0.5 {
                views.points.push(point);
                views.correspondences.push(Correspondence::new(ray.xy(), seen.xy() / seen.z));
            }
        }
        views
    }

    /// `[t]× R` with singular values (1, 1, 0).
    pub(crate) fn essential(&self) -> Matrix3<f64> {
        let t = self.second_from_first.translation.normalize();
        t.cross_matrix() * self.second_from_first.rotation.to_rotation_matrix().matrix()
    }

    /// Adds normal noise of standard deviation `sigma` to all coordinates of both views.
    pub(crate) fn with_noise(mut self, sigma: f64, rng: &mut fastrand::Rng) -> Self {
        for c in &mut self.correspondences {
            let shift = |rng: &mut fastrand::Rng| Vec2::new(normal(rng), normal(rng)) * sigma;
            *c = Correspondence::new(c.first.xy() + shift(rng), c.second.xy() + shift(rng));
        }
        self
    }

    /// Replaces the second view of the first `fraction` of the points by random image positions.
    pub(crate) fn with_outliers(mut self, fraction: f64, rng: &mut fastrand::Rng) -> Self {
        let wrong = (fraction * self.correspondences.len() as f64) as usize;
        for c in &mut self.correspondences[..wrong] {
            c.second = Vec3::new(1.1 * (rng.f64() - 0.5), 0.62 * (rng.f64() - 0.5), 1.0);
        }
        self
    }
}

/// Angle of the rotation between two poses, rad.
pub(crate) fn rotation_error(a: &CameraPose, b: &CameraPose) -> f64 {
    a.rotation.angle_to(&b.rotation)
}

/// Angle between the directions of two translations, rad.
pub(crate) fn direction_error(a: &CameraPose, b: &CameraPose) -> f64 {
    a.translation.angle(&b.translation)
}
