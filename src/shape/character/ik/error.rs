//! Errors of inverse kinematics.

use crate::character::CharacterError;
use plumbline_num::run::Stopped;

/// Why inverse kinematics failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IkError {
    /// Input: a joint index out of range.
    #[error("target {target} names joint {joint}, but there are {joints}, numbered from 0")]
    Unknown {
        /// The target, from 0.
        target: usize,
        /// The joint index.
        joint: u32,
        /// Number of joints.
        joints: usize,
    },
    /// Input: a position or rotation that is not finite.
    #[error("target {target} is not finite")]
    NotFinite {
        /// The target, from 0.
        target: usize,
    },
    /// Input: a weight that is not positive.
    #[error("the weight {weight} of target {target} is invalid (expected more than 0, finite)")]
    Weight {
        /// The target, from 0.
        target: usize,
        /// Its weight.
        weight: f64,
    },
    /// Input: joints of a pole target that do not form a chain.
    #[error("the joints of target {target} are not a chain: each must be an ancestor of the next (root, middle, tip)")]
    Chain {
        /// The target, from 0.
        target: usize,
    },
    /// Settings: a target that the chosen method does not support.
    #[error("target {target} is not for the method {method}: {problem}; the method least-squares takes it")]
    Method {
        /// The target, numbered from 0.
        target: usize,
        /// Name of the method.
        method: &'static str,
        /// The reason.
        problem: &'static str,
    },
    /// Input: an invalid pose.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// The run was interrupted or exceeded its time budget.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
