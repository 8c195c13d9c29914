//! Errors of skeleton extraction.

use crate::character::CharacterError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why a skeleton could not be extracted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractionError {
    /// Input: zero surface area.
    #[error("mesh has zero surface area")]
    Empty,
    /// Usage: an option out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Usage: a vertex index to keep that is out of range.
    #[error("vertex {vertex} is to be kept, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The vertex index, from 0.
        vertex: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// More joints than a skeleton supports.
    #[error(transparent)]
    Skeleton(#[from] CharacterError),
    /// The observer or the run was interrupted, or the time budget was exceeded.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
    /// Numerics: a linear system of the contraction could not be solved.
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
