//! Keyframed rotations. Keys are quaternions x, y, z, w, as in glTF.

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3, Vector4};

use super::keys::{hermite, joined_rate};
use super::{Interpolation, Keys};
use crate::character::CharacterError;

/// Rotation keyframes.
#[derive(Clone, Debug, PartialEq)]
pub struct RotationKeys(Keys<4>);

impl RotationKeys {
    /// A curve through quaternions x, y, z, w of any positive length. They are normalized, except for cubic curves, whose tangents
    /// depend on the length.
    ///
    /// # Errors
    /// [`CharacterError::Input`].
    pub fn new(mut keys: Keys<4>) -> Result<Self, CharacterError> {
        let cubic = matches!(keys.interpolation, Interpolation::Cubic { .. });
        for (key, value) in Arc::make_mut(&mut keys.values).iter_mut().enumerate() {
            let norm = Vector4::from(*value).norm();
            if !(norm > 0.0 && norm.is_finite()) {
                let fault = format!("the value of key {key} is no rotation: the quaternion has no length");
                return Err(CharacterError::Input(fault));
            }
            // Unit quaternions up to rounding keep their bits, so that a file is written as it was read.
            if !cubic && (norm - 1.0).abs() > 4.0 * f64::EPSILON {
                *value = value.map(|x| x / norm);
            }
        }
        Ok(Self(keys))
    }

    /// The keys.
    pub fn keys(&self) -> &Keys<4> {
        &self.0
    }

    /// The rotation at a key.
    pub fn key(&self, k: usize) -> UnitQuaternion<f64> {
        UnitQuaternion::from_quaternion(Quaternion::from(self.0.values[k]))
    }

    /// The rotation at a time.
    pub fn at(&self, time: f64) -> UnitQuaternion<f64> {
        let keys = &self.0;
        let (k, u, step) = keys.interval(time);
        if u == 0.0 {
            return self.key(k);
        }
        match &keys.interpolation {
            Interpolation::Step => self.key(k),
            Interpolation::Linear => self.key(k) * UnitQuaternion::from_scaled_axis(self.step(k) * u),
            Interpolation::Cubic { arriving, leaving } => {
                let value = |k: usize| Vector4::from(keys.values[k]);
                let tangents = [leaving[k].into(), arriving[k + 1].into()];
                let mixed = hermite([value(k), value(k + 1)], tangents, u, step);
                UnitQuaternion::try_new(Quaternion::from(mixed), 1e-12).unwrap_or_else(|| self.key(k))
            }
            Interpolation::Smooth => self.smooth(k, u, step),
        }
    }

    /// Rotation vector from key `k` to the next on the shortest path, in the frame of key `k`.
    fn step(&self, k: usize) -> Vector3<f64> {
        (self.key(k).inverse() * self.key(k + 1)).scaled_axis()
    }

    /// Hermite quaternion curve of Kim, Kim and Shin: the control rotations of a Bézier curve with the velocities at both keys.
    fn smooth(&self, k: usize, u: f64, step: f64) -> UnitQuaternion<f64> {
        let exp = UnitQuaternion::from_scaled_axis;
        let first = self.velocity(k) * (step / 3.0);
        let last = self.velocity(k + 1) * (step / 3.0);
        let middle = (exp(first).inverse() * exp(self.step(k)) * exp(last).inverse()).scaled_axis();
        // Cumulative Bernstein polynomials.
        let b = [1.0 - (1.0 - u).powi(3), u * u * (3.0 - 2.0 * u), u * u * u];
        self.key(k) * exp(first * b[0]) * exp(middle * b[1]) * exp(last * b[2])
    }

    /// Angular velocity of the smooth curve at a key, in the frame of the key.
    fn velocity(&self, k: usize) -> Vector3<f64> {
        let times = &self.0.times;
        joined_rate(times, k, |k| self.step(k) / (times[k + 1] - times[k]))
    }
}
