//! What an edit can be refused for.

use crate::character::CharacterError;

/// Why a rig cannot be edited like this.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// Input: a joint that does not exist.
    #[error("there is no joint {joint}; there are {joints}, numbered from 0")]
    Unknown {
        /// The joint named.
        joint: u32,
        /// Joints there are.
        joints: usize,
    },
    /// Input: a place or an angle that is not finite.
    #[error("the {what} is not finite")]
    NotFinite {
        /// What it is.
        what: &'static str,
    },
    /// Input: a share of a bone beyond its ends.
    #[error("share {share} of the bone is invalid (expected more than 0, less than 1)")]
    Share {
        /// The share.
        share: f64,
    },
    /// Input: a joint without a bone of the kind that is asked for.
    #[error("joint {joint:?} {why}")]
    NoBone {
        /// Name of the joint.
        joint: String,
        /// What is missing.
        why: &'static str,
    },
    /// Input: a joint hung on itself, or on what hangs on it.
    #[error("joint {joint:?} cannot hang on {parent:?}, which hangs on it")]
    Cycle {
        /// Name of the joint.
        joint: String,
        /// Name of the parent that was asked for.
        parent: String,
    },
    /// Input: the only joint is taken away.
    #[error("the last joint cannot be taken away")]
    Last,
    /// Input: a frame that no translation, rotation and scale hold.
    #[error("joint {joint:?} would be sheared: the frames above it are scaled unevenly")]
    Shear {
        /// Name of the joint.
        joint: String,
    },
    /// Input: a name without a side.
    #[error(
        "joint {joint:?} and what hangs on it have no side in their names (such as .L, _left, Right…) that could be swapped"
    )]
    NoSide {
        /// Name of the joint.
        joint: String,
    },
    /// Input: what the joints are refused for.
    #[error(transparent)]
    Character(#[from] CharacterError),
}
