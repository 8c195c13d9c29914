//! Errors of morphing.

use crate::mesh::{MeshError, TriMesh};
use plumbline_num::document::{DocumentError, VERSION};
use plumbline_num::run::Stopped;
use plumbline_num::sparse::SparseError;

/// An error of correspondence, interpolation or composition.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MorphError {
    /// Input: two poses of one mesh expected, but the numbers of vertices differ.
    #[error(
        "the meshes differ: {first} and {second} vertices; give landmarks (--landmarks) for a correspondence, or \
         take two poses of one mesh"
    )]
    VertexCounts {
        /// Number of vertices of the first mesh.
        first: usize,
        /// Number of vertices of the second mesh.
        second: usize,
    },
    /// Input: two poses of one mesh expected, but the triangles differ.
    #[error(
        "the meshes differ: triangle {triangle} joins {} in the first and {} in the second; give landmarks (--landmarks) for a \
         correspondence, or take two poses of one mesh",
        corners(.first.as_ref()), corners(.second.as_ref())
    )]
    Triangles {
        /// The first triangle that differs, from 0.
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
    /// Input: a mesh whose areas are beyond double precision when squared.
    #[error("the {which} mesh is {diagonal:.1e} units large; scale it to a size near 1")]
    Size {
        /// Which mesh.
        which: &'static str,
        /// Diagonal of its bounding box.
        diagonal: f64,
    },
    /// Input: a number outside its range.
    #[error("{what} is {value} (expected {expected})")]
    Value {
        /// The quantity.
        what: String,
        /// The value.
        value: String,
        /// The allowed values.
        expected: String,
    },
    /// Input: a vertex that does not exist.
    #[error(
        "{context}: the {which} mesh has no vertex {vertex} (expected 0 to {}, in the order of the file)",
        .vertices.saturating_sub(1)
    )]
    NoSuchVertex {
        /// The entry that refers to it.
        context: String,
        /// Which mesh.
        which: &'static str,
        /// The vertex.
        vertex: u64,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: too few landmarks, or collinear ones.
    #[error("{given} landmarks do not determine a similarity (expected at least {expected}, not all on one line)")]
    Landmarks {
        /// Number of landmarks.
        given: usize,
        /// Number needed.
        expected: usize,
    },
    /// Input: a surface of the wrong topology for the method.
    #[error("the {which} mesh {fault}; {advice}")]
    Topology {
        /// Which mesh.
        which: &'static str,
        /// The topology found.
        fault: String,
        /// The remedy.
        advice: &'static str,
    },
    /// Input: a correspondence so folded that the shapes between the meshes burst.
    #[error(
        "check of the bounding box: at time {time:.2} the shape is outside the box of both meshes by {excess:.2} of its diagonal \
         (at most 0.2): the first mesh is folded over the second; give more landmarks, or another correspondence (--over)"
    )]
    OutsideBox {
        /// Time of the shape, 0 to 1.
        time: f64,
        /// Distance outside the box, over its diagonal.
        excess: f64,
    },
    /// Input: a surface on which closest points cost too much.
    #[error(
        "closest points on the {which} mesh take more than {most} tests of triangles: its triangles lie along one another; \
         remove inner layers and triangles that overlap, or lay a smaller part over the other mesh"
    )]
    Layered {
        /// Which mesh.
        which: &'static str,
        /// Tests within reason for meshes of these sizes.
        most: usize,
    },
    /// Input: a seam that does not close or does not separate the surface.
    #[error("the seam of the {which} mesh {fault}")]
    Seam {
        /// Which mesh.
        which: &'static str,
        /// The fault, the value and the remedy.
        fault: String,
    },
    /// Input: a file of the wrong format.
    #[error("not {name}: {fault}")]
    Malformed {
        /// The expected kind of file.
        name: &'static str,
        /// The fault and its position.
        fault: String,
    },
    /// Input: an invalid mesh.
    #[error(transparent)]
    Mesh(MeshError),
    /// Numerics: a system that cannot be factored.
    #[error("the linear system of the surface cannot be solved: {0}")]
    Numerics(#[source] SparseError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

/// Refuses a mesh whose areas cannot be squared.
pub(super) fn check_size(mesh: &TriMesh, which: &'static str) -> Result<(), MorphError> {
    let diagonal = mesh.diagonal();
    // A mesh without extent is refused by name where its area counts.
    if diagonal == 0.0 || diagonal.powi(4).is_normal() {
        return Ok(());
    }
    Err(MorphError::Size { which, diagonal })
}

fn corners(triangle: Option<&[u32; 3]>) -> String {
    triangle.map_or_else(|| "no vertices".to_owned(), |[a, b, c]| format!("vertices {a}, {b}, {c}"))
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
            DocumentError::TooManyValues { name, bytes, length } => {
                (name, format!("{bytes} bytes in memory for the values of a text of {length} bytes are too many"))
            }
            DocumentError::Io { name, fault } => (name, format!("cannot be read: {fault}")),
        };
        Self::Malformed { name, fault }
    }
}
