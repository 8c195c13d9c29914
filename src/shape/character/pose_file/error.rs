//! What a pose file can be refused for.

use crate::character::ik::IkError;
use crate::character::{CharacterError, ClipError};
use plumbline_num::document::{DocumentError, VERSION};
use plumbline_num::run::Stopped;

/// Why a pose file could not be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PoseFileError {
    /// Input: not JSON of the shape of pose files.
    #[error("not a pose file: {0} (`plumbline schema pose` describes it)")]
    Syntax(serde_json::Error),
    /// Input: a file of something else.
    #[error("the file is of format {found:?}, where {expected:?} is expected")]
    Format {
        /// What it says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// Input: a file of another version.
    #[error("version {found} is not read here (expected {expected})")]
    Version {
        /// What it says.
        found: u64,
        /// What is read.
        expected: u32,
    },
    /// Input: a joint or a target that says too little, or too much.
    #[error("{what}: {fault}")]
    Entry {
        /// Which.
        what: String,
        /// What is wrong, and what to do.
        fault: String,
    },
    /// Input: joints or clips that the character does not have.
    #[error(transparent)]
    Character(#[from] CharacterError),
    /// Input: a clip that cannot be used.
    #[error(transparent)]
    Clip(#[from] ClipError),
    /// Input: targets that cannot be sought.
    #[error(transparent)]
    Ik(IkError),
    /// Input: a file beyond the limit.
    #[error("{bytes} bytes are too many (at most {most})")]
    TooLarge {
        /// Bytes of the file.
        bytes: u64,
        /// The most there may be.
        most: u64,
    },
    /// Environment: the file cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The run was interrupted, or its time is used up.
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

impl From<DocumentError> for PoseFileError {
    fn from(error: DocumentError) -> Self {
        match error {
            DocumentError::Syntax { fault, .. } => Self::Syntax(fault),
            DocumentError::Format { found, expected, .. } => Self::Format { found, expected },
            DocumentError::Version { found, .. } => Self::Version { found, expected: VERSION },
            DocumentError::TooLarge { bytes, most, .. } => Self::TooLarge { bytes, most },
            DocumentError::Io { fault, .. } => Self::Io(fault),
        }
    }
}
