//! What a deformation can be refused for.

use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why a surface could not be deformed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// Input: a handle names a vertex that does not exist.
    #[error("a handle names vertex {vertex}, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The vertex named.
        vertex: u32,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// Input: a vertex that is held twice.
    #[error("vertex {vertex} is held twice; name each vertex in one handle only")]
    HeldTwice {
        /// The vertex.
        vertex: u32,
    },
    /// Input: nothing is held.
    #[error("no vertex is held: name at least one that stays or moves")]
    NoHandle,
    /// Input: a part of the surface is held by nothing, and the options refuse that.
    #[error(
        "nothing holds the part of {vertices} vertices that contains vertex {vertex}: hold one of them or let it stay where it is"
    )]
    Unheld {
        /// Lowest vertex of the part.
        vertex: u32,
        /// Vertices of the part.
        vertices: usize,
    },
    /// Input: a weight of a soft handle that is not positive.
    #[error("the weight {weight} of vertex {vertex} is invalid (expected a finite number above 0)")]
    Weight {
        /// The vertex.
        vertex: u32,
        /// Its weight.
        weight: f64,
    },
    /// Input: a pose for another number of handles.
    #[error("{given} {what} do not pose {handles} held vertices: give one for each")]
    Pose {
        /// What was counted.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// Vertices that are held.
        handles: usize,
    },
    /// Input: a start or transforms for another mesh.
    #[error("{given} {what} do not fit a mesh of {vertices} vertices: give one for each")]
    PerVertex {
        /// What was counted.
        what: &'static str,
        /// How many were given.
        given: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// Input: a target, rotation or start that is not finite.
    #[error("the {what} of vertex {vertex} is not finite")]
    NotFinite {
        /// What is not finite.
        what: &'static str,
        /// The vertex.
        vertex: u32,
    },
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Settings: a criterion of convergence that cannot be met.
    #[error(transparent)]
    Convergence(EnergyError),
    /// Numerics: the system of the method could not be factored.
    #[error(transparent)]
    Solve(SparseError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<EnergyError> for SurfaceError {
    fn from(error: EnergyError) -> Self {
        match error {
            EnergyError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Convergence(error),
        }
    }
}

impl From<SparseError> for SurfaceError {
    fn from(error: SparseError) -> Self {
        match error {
            SparseError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Solve(error),
        }
    }
}
