//! Errors of surface deformation.

use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why a surface could not be deformed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// Input: a handle refers to a vertex that does not exist.
    #[error("a handle refers to vertex {vertex}, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The vertex.
        vertex: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: a vertex with two constraints.
    #[error("vertex {vertex} is constrained twice; list each vertex in one handle only")]
    ConstrainedTwice {
        /// The vertex.
        vertex: u32,
    },
    /// Input: no constraints.
    #[error("no vertex is constrained: give at least one that is fixed or moved")]
    NoHandle,
    /// Input: repair left nothing of the vertices of a handle.
    #[error(
        "handle {name:?}: none of its vertices is on the surface after repair; name vertices of triangles that have an area"
    )]
    HandleNotOnSurface {
        /// Name of the handle.
        name: String,
    },
    /// Input: repair joined vertices of two handles.
    #[error(
        "vertex {} of handle {:?} and vertex {} of handle {:?} are at the same position and were joined: put both into one handle",
        vertices[0], handles[0], vertices[1], handles[1]
    )]
    JoinedHandles {
        /// A vertex of each.
        vertices: [u32; 2],
        /// Their names.
        handles: [String; 2],
    },
    /// Input: a connected component has no handle, and the options reject that.
    #[error(
        "the connected component of {vertices} vertices that contains vertex {vertex} has no handle: constrain one of its vertices, or keep such components fixed"
    )]
    Unconstrained {
        /// Lowest vertex of the component.
        vertex: u32,
        /// Number of vertices of the component.
        vertices: usize,
    },
    /// Input: a soft constraint with a weight that is not positive.
    #[error("the weight {weight} of vertex {vertex} is invalid (expected a finite number above 0)")]
    Weight {
        /// The vertex.
        vertex: u32,
        /// Its weight.
        weight: f64,
    },
    /// Input: a pose for a different number of handles.
    #[error("{given} {what} for {handles} constrained vertices: give one for each")]
    Pose {
        /// The quantity.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number of constrained vertices.
        handles: usize,
    },
    /// Input: an initial guess or transforms for a mesh of another size.
    #[error("{given} {what} for a mesh of {vertices} vertices: give one for each")]
    PerVertex {
        /// The quantity.
        what: &'static str,
        /// Number given.
        given: usize,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: a target, rotation or initial guess that is not finite.
    #[error("the {what} of vertex {vertex} is not finite")]
    NotFinite {
        /// The quantity.
        what: &'static str,
        /// The vertex.
        vertex: u32,
    },
    /// Numerics: a solution that is not finite.
    #[error(
        "the solution is not finite at vertex {vertex}: squares of lengths of the mesh are beyond the range of double precision; scale \
         the mesh to a size near 1, or remesh what is smaller or larger than the rest by many orders of magnitude"
    )]
    Diverged {
        /// The vertex.
        vertex: usize,
    },
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Settings: a convergence criterion out of its range.
    #[error(transparent)]
    Convergence(EnergyError),
    /// Numerics: the factorization failed.
    #[error(transparent)]
    Solve(SparseError),
    /// Numerics: a system that is determined, and not in double precision.
    #[error(
        "the equations of the component of {vertices} vertices that contains vertex {vertex} have no safe solution: its triangles are too thin, \
         or of too different sizes, for double precision; repair or remesh it, or, where handles hold it too weakly, raise their weights"
    )]
    IllConditioned {
        /// A vertex of the component.
        vertex: usize,
        /// Number of vertices of the component that are unknown.
        vertices: usize,
        /// What the factorization met.
        #[source]
        reason: SparseError,
    },
    /// Input: a system too dense for this method, and what to do instead of remeshing.
    #[error("{reason}, or {instead}")]
    TooDense {
        /// [`SparseError::TooDense`].
        #[source]
        reason: SparseError,
        /// Another method that does not take as much.
        instead: &'static str,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl SurfaceError {
    /// The error of a factorization of a system in which each vertex has `per_vertex` unknowns, `vertex` that of the `k`-th. Components
    /// without a constraint are set aside before, so that what is singular is so by rounding.
    pub(super) fn of_factor(error: SparseError, per_vertex: usize, vertex: impl Fn(usize) -> usize) -> Self {
        let of = |unknown: usize| vertex(unknown / per_vertex);
        match error {
            SparseError::Singular { ref component } | SparseError::NotPositiveDefinite { ref component } => {
                let unknowns = &component.unknowns;
                let vertex = of(unknowns.first().copied().unwrap_or(0));
                Self::IllConditioned { vertex, vertices: unknowns.len().div_ceil(per_vertex), reason: error }
            }
            SparseError::TooDense { flops, most, unknown, neighbors } => Self::Solve(SparseError::TooDense {
                flops,
                most,
                unknown: of(unknown),
                neighbors: neighbors / per_vertex,
            }),
            other => other.into(),
        }
    }

    /// The same error; of a system that is too dense it names another method.
    pub(super) fn instead(self, instead: &'static str) -> Self {
        match self {
            Self::Solve(reason @ SparseError::TooDense { .. }) => Self::TooDense { reason, instead },
            other => other,
        }
    }
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
