//! Errors of rig editing.

use crate::character::CharacterError;

/// Why an edit was rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EditError {
    /// Input: a joint index out of range.
    #[error("there is no joint {joint}; there are {joints}, numbered from 0")]
    Unknown {
        /// The joint index.
        joint: u32,
        /// Number of joints.
        joints: usize,
    },
    /// Input: a position or angle that is not finite.
    #[error("the {what} is not finite")]
    NotFinite {
        /// The quantity.
        what: &'static str,
    },
    /// Input: a fraction of a bone outside 0 to 1.
    #[error("fraction {fraction} of the bone is invalid (expected more than 0, less than 1)")]
    Fraction {
        /// The fraction.
        fraction: f64,
    },
    /// Input: a joint without the bone that the edit needs.
    #[error("joint {joint:?} {why}")]
    NoBone {
        /// Name of the joint.
        joint: String,
        /// What is missing.
        why: &'static str,
    },
    /// Input: the new parent is the joint itself or one of its descendants.
    #[error("joint {joint:?} cannot be a child of {parent:?}, its own descendant")]
    Cycle {
        /// Name of the joint.
        joint: String,
        /// Name of the new parent.
        parent: String,
    },
    /// Input: removal of the only joint.
    #[error("the last joint cannot be removed")]
    Last,
    /// Input: a frame that translation, rotation and scale cannot represent.
    #[error("joint {joint:?} would be sheared: the frames above it are scaled unevenly")]
    Shear {
        /// Name of the joint.
        joint: String,
    },
    /// Input: no joint name has a side.
    #[error(
        "joint {joint:?} and its descendants have no side in their names (such as .L, _left, Right…) that could be swapped"
    )]
    NoSide {
        /// Name of the joint.
        joint: String,
    },
    /// Input: invalid joints.
    #[error(transparent)]
    Character(#[from] CharacterError),
}
