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
//!   "pinned": ["foot.L", "foot.R"], "root": "pinned", "locked": ["spine"], "morphs": {"smile": 0.7} }
//! ```
//!
//! Joint rotations are applied first, in the joint frames and relative to `from` (default: rest); then the targets are solved together
//! within the joint limits. Pinned joints keep the world position and orientation that they have in `from`, whatever moves above them. The
//! root stays unless a target is on it; with `"root": "rotates"` the whole body follows targets. Rotations are `[w, x, y, z]`; `turn_deg` is a rotation vector, degrees; positions are world positions, units
//! of the model. Unknown keys and unknown joints are rejected.

mod document;
#[cfg(test)]
mod tests;
mod write;

use std::path::Path;

use nalgebra::Point3;

use super::ik::{Goal, IkMethod, IkOptions, IkSolution, RootMotion, Target, solve};
use super::{Character, CharacterError, Extrapolation, Pose, RigFileError, Skeleton};

#[cfg(feature = "schema")]
pub use document::pose_file_schema;

use document::Document;
use plumbline_num::document::Kind;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;

/// Size limit: a hundred thousand joints.
const KIND: Kind = Kind { name: "a pose file", format: "plumbline.pose", max_bytes: 1 << 24 };

/// Weight of pins relative to targets: where both cannot be met, a pin gives way by about a ten-thousandth of what the target misses.
const PIN_WEIGHT: f64 = 100.0;

/// The content of a pose file, resolved for a character.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TargetPose {
    /// The pose that the file begins from, in which joints are pinned.
    pub from: Pose,
    /// Initial guess: `from` with the joint transforms of the file.
    pub start: Pose,
    /// Inverse kinematics targets.
    pub targets: Vec<Target>,
    /// Joints that do not rotate.
    pub locked: Vec<u32>,
    /// Joints that keep a world frame: the joint, and its frame.
    pub pins: Vec<(u32, Trs)>,
    /// Motion of the root.
    pub root: RootMotion,
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

    /// Pins a joint: it keeps the world frame that it has in [`Self::from`].
    ///
    /// # Errors
    /// [`CharacterError::Input`] for another skeleton, or a joint that it does not have.
    pub fn pin(&mut self, skeleton: &Skeleton, joint: u32) -> Result<(), CharacterError> {
        let globals = skeleton.globals(&self.from)?;
        let frame = globals.get(joint as usize);
        let frame = frame.ok_or_else(|| CharacterError::Input(format!("there is no joint {joint}")))?;
        if !self.pins.iter().any(|(other, _)| *other == joint) {
            self.pins.push((joint, Trs::from_matrix(frame)));
        }
        Ok(())
    }

    /// The targets, followed by a position and an orientation for each pin.
    pub fn all_targets(&self) -> Vec<Target> {
        let pin = |(joint, frame): &(u32, Trs)| {
            let goals = [
                Goal::Position { point: Point3::origin(), at: frame.translation.into() },
                Goal::Orientation(frame.rotation),
            ];
            goals.map(|goal| Target { joint: *joint, goal, weight: PIN_WEIGHT, chain: None })
        };
        self.targets.iter().cloned().chain(self.pins.iter().flat_map(pin)).collect()
    }

    /// Solves for the targets and pins, within the joint limits. Residuals are those of [`Self::all_targets`].
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
        let (locked, root) = (self.locked.clone(), self.root);
        let options = IkOptions { method, iterations, locked, root, ..IkOptions::default() };
        solve(&character.skeleton, &self.start, &self.all_targets(), &options, run)
    }
}

/// The pose of a clip at a time.
fn pose_of(character: &Character, clip: &str, time: f64) -> Result<(Pose, Vec<f64>), CharacterError> {
    let clip = character.clip(clip)?;
    let pose = clip.pose(&character.skeleton, time, Extrapolation::Repeat)?;
    Ok((pose, clip.weights(&character.rest_weights(), time, Extrapolation::Repeat)?))
}
