//! Why a skeleton file was refused.

use super::super::CharacterError;
use plumbline_num::document::DocumentError;

/// A skeleton file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SkeletonFileError {
    /// Input: no such document, or one that cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
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
}
