//! Animation clips: keyframed joint transforms and morph weights, and the poses they give.
//!
//! ```text
//! vectors      step · a + u (b − a) · cubic Hermite · smooth: Hermite with the velocities below
//! rotations    step · a (a⁻¹ b)ᵘ (slerp) · normalized Hermite (glTF) · smooth: cumulative cubic Bézier
//! velocity     vₖ = (hₖ dₖ₋₁ + hₖ₋₁ dₖ) / (hₖ₋₁ + hₖ)     d slopes (of rotations: log / h), h interval lengths
//! ```
//!
//! Smooth curves are C¹ for any key spacing and reproduce motion at constant velocity.
//!
//! # Reference
//! M.-J. Kim, M.-S. Kim, S. Y. Shin, *A General Construction Scheme for Unit Quaternion Curves with Simple High Order
//! Derivatives*, SIGGRAPH 1995, §4 (Hermite quaternion curve). Khronos Group, *glTF 2.0*, appendix C (interpolation).

mod keys;
mod rotation;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::{CharacterError, Pose, Skeleton};

pub use keys::{Interpolation, Keys};
pub use rotation::RotationKeys;

/// The curve of one property of a joint.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// Translation in the parent frame, units of the model.
    Translation(Keys<3>),
    /// Rotation in the parent frame.
    Rotation(RotationKeys),
    /// Scale factors along the joint axes.
    Scale(Keys<3>),
}

impl Curve {
    /// Key times, s.
    pub fn times(&self) -> &[f64] {
        match self {
            Self::Translation(keys) | Self::Scale(keys) => keys.times(),
            Self::Rotation(keys) => keys.keys().times(),
        }
    }

    /// Name of the property, for messages and to detect duplicates.
    fn property(&self) -> &'static str {
        match self {
            Self::Translation(_) => "translation",
            Self::Rotation(_) => "rotation",
            Self::Scale(_) => "scale",
        }
    }
}

/// An animated property of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// The joint.
    pub joint: u32,
    /// The curve.
    pub curve: Curve,
}

/// An animated morph weight.
#[derive(Clone, Debug, PartialEq)]
pub struct MorphTrack {
    /// The morph target.
    pub target: u32,
    /// Its weight over time.
    pub keys: Keys<1>,
}

/// A named animation of joints and morph targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    name: String,
    tracks: Vec<Track>,
    morphs: Vec<MorphTrack>,
}

/// Extrapolation before the first and after the last key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Extrapolation {
    /// Constant: the value of the nearest key.
    #[default]
    Constant,
    /// Cyclic: the clip repeats.
    Repeat,
}

impl Clip {
    /// A clip.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if two tracks animate one property.
    pub fn new(name: impl Into<String>, tracks: Vec<Track>, morphs: Vec<MorphTrack>) -> Result<Self, CharacterError> {
        let (name, mut seen) = (name.into(), std::collections::HashSet::new());
        let of_joints = tracks.iter().map(|track| (track.curve.property(), track.joint));
        let of_targets = morphs.iter().map(|morph| ("weight of morph target", morph.target));
        if let Some((what, number)) = of_joints.chain(of_targets).find(|moved| !seen.insert(*moved)) {
            return Err(CharacterError::Input(format!("clip {name:?} has two tracks for the {what} {number}")));
        }
        Ok(Self { name, tracks, morphs })
    }

    /// The name of the clip.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The same clip with another name.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Joint tracks.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Morph tracks.
    pub fn morphs(&self) -> &[MorphTrack] {
        &self.morphs
    }

    /// Times of the first and the last key, s; `None` without keys.
    pub fn span(&self) -> Option<(f64, f64)> {
        let of_joints = self.tracks.iter().map(|t| t.curve.times());
        let times = of_joints.chain(self.morphs.iter().map(|m| m.keys.times()));
        times.map(|t| (t[0], t[t.len() - 1])).reduce(|(a, b), (c, d)| (a.min(c), b.max(d)))
    }

    /// Checks that all animated joints and morph targets exist.
    ///
    /// # Errors
    /// [`CharacterError::Input`].
    pub fn check(&self, joints: usize, targets: usize) -> Result<(), CharacterError> {
        let of_joints = self.tracks.iter().map(|track| ("joint", track.joint, joints));
        let of_targets = self.morphs.iter().map(|morph| ("morph target", morph.target, targets));
        let unknown = |(_, number, there): &(&str, u32, usize)| *number as usize >= *there;
        let Some((what, number, there)) = of_joints.chain(of_targets).find(unknown) else { return Ok(()) };
        let known = format!("but there are {there}, numbered from 0");
        Err(CharacterError::Input(format!("clip {:?} moves {what} {number}, {known}", self.name)))
    }

    /// The pose at a time, s; properties without a track are at rest.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if the skeleton lacks an animated joint.
    pub fn pose(&self, skeleton: &Skeleton, time: f64, extrapolation: Extrapolation) -> Result<Pose, CharacterError> {
        self.check(skeleton.joint_count(), usize::MAX)?;
        let (time, mut pose) = (self.inside(time, extrapolation), skeleton.rest_pose());
        for track in &self.tracks {
            let local = &mut pose.locals[track.joint as usize];
            match &track.curve {
                Curve::Translation(keys) => local.translation = Vector3::from(keys.at(time)),
                Curve::Scale(keys) => local.scale = Vector3::from(keys.at(time)),
                Curve::Rotation(keys) => local.rotation = keys.at(time),
            }
        }
        Ok(pose)
    }

    /// Weights of `rest.len()` morph targets at a time, s; targets without a track have their weight in `rest`.
    ///
    /// # Errors
    /// [`CharacterError::Input`] if a track animates a target beyond those.
    pub fn weights(&self, rest: &[f64], time: f64, extrapolation: Extrapolation) -> Result<Vec<f64>, CharacterError> {
        self.check(usize::MAX, rest.len())?;
        let (time, mut weights) = (self.inside(time, extrapolation), rest.to_vec());
        for morph in &self.morphs {
            weights[morph.target as usize] = morph.keys.at(time)[0];
        }
        Ok(weights)
    }

    /// Maps a time into the span of the clip.
    fn inside(&self, time: f64, extrapolation: Extrapolation) -> f64 {
        match (self.span(), extrapolation) {
            (Some((first, last)), Extrapolation::Repeat) if last > first && !(first..=last).contains(&time) => {
                first + (time - first).rem_euclid(last - first)
            }
            _ => time,
        }
    }
}

/// A rotation curve through unit quaternions.
///
/// # Errors
/// Those of [`RotationKeys::new`].
pub fn rotations(
    times: impl Into<Arc<[f64]>>,
    rotations: &[UnitQuaternion<f64>],
    interpolation: Interpolation<4>,
) -> Result<RotationKeys, CharacterError> {
    RotationKeys::new(Keys::new(times, rotations.iter().map(|q| q.coords.into()).collect(), interpolation)?)
}
