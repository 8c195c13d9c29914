//! Where a handle wants its vertices over time.
//!
//! Between keys, translations and places are interpolated evenly and rotations by slerp; before the first key and after the
//! last, what they say holds. [`Interpolation::Smooth`] replaces the share `s` of the way between two keys by `3s² − 2s³`:
//! motion starts and ends gently at every key, and never overshoots.

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::Deserialize;

/// What happens between keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Even motion.
    #[default]
    Linear,
    /// Gently out of each key and into the next.
    Smooth,
}

/// The wish of a handle over time.
#[derive(Clone, Debug, PartialEq)]
pub enum Track {
    /// Vertices stay where they are at rest.
    Still,
    /// All vertices move as one body.
    Rigid {
        /// About what it turns.
        pivot: Point3<f64>,
        /// Motions, times ascending; never empty.
        keys: Vec<RigidKey>,
        /// What happens between them.
        interpolation: Interpolation,
    },
    /// Each vertex moves by itself: times, ascending, and places in the ascending order of the vertices; never empty.
    Free {
        /// Times and places.
        keys: Vec<(f64, Vec<Point3<f64>>)>,
        /// What happens between them.
        interpolation: Interpolation,
    },
}

/// A rigid motion at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidKey {
    /// When.
    pub time: f64,
    /// The turn from rest.
    pub turn: Turn,
    /// The translation from rest.
    pub translation: Vector3<f64>,
}

/// A turn from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// About an axis by its length, rad, which may be more than a whole turn.
    About(Vector3<f64>),
    /// To an orientation.
    To(UnitQuaternion<f64>),
}

impl Default for Turn {
    fn default() -> Self {
        Self::About(Vector3::zeros())
    }
}

impl Turn {
    /// The orientation that it ends at.
    pub fn rotation(self) -> UnitQuaternion<f64> {
        match self {
            Self::About(axis) => UnitQuaternion::from_scaled_axis(axis),
            Self::To(rotation) => rotation,
        }
    }

    /// At share `s` of the way to another: all the way round where both are about one axis, else the shortest.
    fn toward(self, other: Self, s: f64) -> UnitQuaternion<f64> {
        if let (Self::About(a), Self::About(b)) = (self, other)
            && a.cross(&b).norm() <= 1e-12 * a.norm() * b.norm()
        {
            return UnitQuaternion::from_scaled_axis(a + (b - a) * s);
        }
        let (a, b) = (self.rotation(), other.rotation());
        // Opposite orientations: any way is the shortest.
        a.try_slerp(&b, s, 1e-12).unwrap_or(if s < 0.5 { a } else { b })
    }
}

impl Track {
    /// Times of the first key and the last; `None` where nothing moves.
    pub fn times(&self) -> Option<(f64, f64)> {
        match self {
            Self::Still => None,
            Self::Rigid { keys, .. } => Some((keys.first()?.time, keys.last()?.time)),
            Self::Free { keys, .. } => Some((keys.first()?.0, keys.last()?.0)),
        }
    }

    /// The rotation at a time, for handles that are moved as one body or held still.
    pub fn rotation(&self, time: f64) -> Option<UnitQuaternion<f64>> {
        match self {
            Self::Still => Some(UnitQuaternion::identity()),
            Self::Free { .. } => None,
            Self::Rigid { keys, interpolation, .. } => {
                let (a, b, s) = between(keys, |k| k.time, time, *interpolation);
                Some(keys[a].turn.toward(keys[b].turn, s))
            }
        }
    }

    /// Where the vertices shall be at a time, in ascending order of the vertices.
    pub fn positions(&self, vertices: &[u32], rest: &[Point3<f64>], time: f64) -> Vec<Point3<f64>> {
        let at_rest = vertices.iter().map(|v| rest[*v as usize]);
        match self {
            Self::Still => at_rest.collect(),
            Self::Rigid { pivot, keys, interpolation } => {
                let (a, b, s) = between(keys, |k| k.time, time, *interpolation);
                let translation = keys[a].translation + (keys[b].translation - keys[a].translation) * s;
                let turn = keys[a].turn.toward(keys[b].turn, s);
                if turn == UnitQuaternion::identity() {
                    return at_rest.map(|p| p + translation).collect();
                }
                at_rest.map(|p| pivot + turn * (p - pivot) + translation).collect()
            }
            Self::Free { keys, interpolation } => {
                let (a, b, s) = between(keys, |k| k.0, time, *interpolation);
                let pairs = keys[a].1.iter().zip(&keys[b].1);
                pairs.map(|(p, q)| p + (q - p) * s).collect()
            }
        }
    }
}

/// The keys before and after a time, and the share of the way between them.
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
