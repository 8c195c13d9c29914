//! What a morph can be refused for.

use crate::mesh::MeshError;
use plumbline_num::document::{DocumentError, VERSION};
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// Why shapes could not be joined, or what lies between them not found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MorphError {
    /// Input: two meshes of which one should be the other in another pose differ in their numbers of vertices.
    #[error(
        "the meshes differ: {first} and {second} vertices; give landmarks (--landmarks) so that one can be laid over the other, or \
         take two poses of one mesh"
    )]
    VertexCounts {
        /// Vertices of the first.
        first: usize,
        /// Vertices of the second.
        second: usize,
    },
    /// Input: as many vertices, but other triangles.
    #[error(
        "the meshes differ: triangle {triangle} joins {} in the first and {} in the second; give landmarks (--landmarks) so that \
         one can be laid over the other, or take two poses of one mesh",
        corners(.first.as_ref()), corners(.second.as_ref())
    )]
    Triangles {
        /// The first triangle that differs, numbered from 0.
        triangle: usize,
        /// Its corners in the first mesh, if it has that many triangles.
        first: Option<[u32; 3]>,
        /// Its corners in the second.
        second: Option<[u32; 3]>,
    },
    /// Input: a mesh without triangles.
    #[error("the {which} mesh has no triangle of positive area")]
    Empty {
        /// Which mesh.
        which: &'static str,
    },
    /// Input: a number outside its range.
    #[error("{what} is {value} (expected {expected})")]
    Value {
        /// What has the value.
        what: String,
        /// The value.
        value: String,
        /// What may stand there.
        expected: String,
    },
    /// Input: a vertex that a mesh does not have.
    #[error(
        "{place}: the {which} mesh has no vertex {vertex} (expected 0 to {}, in the order of the file)",
        .vertices.saturating_sub(1)
    )]
    NoSuchVertex {
        /// Where it is named.
        place: String,
        /// Which mesh.
        which: &'static str,
        /// The vertex.
        vertex: u64,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: too few landmarks, or landmarks on one line.
    #[error(
        "{given} landmarks do not fix how the meshes lie to each other (expected at least {expected}, not all on one line)"
    )]
    Landmarks {
        /// How many there are.
        given: usize,
        /// How many are needed.
        expected: usize,
    },
    /// Input: a surface that is not of the kind a method needs.
    #[error("the {which} mesh {fault}; {advice}")]
    Topology {
        /// Which mesh.
        which: &'static str,
        /// What it is.
        fault: String,
        /// What to do.
        advice: &'static str,
    },
    /// Input: a seam that does not cut, or does not close.
    #[error("the seam of the {which} mesh {fault}")]
    Seam {
        /// Which mesh.
        which: &'static str,
        /// What is wrong, the value, and what to do.
        fault: String,
    },
    /// Input: a file that is not what its format asks for.
    #[error("not {name}: {fault}")]
    Malformed {
        /// What the file should be.
        name: &'static str,
        /// What is wrong with it, and where.
        fault: String,
    },
    /// Input: a mesh that cannot be used.
    #[error(transparent)]
    Mesh(MeshError),
    /// Numerics: a system that cannot be solved.
    #[error("the surface cannot be solved for: {0}")]
    Numerics(SparseError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

fn corners(triangle: Option<&[u32; 3]>) -> String {
    triangle.map_or_else(|| "nothing".to_owned(), |[a, b, c]| format!("vertices {a}, {b}, {c}"))
}

impl From<MeshError> for MorphError {
    fn from(error: MeshError) -> Self {
        match error {
            MeshError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Mesh(error),
        }
    }
}

impl From<SparseError> for MorphError {
    fn from(error: SparseError) -> Self {
        match error {
            SparseError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Numerics(error),
        }
    }
}

impl From<DocumentError> for MorphError {
    fn from(error: DocumentError) -> Self {
        let (name, fault) = match error {
            DocumentError::Syntax { name, fault } => (name, fault.to_string()),
            DocumentError::Format { name, found, expected } => {
                (name, format!("the format is {found:?} (expected {expected:?})"))
            }
            DocumentError::Version { name, found } => {
                (name, format!("version {found} is not supported (expected {VERSION})"))
            }
            DocumentError::TooLarge { name, bytes, most } => {
                (name, format!("{bytes} bytes are too many (at most {most})"))
            }
            DocumentError::Io { name, fault } => (name, format!("cannot be read: {fault}")),
        };
        Self::Malformed { name, fault }
    }
}
