//! Rigid poses `x_in_camera = R x_in_world + t`.

use nalgebra::UnitQuaternion;

use super::{Point3, Vec3};

/// The rigid map from world to camera coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// `R`, world axes to camera axes.
    pub rotation: UnitQuaternion<f64>,
    /// `t`, the world's origin in camera coordinates, in the unit of the scene.
    pub translation: Vec3,
}

impl CameraPose {
    /// The camera that sits in the world's origin and looks along +z.
    pub fn identity() -> Self {
        Self { rotation: UnitQuaternion::identity(), translation: Vec3::zeros() }
    }

    /// The camera with axes `rotation` whose center is `center`.
    pub fn looking_from(center: Point3, rotation: UnitQuaternion<f64>) -> Self {
        Self { rotation, translation: -(rotation * center.coords) }
    }

    /// `x_in_camera` of a point of the world.
    pub fn apply(&self, x_in_world: &Point3) -> Point3 {
        self.rotation * x_in_world + self.translation
    }

    /// Center of the camera, world coordinates.
    pub fn center(&self) -> Point3 {
        Point3::from(-(self.rotation.inverse() * self.translation))
    }

    /// `world_from_cam`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self { rotation, translation: -(rotation * self.translation) }
    }

    /// The pose at the fraction `fraction` of the uniform motion to `other`; also below 0 and above 1.
    #[must_use]
    pub fn toward(&self, other: &Self, fraction: f64) -> Self {
        let turn = (other.rotation * self.rotation.inverse()).scaled_axis() * fraction;
        let center = self.center() + (other.center() - self.center()) * fraction;
        Self::looking_from(center, UnitQuaternion::from_scaled_axis(turn) * self.rotation)
    }

    /// `R ← Exp(ω) R`, `t ← t + δ`: the step of every optimization over poses.
    #[must_use]
    pub fn perturbed(&self, omega: &Vec3, delta: &Vec3) -> Self {
        let rotation = UnitQuaternion::from_scaled_axis(*omega) * self.rotation;
        Self { rotation: UnitQuaternion::new_normalize(rotation.into_inner()), translation: self.translation + delta }
    }
}

/// `f * g` first applies `g`, then `f`.
impl std::ops::Mul for CameraPose {
    type Output = Self;

    fn mul(self, g: Self) -> Self {
        Self { rotation: self.rotation * g.rotation, translation: self.rotation * g.translation + self.translation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> CameraPose {
        CameraPose {
            rotation: UnitQuaternion::from_scaled_axis(Vec3::new(0.3, -0.7, 0.2)),
            translation: Vec3::new(1.0, -2.0, 0.5),
        }
    }

    #[test]
    fn the_center_is_seen_at_the_cameras_origin() {
        assert!(sample().apply(&sample().center()).coords.norm() < 1e-14);
        let again = CameraPose::looking_from(sample().center(), sample().rotation);
        assert!((again.translation - sample().translation).norm() < 1e-14);
    }

    #[test]
    fn composition_applies_the_right_factor_first_and_the_inverse_undoes() {
        let g = CameraPose { translation: Vec3::new(0.1, 0.2, 0.9), ..sample() };
        let p = Point3::new(0.4, 5.0, -1.0);
        assert!(((sample() * g).apply(&p) - sample().apply(&g.apply(&p))).norm() < 1e-13);
        assert!(((sample().inverse() * sample()).apply(&p) - p).norm() < 1e-13);
    }

    #[test]
    fn two_half_motions_are_the_whole_motion() {
        let other = CameraPose { translation: Vec3::new(0.1, 0.2, 0.9), ..sample().inverse() };
        let middle = sample().toward(&other, 0.5);
        let there = sample().toward(&middle, 2.0);
        assert!(there.rotation.angle_to(&other.rotation) < 1e-13 && (there.center() - other.center()).norm() < 1e-13);
        assert!((sample().toward(&other, 0.0).translation - sample().translation).norm() < 1e-14);
    }

    #[test]
    fn a_perturbation_rotates_the_camera_about_its_own_axes() {
        let (omega, delta) = (Vec3::new(1e-6, -2e-6, 3e-6), Vec3::new(4e-6, 0.0, -1e-6));
        let p = Point3::new(0.4, 5.0, -1.0);
        let moved = sample().perturbed(&omega, &delta).apply(&p) - sample().apply(&p);
        let expected = omega.cross(&(sample().rotation * p.coords)) + delta;
        assert!((moved - expected).norm() < 1e-10);
    }
}
