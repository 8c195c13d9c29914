//! Pose files:
//!
//! ```json
//! { "format": "plumbline.pose", "version": 1,
//!   "from": {"clip": "walk", "time": 0.4},
//!   "joints": { "spine": {"turn_deg": [0, 15, 0]}, "head": {"rotation": [1, 0, 0, 0]}, "hip": {"move": [0, 0.1, 0]} },
//!   "targets": [ {"joint": "hand.L", "position": [0.4, 1.2, 0.3], "chain": 3},
//!                {"joint": "head", "look_at": [0, 1.6, 5], "axis": [0, 0, 1]},
//!                {"joint": "foot.L", "orientation": [1, 0, 0, 0]},
//!                {"joint": "hand.L", "pole": [0.5, 1, -2], "root": "arm.L", "middle": "elbow.L"} ],
//!   "locked": ["hip"], "morphs": {"smile": 0.7} }
//! ```
//!
//! Joint rotations are applied first, in the joint frames and relative to `from` (default: rest); then the targets are solved together
//! within the joint limits. Rotations are `[w, x, y, z]`; `turn_deg` is a rotation vector, degrees; positions are world positions, units
//! of the model. Unknown keys and unknown joints are rejected.

mod document;
#[cfg(test)]
mod tests;
mod write;

use std::path::Path;

use super::ik::{IkMethod, IkOptions, IkSolution, Target, solve};
use super::{Character, CharacterError, Extrapolation, Pose, RigFileError};

#[cfg(feature = "schema")]
pub use document::pose_file_schema;

use document::Document;
use plumbline_num::document::Kind;
use plumbline_num::run::Run;

/// Size limit: a hundred thousand joints.
const KIND: Kind = Kind { name: "a pose file", format: "plumbline.pose", max_bytes: 1 << 24 };

/// The content of a pose file, resolved for a character.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetPose {
    /// Initial guess: the joint transforms of the file.
    pub start: Pose,
    /// Inverse kinematics targets.
    pub targets: Vec<Target>,
    /// Joints that do not rotate.
    pub locked: Vec<u32>,
    /// Morph weights.
    pub weights: Vec<f64>,
}

impl TargetPose {
    /// Reads a file for a character.
    ///
    /// # Errors
    /// [`RigFileError::Document`] and all errors of [`Self::parse`].
    pub fn read(path: &Path, character: &Character) -> Result<Self, RigFileError> {
        Self::parse(&KIND.text(path)?, character)
    }

    /// Parses a document for a character.
    ///
    /// # Errors
    /// [`RigFileError`]: not this format or version; joints, clips or morph targets that the character does not have; non-finite numbers.
    pub fn parse(text: &str, character: &Character) -> Result<Self, RigFileError> {
        KIND.parse::<Document>(text)?.of(character)
    }

    /// Solves for the targets, within the joint limits.
    ///
    /// # Errors
    /// As for [`solve`].
    pub fn solve(
        &self,
        character: &Character,
        method: IkMethod,
        iterations: usize,
        run: &Run,
    ) -> Result<IkSolution, CharacterError> {
        let options = IkOptions { method, iterations, locked: self.locked.clone(), ..IkOptions::default() };
        solve(&character.skeleton, &self.start, &self.targets, &options, run)
    }
}

/// The pose of a clip at a time.
fn pose_of(character: &Character, clip: &str, time: f64) -> Result<(Pose, Vec<f64>), CharacterError> {
    let clip = character.clip(clip)?;
    let pose = clip.pose(&character.skeleton, time, Extrapolation::Repeat)?;
    Ok((pose, clip.weights(&character.rest_weights(), time, Extrapolation::Repeat)?))
}
