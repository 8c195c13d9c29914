//! Errors of pose files.

use crate::character::ik::IkError;
use crate::character::{CharacterError, ClipError};
use plumbline_num::document::DocumentError;
use plumbline_num::run::Stopped;

/// Why a pose file was rejected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileError {
    /// Input: not a readable document of this format (`plumbline schema pose` describes it).
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: an incomplete, ambiguous or invalid entry.
    #[error("{what}: {fault}")]
    Entry {
        /// The joint, morph target or target.
        what: String,
        /// The fault and its remedy.
        fault: String,
    },
    /// Input: joints or clips that the character does not have.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// Input: a clip of another skeleton.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// Input: invalid targets.
    #[error(transparent)]
    Ik(IkError),
    /// The run was interrupted or exceeded its time budget.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<IkError> for PoseFileError {
    fn from(error: IkError) -> Self {
        match error {
            IkError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Ik(error),
        }
    }
}
