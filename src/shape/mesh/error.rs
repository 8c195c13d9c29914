//! Errors of meshes and mesh files.

use std::fmt;

use super::io::MeshFormat;
use plumbline_num::run::Stopped;

/// Why a mesh could not be made, read or written.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Input: a triangle names a vertex that does not exist.
    #[error("triangle {triangle} names vertex {vertex}, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The triangle, numbered from 0.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: a NaN or infinite coordinate.
    #[error("vertex {vertex} (numbered from 0) has a coordinate that is not finite: ({x}, {y}, {z})")]
    NotFinite {
        /// The vertex, numbered from 0.
        vertex: usize,
        /// First coordinate.
        x: f64,
        /// Second coordinate.
        y: f64,
        /// Third coordinate.
        z: f64,
    },
    /// Input: more vertices than an index can name.
    #[error("the mesh has {vertices} vertices, more than the {} that can be numbered", u32::MAX)]
    TooManyVertices {
        /// Number of vertices.
        vertices: usize,
    },
    /// Input: three or more triangles share an edge, or two traverse it in the same direction.
    #[error(
        "vertices {from} and {to} are joined by {triangles} triangles of which {along} run from the first to the second; an \
         oriented manifold has at most one each way: repair the mesh first (`mesh::repair`, `plumbline mesh repair`)"
    )]
    NonManifoldEdge {
        /// One end.
        from: u32,
        /// The other end.
        to: u32,
        /// Triangles at the edge.
        triangles: usize,
        /// Those that run along it from the first end to the second.
        along: usize,
    },
    /// Input: the triangles around a vertex form several fans.
    #[error(
        "the triangles around vertex {vertex} form {fans} separate fans; repair the mesh first (`mesh::repair`, `plumbline mesh \
         repair`)"
    )]
    NonManifoldVertex {
        /// The vertex, numbered from 0.
        vertex: u32,
        /// Number of fans.
        fans: usize,
    },
    /// Input: a triangle that names a vertex twice.
    #[error(
        "triangle {triangle} names a vertex twice; repair the mesh first (`mesh::repair`, `plumbline mesh repair`)"
    )]
    RepeatedCorner {
        /// The triangle, numbered from 0.
        triangle: usize,
    },
    /// Input: nodes, skins, morph targets or animations that do not fit the mesh or each other.
    #[error("how the model moves is not consistent: {fault}")]
    Articulation {
        /// What does not fit.
        fault: String,
    },
    /// Input: a file that is not what its format asks for.
    #[error("{format}, {at}: {fault}")]
    Malformed {
        /// Format as which it was read.
        format: MeshFormat,
        /// Where in the file.
        at: Position,
        /// What is wrong, the value, and what to do.
        fault: String,
    },
    /// Input: a file of no known format.
    #[error("not a mesh that is read here ({seen}); OBJ, PLY, OFF, STL, glTF, GLB and Medit .mesh are")]
    UnknownFormat {
        /// Its first bytes, or its name.
        seen: String,
    },
    /// Input, or the limit: larger than allowed.
    #[error("{what} of {value} is more than the limit of {limit}; raise the limit if the file is to be trusted")]
    TooLarge {
        /// What was counted.
        what: &'static str,
        /// Its value.
        value: u64,
        /// The limit.
        limit: u64,
    },
    /// Environment: the file cannot be read.
    #[error("cannot be read: {reason}")]
    Unreadable {
        /// System error.
        reason: String,
    },
    /// Environment: the file cannot be written.
    #[error("cannot be written: {reason}")]
    Unwritable {
        /// System error.
        reason: String,
    },
    /// One of the other faults, in this file.
    #[error("{path}: {fault}")]
    InFile {
        /// The file.
        path: String,
        /// What is wrong with it.
        fault: Box<MeshError>,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl MeshError {
    /// The same fault, of this file.
    pub(super) fn of_file(self, path: &std::path::Path) -> Self {
        // That a run ended is no fault of the file.
        if let Self::Interrupted(_) = self {
            return self;
        }
        Self::InFile { path: path.display().to_string(), fault: Box::new(self) }
    }

    /// The output is at fault, not the input.
    pub fn is_output(&self) -> bool {
        match self {
            Self::Unwritable { .. } => true,
            Self::InFile { fault, .. } => fault.is_output(),
            _ => false,
        }
    }
}

/// A position in a mesh file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Position {
    /// Line of a text file, counted from 1.
    Line(usize),
    /// Byte of a binary file, counted from 0.
    Byte(usize),
    /// Value of a JSON document, such as `/accessors/3/count`.
    Json(String),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Json(pointer) => write!(f, "value {pointer}"),
        }
    }
}
