//! Similarities of space, and the one that lays one set of cameras over another.
//!
//! ```text
//! x ↦ s R x + t,      R = argmin Σ ‖A_iᵀ B_i − R‖²,      (s, t) = argmin Σ ‖s R a_i + t − b_i‖²
//! ```
//!
//! `A_i, a_i` and `B_i, b_i` are the axes (`world_from_cam`) and centers of corresponding cameras. The rotation comes
//! from the axes alone, so that cameras on a line, or all at one position, are aligned too.
//!
//! # Reference
//! S. Umeyama, IEEE TPAMI 13(4), 1991 (scale and translation; with the rotation given they are linear).

use nalgebra::UnitQuaternion;

use super::rotation::nearest_rotation;
use super::{CameraPose, Point3, Vec3};

/// `x ↦ s R x + t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity3 {
    /// `s` > 0.
    pub scale: f64,
    /// `R`.
    pub rotation: UnitQuaternion<f64>,
    /// `t`.
    pub translation: Vec3,
}

impl Similarity3 {
    /// Image of a point.
    pub fn apply(&self, x: &Point3) -> Point3 {
        Point3::from(self.scale * (self.rotation * x.coords) + self.translation)
    }

    /// A camera of this world in the target world of the similarity.
    pub fn camera(&self, pose: &CameraPose) -> CameraPose {
        CameraPose::looking_from(self.apply(&pose.center()), pose.rotation * self.rotation.inverse())
    }
}

/// The similarity that lays cameras of one world over the same cameras of another, and the RMS distance of centers that
/// it leaves, in units of the second. `None` for no cameras. Cameras at one position keep their scale.
pub fn align(pairs: &[(CameraPose, CameraPose)]) -> Option<(Similarity3, f64)> {
    if pairs.is_empty() {
        return None;
    }
    let turned = |(a, b): &(CameraPose, CameraPose)| *(b.rotation.inverse() * a.rotation).to_rotation_matrix().matrix();
    let rotation = UnitQuaternion::from_rotation_matrix(&nearest_rotation(&pairs.iter().map(turned).sum())?);
    let n = pairs.len() as f64;
    let mean = |of: &dyn Fn(&(CameraPose, CameraPose)) -> Vec3| pairs.iter().map(of).sum::<Vec3>() / n;
    let (from, to) = (mean(&|p| p.0.center().coords), mean(&|p| p.1.center().coords));
    let (mut along, mut spread) = (0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (rotation * (a.center().coords - from), b.center().coords - to);
        along += a.dot(&b);
        spread += a.norm_squared();
    }
    let scale = if spread > 0.0 && along > 0.0 { along / spread } else { 1.0 };
    let found = Similarity3 { scale, rotation, translation: to - scale * (rotation * from) };
    let misses = pairs.iter().map(|(a, b)| (found.apply(&a.center()) - b.center()).norm_squared());
    let rms = (misses.sum::<f64>() / n).sqrt();
    rms.is_finite().then_some((found, rms))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras() -> Vec<CameraPose> {
        let mut random = fastrand::Rng::with_seed(5);
        let mut vector = || Vec3::from_fn(|_, _| random.f64() - 0.5);
        let mut camera =
            || CameraPose::looking_from(Point3::from(3.0 * vector()), UnitQuaternion::from_scaled_axis(vector()));
        (0..20).map(|_| camera()).collect()
    }

    fn moved() -> Similarity3 {
        let rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.4, -1.1, 0.2));
        Similarity3 { scale: 2.5, rotation, translation: Vec3::new(1.0, -3.0, 0.5) }
    }

    #[test]
    fn cameras_seen_from_another_world_are_laid_over_themselves() {
        let pairs: Vec<_> = cameras().into_iter().map(|c| (c, moved().camera(&c))).collect();
        let (found, rms) = align(&pairs).expect("twenty cameras");
        assert!(rms < 1e-12 && (found.scale - 2.5).abs() < 1e-12);
        assert!(
            found.rotation.angle_to(&moved().rotation) < 1e-12
                && (found.translation - moved().translation).norm() < 1e-12
        );
    }

    #[test]
    fn a_moved_camera_sees_the_moved_points_where_it_saw_them() {
        let (camera, x) = (cameras()[3], Point3::new(0.3, 1.0, 4.0));
        let seen = moved().camera(&camera).apply(&moved().apply(&x));
        assert!((seen.coords - 2.5 * camera.apply(&x).coords).norm() < 1e-12);
    }

    #[test]
    fn cameras_at_one_position_are_aligned_by_their_axes() {
        let turning = cameras().into_iter().map(|c| CameraPose::looking_from(Point3::origin(), c.rotation));
        let pairs: Vec<_> = turning.map(|c| (c, Similarity3 { scale: 1.0, ..moved() }.camera(&c))).collect();
        let (found, rms) = align(&pairs).expect("twenty cameras");
        assert!(rms < 1e-12 && found.scale == 1.0 && found.rotation.angle_to(&moved().rotation) < 1e-12);
        assert!(align(&[]).is_none());
    }
}
