//! Schema of the clips of a skeleton file. Keys are written as they are, so that a spline is edited again and not its samples.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::super::skeleton::unknown_name;
use super::super::{Clip, Curve, Interpolation, Keys, RigFileError, RotationKeys, Skeleton, Track};

/// A named animation of the joints.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ClipEntry {
    /// Name of the clip.
    name: String,
    /// Animated properties, each of a joint at most once.
    tracks: Vec<TrackEntry>,
}

/// Keyframes of a property of a joint.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct TrackEntry {
    /// Name of the joint.
    joint: String,
    /// The animated property.
    property: Property,
    /// Interpolation between the keys.
    #[serde(default)]
    interpolation: Word,
    /// Key times, s, ascending.
    times: Vec<f64>,
    /// Value of each key: translation in the parent frame (3 numbers, units of the model), rotation in the parent frame (quaternion
    /// `[w, x, y, z]` of any length), or scale factors (3).
    values: Vec<Vec<f64>>,
    /// Incoming tangent of each key, per second; with `cubic` alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    arriving: Vec<Vec<f64>>,
    /// Outgoing tangent of each key, per second; with `cubic` alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    leaving: Vec<Vec<f64>>,
}

/// A property of a joint.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
enum Property {
    /// Translation.
    Translation,
    /// Rotation.
    Rotation,
    /// Scale.
    Scale,
}

/// Interpolation between keys.
#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
enum Word {
    /// Constant: the value of the key before.
    Step,
    /// Linear; of rotations slerp.
    #[default]
    Linear,
    /// A smooth spline through the keys.
    Smooth,
    /// Cubic Hermite with the given tangents.
    Cubic,
}

impl ClipEntry {
    pub(super) fn of(clip: &Clip, skeleton: &Skeleton) -> Self {
        let joint = |j: u32| skeleton.joints()[j as usize].name.clone();
        let tracks = clip.tracks().iter().filter(|t| (t.joint as usize) < skeleton.joint_count());
        Self {
            name: clip.name().to_owned(),
            tracks: tracks.map(|track| TrackEntry::of(joint(track.joint), &track.curve)).collect(),
        }
    }

    pub(super) fn into_clip(self, skeleton: &Skeleton, names: &HashMap<&str, u32>) -> Result<Clip, RigFileError> {
        let known: Vec<&str> = skeleton.joints().iter().map(|j| j.name.as_str()).collect();
        let track = |entry: TrackEntry| -> Result<Track, RigFileError> {
            let joint = *names.get(entry.joint.as_str()).ok_or_else(|| unknown_name(&entry.joint, &known))?;
            Ok(Track { joint, curve: entry.into_curve(&self.name)? })
        };
        let tracks = self.tracks.into_iter().map(track).collect::<Result<Vec<_>, _>>()?;
        Ok(Clip::new(self.name, tracks, Vec::new())?)
    }
}

impl TrackEntry {
    fn of(joint: String, curve: &Curve) -> Self {
        match curve {
            Curve::Translation(keys) => Self::of_keys(joint, Property::Translation, keys, |v| v.to_vec()),
            Curve::Scale(keys) => Self::of_keys(joint, Property::Scale, keys, |v| v.to_vec()),
            Curve::Rotation(keys) => {
                Self::of_keys(joint, Property::Rotation, keys.keys(), |&[x, y, z, w]| vec![w, x, y, z])
            }
        }
    }

    fn of_keys<const N: usize>(
        joint: String,
        property: Property,
        keys: &Keys<N>,
        written: impl Fn(&[f64; N]) -> Vec<f64>,
    ) -> Self {
        let rows = |rows: &[[f64; N]]| rows.iter().map(&written).collect();
        let (interpolation, arriving, leaving) = match keys.interpolation() {
            Interpolation::Step => (Word::Step, Vec::new(), Vec::new()),
            Interpolation::Linear => (Word::Linear, Vec::new(), Vec::new()),
            Interpolation::Smooth => (Word::Smooth, Vec::new(), Vec::new()),
            Interpolation::Cubic { arriving, leaving } => (Word::Cubic, rows(arriving), rows(leaving)),
        };
        let (times, values) = (keys.times().to_vec(), rows(keys.values()));
        Self { joint, property, interpolation, times, values, arriving, leaving }
    }

    fn into_curve(self, clip: &str) -> Result<Curve, RigFileError> {
        let property = self.property;
        if self.interpolation != Word::Cubic && !(self.arriving.is_empty() && self.leaving.is_empty()) {
            let fault = format!("clip {clip:?}, joint {:?}: tangents are given, which belong to \"cubic\"", self.joint);
            return Err(RigFileError::Content(fault));
        }
        Ok(match property {
            Property::Translation => Curve::Translation(self.into_keys(clip, |v| v)?),
            Property::Scale => Curve::Scale(self.into_keys(clip, |v| v)?),
            Property::Rotation => {
                Curve::Rotation(RotationKeys::new(self.into_keys(clip, |[w, x, y, z]| [x, y, z, w])?)?)
            }
        })
    }

    fn into_keys<const N: usize>(
        self,
        clip: &str,
        read: impl Fn([f64; N]) -> [f64; N],
    ) -> Result<Keys<N>, RigFileError> {
        let joint = &self.joint;
        let row = |row: Vec<f64>| -> Result<[f64; N], RigFileError> {
            let numbers = row.len();
            let fault = || format!("clip {clip:?}, joint {joint:?}: a key of {numbers} numbers (expected {N})");
            Ok(read(row.try_into().map_err(|_| RigFileError::Content(fault()))?))
        };
        let rows = |all: Vec<Vec<f64>>| all.into_iter().map(&row).collect::<Result<Vec<_>, _>>();
        let values = rows(self.values)?;
        let interpolation = match self.interpolation {
            Word::Step => Interpolation::Step,
            Word::Linear => Interpolation::Linear,
            Word::Smooth => Interpolation::Smooth,
            Word::Cubic => Interpolation::Cubic { arriving: rows(self.arriving)?, leaving: rows(self.leaving)? },
        };
        Ok(Keys::new(self.times, values, interpolation)?)
    }
}
