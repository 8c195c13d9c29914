//! Errors of skeleton files.

use super::super::CharacterError;
use plumbline_num::document::DocumentError;

/// Why a skeleton file was rejected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonFileError {
    /// Input: not a readable document of this format.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: an invalid value.
    #[error("{place}: {field} is {value} (expected {expected})")]
    Value {
        /// The joint, or the curve.
        place: String,
        /// The field.
        field: &'static str,
        /// The value.
        value: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// Input: invalid joints.
    #[error(transparent)]
    Skeleton(#[from] CharacterError),
}
