//! Keyframed targets of a handle.
//!
//! Between keys, translations and positions are interpolated linearly and rotations by slerp; before the first key and after the
//! last the motion is constant. [`Interpolation::Smooth`] replaces the parameter `s` between two keys by `3s² − 2s³`: zero
//! velocity at every key, without overshoot.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// Interpolation between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Linear.
    #[default]
    Linear,
    /// Smoothstep: zero velocity at the keys.
    Smooth,
}

/// The motion of a handle over time.
#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    /// Fixed at rest.
    Still,
    /// A rigid motion of all vertices.
    Rigid {
        /// Center of rotation.
        pivot: Point3<f64>,
        /// Keyframes with ascending times; not empty.
        keys: Vec<RigidKey>,
        /// Interpolation between them.
        interpolation: Interpolation,
    },
    /// A motion of each vertex.
    Free {
        /// Ascending times, and positions in ascending order of the vertices; not empty.
        keys: Vec<(f64, Vec<Point3<f64>>)>,
        /// Interpolation between them.
        interpolation: Interpolation,
    },
}

/// A keyframe of a rigid motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidKey {
    /// Time.
    pub time: f64,
    /// Rotation from rest.
    pub rotation: KeyRotation,
    /// Translation from rest.
    pub translation: Vector3<f64>,
}

/// A rotation from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KeyRotation {
    /// A rotation vector, rad; its length may exceed 2π.
    AxisAngle(Vector3<f64>),
    /// An orientation.
    Quaternion(UnitQuaternion<f64>),
}

impl Default for KeyRotation {
    fn default() -> Self {
        Self::AxisAngle(Vector3::zeros())
    }
}

impl KeyRotation {
    /// The rotation as a quaternion.
    pub fn rotation(self) -> UnitQuaternion<f64> {
        match self {
            Self::AxisAngle(axis) => UnitQuaternion::from_scaled_axis(axis),
            Self::Quaternion(rotation) => rotation,
        }
    }

    /// Interpolation to another rotation: linear in the angle about a common axis, slerp otherwise.
    fn interpolated(self, other: Self, s: f64) -> UnitQuaternion<f64> {
        if let (Self::AxisAngle(a), Self::AxisAngle(b)) = (self, other)
            && a.cross(&b).norm() <= 1e-12 * a.norm() * b.norm()
        {
            return UnitQuaternion::from_scaled_axis(a + (b - a) * s);
        }
        let (a, b) = (self.rotation(), other.rotation());
        // Opposite orientations have no unique slerp.
        a.try_slerp(&b, s, 1e-12).unwrap_or(if s < 0.5 { a } else { b })
    }
}

impl Track {
    /// Times of the first and the last key; `None` without motion.
    pub fn times(&self) -> Option<(f64, f64)> {
        match self {
            Self::Still => None,
            Self::Rigid { keys, .. } => Some((keys.first()?.time, keys.last()?.time)),
            Self::Free { keys, .. } => Some((keys.first()?.0, keys.last()?.0)),
        }
    }

    /// The rotation at a time, for rigid and fixed handles.
    pub fn rotation(&self, time: f64) -> Option<UnitQuaternion<f64>> {
        match self {
            Self::Still => Some(UnitQuaternion::identity()),
            Self::Free { .. } => None,
            Self::Rigid { keys, interpolation, .. } => {
                let (a, b, s) = between(keys, |k| k.time, time, *interpolation);
                Some(keys[a].rotation.interpolated(keys[b].rotation, s))
            }
        }
    }

    /// Targets of the vertices at a time, in ascending order of the vertices.
    pub fn positions(&self, vertices: &[u32], rest: &[Point3<f64>], time: f64) -> Vec<Point3<f64>> {
        let at_rest = vertices.iter().map(|v| rest[*v as usize]);
        match self {
            Self::Still => at_rest.collect(),
            Self::Rigid { pivot, keys, interpolation } => {
                let (a, b, s) = between(keys, |k| k.time, time, *interpolation);
                let translation = keys[a].translation + (keys[b].translation - keys[a].translation) * s;
                let rotation = keys[a].rotation.interpolated(keys[b].rotation, s);
                if rotation == UnitQuaternion::identity() {
                    return at_rest.map(|p| p + translation).collect();
                }
                at_rest.map(|p| pivot + rotation * (p - pivot) + translation).collect()
            }
            Self::Free { keys, interpolation } => {
                let (a, b, s) = between(keys, |k| k.0, time, *interpolation);
                let pairs = keys[a].1.iter().zip(&keys[b].1);
                pairs.map(|(p, q)| p + (q - p) * s).collect()
            }
        }
    }
}

/// The keys before and after a time, and the interpolation parameter.
fn between<K>(keys: &[K], time_of: impl Fn(&K) -> f64, time: f64, how: Interpolation) -> (usize, usize, f64) {
    let after = keys.partition_point(|k| time_of(k) <= time);
    if after == 0 {
        return (0, 0, 0.0);
    }
    let before = after - 1;
    if after == keys.len() {
        return (before, before, 0.0);
    }
    let (from, to) = (time_of(&keys[before]), time_of(&keys[after]));
    let s = ((time - from) / (to - from)).clamp(0.0, 1.0);
    let s = match how {
        Interpolation::Linear => s,
        Interpolation::Smooth => s * s * (3.0 - 2.0 * s),
    };
    (before, after, s)
}
