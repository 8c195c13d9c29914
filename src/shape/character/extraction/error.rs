//! Why a skeleton could not be extracted.

use crate::character::CharacterError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why a skeleton could not be extracted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractionError {
    /// Input: no triangle with an area.
    #[error("the mesh has no triangle with an area: there is nothing to find the middle of")]
    Empty,
    /// Usage: an option outside its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Usage: a vertex to keep that does not exist.
    #[error("vertex {vertex} is to be kept, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The vertex, numbered from 0.
        vertex: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// The curve gives no skeleton: more joints than a skeleton holds.
    #[error(transparent)]
    Skeleton(#[from] CharacterError),
    /// The observer asked to stop, the run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
    /// Numerics: a system of the contraction could not be solved.
    #[error("the contraction could not be solved: {0}")]
    Numerics(SparseError),
}

impl ExtractionError {
    pub(super) fn from_sparse(error: SparseError) -> Self {
        match error {
            SparseError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Numerics(error),
        }
    }
}
