//! Errors of trained skin files.

use super::super::super::CharacterError;
use plumbline_num::document::DocumentError;
use plumbline_num::run::Stopped;

/// Why a trained skin was rejected.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelFileError {
    /// Input: above the size limit. Environment: reading failed.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: wrong magic bytes.
    #[error("not a trained skin (expected a file that `plumbline skin train` wrote)")]
    Foreign,
    /// Input: another version.
    #[error("version {found} of a trained skin is not supported (expected 2): train it again")]
    Version {
        /// Version of the file.
        found: u32,
    },
    /// Input: truncated.
    #[error("the file ends within {place}: at least {needed} bytes are missing; was it copied completely?")]
    Truncated {
        /// The incomplete item.
        place: String,
        /// Least number of missing bytes.
        needed: u64,
    },
    /// Input: trailing bytes.
    #[error("{bytes} bytes follow the end of the model; is this the right file?")]
    Trailing {
        /// Their number.
        bytes: usize,
    },
    /// Input: an invalid number.
    #[error("{place} is {value} (expected {expected})")]
    Value {
        /// Its meaning.
        place: String,
        /// Its value.
        value: String,
        /// Allowed values.
        expected: String,
    },
    /// Input: invalid weights or joints.
    #[error(transparent)]
    Character(CharacterError),
    /// Input: a mesh with other counts than the training mesh.
    #[error(
        "the model has {expected_vertices} vertices and {expected_triangles} triangles, the mesh has {vertices} and {triangles}; \
        give the rest mesh that it was trained on"
    )]
    Mesh {
        /// Vertices of the training mesh.
        expected_vertices: usize,
        /// Triangles of the training mesh.
        expected_triangles: usize,
        /// Vertices of the mesh.
        vertices: usize,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// Input: a mesh with other triangles than the training mesh.
    #[error(
        "the triangles of the mesh differ from those of the training mesh; give the rest mesh that the model was trained on"
    )]
    Connectivity,
    /// Input: another joint hierarchy.
    #[error(
        "the parent of joint {joint:?} is {expected} in the model and {found} in the skeleton; give the skeleton that it was trained with"
    )]
    Parent {
        /// The joint.
        joint: String,
        /// Its parent in the model.
        expected: String,
        /// Its parent in the skeleton.
        found: String,
    },
    /// The run was interrupted or exceeded its time budget.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<CharacterError> for ModelFileError {
    fn from(error: CharacterError) -> Self {
        match error {
            CharacterError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Character(error),
        }
    }
}
