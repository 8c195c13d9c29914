//! Movement: keys of joints over time, and poses between them.
//!
//! ```text
//! vectors      step · a + u (b − a) · cubic Hermite · smooth: Hermite with the velocities below
//! rotations    step · a (a⁻¹ b)ᵘ (slerp, the short way) · normalized Hermite (glTF) · smooth: cumulative cubic
//! velocity     vₖ = (hₖ dₖ₋₁ + hₖ₋₁ dₖ) / (hₖ₋₁ + hₖ)     d differences per time (of rotations: log of the turn), h steps
//! ```
//!
//! A smooth curve passes through its keys with one velocity on both sides of each, however far apart they are; movement at a
//! constant rate is reproduced.
//!
//! # Reference
//! M.-J. Kim, M.-S. Kim, S. Y. Shin, *A General Construction Scheme for Unit Quaternion Curves with Simple High Order
//! Derivatives*, SIGGRAPH 1995, §4 (Hermite quaternion curve). Khronos Group, *glTF 2.0*, appendix C (interpolation).

mod error;
mod keys;
mod retiming;
mod rotation;
#[cfg(test)]
mod tests;

use nalgebra::{UnitQuaternion, Vector3};

use super::{Pose, Skeleton};

pub use error::ClipError;
pub use keys::{Between, Keys};
pub use rotation::RotationKeys;

/// How one property of a joint changes.
#[derive(Clone, Debug, PartialEq)]
pub enum Curve {
    /// Where it is in its parent, units of the model.
    Translation(Keys<3>),
    /// How it is turned in its parent.
    Rotation(RotationKeys),
    /// Factors along its axes.
    Scale(Keys<3>),
}

impl Curve {
    /// Times of its keys, s.
    pub fn times(&self) -> &[f64] {
        match self {
            Self::Translation(keys) | Self::Scale(keys) => keys.times(),
            Self::Rotation(keys) => keys.keys().times(),
        }
    }

    /// What it moves, so that two curves of one joint can be told apart.
    fn property(&self) -> &'static str {
        match self {
            Self::Translation(_) => "translation",
            Self::Rotation(_) => "rotation",
            Self::Scale(_) => "scale",
        }
    }
}

/// A curve of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// The joint.
    pub joint: u32,
    /// How it moves.
    pub curve: Curve,
}

/// How much of a morph target there is, over time.
#[derive(Clone, Debug, PartialEq)]
pub struct MorphTrack {
    /// The morph target.
    pub target: u32,
    /// Its weight.
    pub keys: Keys<1>,
}

/// A movement of a skeleton and of morph targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    name: String,
    tracks: Vec<Track>,
    morphs: Vec<MorphTrack>,
}

/// What comes before the first key and after the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Outside {
    /// The nearest key.
    #[default]
    Hold,
    /// The movement again.
    Repeat,
}

impl Clip {
    /// A movement.
    ///
    /// # Errors
    /// [`ClipError::TwiceMoved`] where two tracks move the same.
    pub fn new(name: impl Into<String>, tracks: Vec<Track>, morphs: Vec<MorphTrack>) -> Result<Self, ClipError> {
        let (name, mut seen) = (name.into(), std::collections::HashSet::new());
        for track in &tracks {
            if !seen.insert((track.joint, track.curve.property())) {
                let (what, number) = (track.curve.property(), track.joint);
                return Err(ClipError::TwiceMoved { clip: name, what, number });
            }
        }
        for morph in &morphs {
            if !seen.insert((morph.target, "weight")) {
                return Err(ClipError::TwiceMoved { clip: name, what: "weight of morph target", number: morph.target });
            }
        }
        Ok(Self { name, tracks, morphs })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The same movement under another name.
    #[must_use]
    pub fn named(mut self, name: impl Into<String>) -> Self {
        self.name = name.into();
        self
    }

    /// Curves of joints.
    pub fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Curves of morph targets.
    pub fn morphs(&self) -> &[MorphTrack] {
        &self.morphs
    }

    /// Times of the first key and of the last, s; none without a key.
    pub fn span(&self) -> Option<(f64, f64)> {
        let of_joints = self.tracks.iter().map(|t| t.curve.times());
        let times = of_joints.chain(self.morphs.iter().map(|m| m.keys.times()));
        times.map(|t| (t[0], t[t.len() - 1])).reduce(|(a, b), (c, d)| (a.min(c), b.max(d)))
    }

    /// Every joint and morph target that is moved exists.
    ///
    /// # Errors
    /// [`ClipError::Unknown`].
    pub fn check(&self, joints: usize, targets: usize) -> Result<(), ClipError> {
        let unknown = |what, number, there| Err(ClipError::Unknown { clip: self.name.clone(), what, number, there });
        if let Some(track) = self.tracks.iter().find(|t| t.joint as usize >= joints) {
            return unknown("joint", track.joint, joints);
        }
        if let Some(morph) = self.morphs.iter().find(|m| m.target as usize >= targets) {
            return unknown("morph target", morph.target, targets);
        }
        Ok(())
    }

    /// The pose at a time: what no track moves is at rest.
    ///
    /// # Errors
    /// [`ClipError::Unknown`] for a skeleton with fewer joints than are moved.
    pub fn pose(&self, skeleton: &Skeleton, time: f64, outside: Outside) -> Result<Pose, ClipError> {
        self.check(skeleton.joint_count(), usize::MAX)?;
        let (time, mut pose) = (self.inside(time, outside), skeleton.rest_pose());
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

    /// Weights of `rest.len()` morph targets at a time; what no track moves is as in `rest`.
    ///
    /// # Errors
    /// [`ClipError::Unknown`] where a track moves a target beyond those.
    pub fn weights(&self, rest: &[f64], time: f64, outside: Outside) -> Result<Vec<f64>, ClipError> {
        self.check(usize::MAX, rest.len())?;
        let (time, mut weights) = (self.inside(time, outside), rest.to_vec());
        for morph in &self.morphs {
            weights[morph.target as usize] = morph.keys.at(time)[0];
        }
        Ok(weights)
    }

    /// A time of the movement that shows what is seen at `time`.
    fn inside(&self, time: f64, outside: Outside) -> f64 {
        match (self.span(), outside) {
            (Some((first, last)), Outside::Repeat) if last > first && !(first..=last).contains(&time) => {
                first + (time - first).rem_euclid(last - first)
            }
            _ => time,
        }
    }
}

/// Keys of a rotation, as a curve through them.
///
/// # Errors
/// Those of [`RotationKeys::new`].
pub fn rotations(
    times: Vec<f64>,
    turns: &[UnitQuaternion<f64>],
    between: Between<4>,
) -> Result<RotationKeys, ClipError> {
    RotationKeys::new(Keys::new(times, turns.iter().map(|q| q.coords.into()).collect(), between)?)
}
