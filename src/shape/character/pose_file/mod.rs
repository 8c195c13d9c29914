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
//! Turns of joints are applied first, in their own frames and from `from` (rest where that is left out); then targets are sought
//! together, within the limits of the skeleton. Rotations are `[w, x, y, z]`; `turn_deg` is a rotation vector, degrees; places are
//! in the world, units of the model. Unknown keys and unknown joints are refused.

mod document;
mod error;
#[cfg(test)]
mod tests;

use std::path::Path;

use super::ik::{IkMethod, IkOptions, IkSolution, Target, solve};
use super::{Character, Outside, Pose};

#[cfg(feature = "schema")]
pub use document::pose_file_schema;
pub use error::PoseFileError;

use document::Document;
use plumbline_num::document::Kind;
use plumbline_num::run::Run;

/// At most as large as a hundred thousand joints.
const KIND: Kind = Kind { name: "a pose file", format: "plumbline.pose", max_bytes: 1 << 24 };

/// What a file wants of a character.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetPose {
    /// Where turns and targets begin.
    pub start: Pose,
    /// What is sought.
    pub targets: Vec<Target>,
    /// Joints that stay.
    pub locked: Vec<u32>,
    /// Weights of the morph targets.
    pub weights: Vec<f64>,
}

impl TargetPose {
    /// Reads a file for a character.
    ///
    /// # Errors
    /// What [`Self::parse`] refuses; [`PoseFileError::TooLarge`], [`PoseFileError::Io`].
    pub fn read(path: &Path, character: &Character) -> Result<Self, PoseFileError> {
        Self::parse(&KIND.text(path)?, character)
    }

    /// Reads a text for a character.
    ///
    /// # Errors
    /// [`PoseFileError`]: not JSON of this shape, another format or version, joints, clips or morph targets that the character
    /// does not have, numbers that are not finite.
    pub fn parse(text: &str, character: &Character) -> Result<Self, PoseFileError> {
        KIND.parse::<Document>(text)?.of(character)
    }

    /// The pose, within the limits of the skeleton.
    ///
    /// # Errors
    /// [`PoseFileError::Ik`], [`PoseFileError::Interrupted`].
    pub fn solve(
        &self,
        character: &Character,
        method: IkMethod,
        iterations: usize,
        run: &Run,
    ) -> Result<IkSolution, PoseFileError> {
        let options = IkOptions { method, iterations, locked: self.locked.clone(), ..IkOptions::default() };
        Ok(solve(&character.skeleton, &self.start, &self.targets, &options, run)?)
    }
}

/// The pose of a clip at a time.
fn pose_of(character: &Character, clip: &str, time: f64) -> Result<(Pose, Vec<f64>), PoseFileError> {
    let clip = character.clip(clip)?;
    let pose = clip.pose(&character.skeleton, time, Outside::Repeat)?;
    Ok((pose, clip.weights(&character.rest_weights(), time, Outside::Repeat)?))
}
