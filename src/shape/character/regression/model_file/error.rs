//! What a model file can be refused for.

use super::super::super::CharacterError;
use plumbline_num::document::DocumentError;
use plumbline_num::run::Stopped;

/// A trained model that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ModelFileError {
    /// Input: larger than any model. Environment: reading failed.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: other bytes.
    #[error("not a trained skin (expected a file that `plumbline skin train` wrote)")]
    Foreign,
    /// Input: made by a program of another version.
    #[error("version {found} of a trained skin is not supported (expected 2): train it anew")]
    Version {
        /// What the file says.
        found: u32,
    },
    /// Input: the file ends before what it announces.
    #[error("the file ends within {place}: {needed} bytes are missing or more; was it copied whole?")]
    Truncated {
        /// Where.
        place: String,
        /// Bytes that are missing at least.
        needed: u64,
    },
    /// Input: the file goes on after its end.
    #[error("{bytes} bytes follow the end of the model; is this the right file?")]
    Trailing {
        /// How many.
        bytes: usize,
    },
    /// Input: a number that is none, or of something that is not there.
    #[error("{place} is {value} (expected {expected})")]
    Value {
        /// Which number.
        place: String,
        /// Its value.
        value: String,
        /// What it may be.
        expected: String,
    },
    /// Input: weights or joints that are none.
    #[error(transparent)]
    Character(CharacterError),
    /// Input: another mesh than the model was trained on.
    #[error(
        "the model is of {expected_vertices} vertices and {expected_triangles} triangles, the mesh has {vertices} and {triangles}; \
         give the mesh at rest that it was trained on"
    )]
    Mesh {
        /// Vertices that it was trained on.
        expected_vertices: usize,
        /// Triangles that it was trained on.
        expected_triangles: usize,
        /// Vertices of the mesh.
        vertices: usize,
        /// Triangles of the mesh.
        triangles: usize,
    },
    /// Input: a mesh of as many, differently joined.
    #[error(
        "the triangles of the mesh are not those that the model was trained on; give the mesh at rest that it was trained on"
    )]
    Connectivity,
    /// Input: joints that hang together in another way.
    #[error(
        "joint {joint:?} hangs on {expected} in the model, on {found} in the skeleton; give the skeleton that it was trained with"
    )]
    Parent {
        /// The joint.
        joint: String,
        /// Its parent in the model.
        expected: String,
        /// Its parent in the skeleton.
        found: String,
    },
    /// The run was interrupted, or its time is used up.
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
