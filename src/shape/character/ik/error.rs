//! What a target can be refused for.

use crate::character::CharacterError;
use plumbline_num::run::Stopped;

/// Why targets cannot be sought.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IkError {
    /// Input: a joint that does not exist.
    #[error("target {target} names joint {joint}, but there are {joints}, numbered from 0")]
    Unknown {
        /// The target, numbered from 0.
        target: usize,
        /// The joint named.
        joint: u32,
        /// Joints there are.
        joints: usize,
    },
    /// Input: a place or a turn with a number that is not finite.
    #[error("target {target} is not finite")]
    NotFinite {
        /// The target, numbered from 0.
        target: usize,
    },
    /// Input: a weight that is not above 0.
    #[error("the weight {weight} of target {target} is invalid (expected more than 0, finite)")]
    Weight {
        /// The target, numbered from 0.
        target: usize,
        /// Its weight.
        weight: f64,
    },
    /// Input: joints of a pole that are not above each other.
    #[error("the joints of target {target} are no chain: each must lie above the next (root, middle, tip)")]
    Chain {
        /// The target, numbered from 0.
        target: usize,
    },
    /// Settings: a target that the chosen algorithm cannot seek.
    #[error("target {target} is not for the method {method}: {problem}; the method least-squares takes it")]
    Method {
        /// The target, numbered from 0.
        target: usize,
        /// Name of the method.
        method: &'static str,
        /// Why not.
        problem: &'static str,
    },
    /// Input: what the pose is refused for.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
