//! Why a skeleton file was refused.

use std::io;

use super::super::CharacterError;

/// A skeleton file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonFileError {
    /// Input: not JSON of the expected shape; the message ends with line and column.
    #[error("not a file of a skeleton: {0}")]
    Syntax(#[source] serde_json::Error),
    /// Input: some other JSON.
    #[error("format {found:?} is not a file of a skeleton (expected {expected:?})")]
    Format {
        /// What `format` says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// Input: made by a program of another version.
    #[error("version {found} of a file of a skeleton is not supported (expected 1)")]
    Version {
        /// What `version` says.
        found: u64,
    },
    /// Input: a value that it cannot have.
    #[error("{place}: {field} is {value} (expected {expected})")]
    Value {
        /// The joint, or the curve.
        place: String,
        /// The field.
        field: &'static str,
        /// What stands there.
        value: String,
        /// What may stand there.
        expected: &'static str,
    },
    /// Input: joints that are no skeleton.
    #[error(transparent)]
    Skeleton(#[from] CharacterError),
    /// Input: larger than any file of a skeleton.
    #[error("{bytes} bytes are too many for a file of a skeleton (at most {most}): is this the right file?")]
    TooLarge {
        /// Its size.
        bytes: u64,
        /// The largest that is read.
        most: u64,
    },
    /// Environment: reading failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}
