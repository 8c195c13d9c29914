//! Errors of meshes and mesh files.

use std::fmt;

use super::io::MeshFormat;
use plumbline_num::run::Stopped;

/// Errors of constructing, reading and writing meshes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// Input: a triangle with a vertex index out of range.
    #[error("triangle {triangle} names vertex {vertex}, but the mesh has {vertices} vertices, numbered from 0")]
    NoSuchVertex {
        /// The triangle, numbered from 0.
        triangle: usize,
        /// The vertex index.
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
    /// Input: more vertices than a 32-bit index can address.
    #[error("the mesh has {vertices} vertices, more than the {} that can be numbered", u32::MAX)]
    TooManyVertices {
        /// Number of vertices.
        vertices: usize,
    },
    /// Input: an edge with three or more incident triangles, or with two of inconsistent orientation.
    #[error(
        "vertices {from} and {to} are joined by {triangles} triangles of which {along} run from the first to the second; an \
         oriented manifold has at most one each way: repair the mesh first (`mesh::repair`, `plumbline mesh repair`)"
    )]
    NonManifoldEdge {
        /// One end vertex.
        from: u32,
        /// The other end vertex.
        to: u32,
        /// Number of incident triangles.
        triangles: usize,
        /// Number of incident triangles that traverse the edge from the first end to the second.
        along: usize,
    },
    /// Input: a non-manifold vertex, whose incident triangles form several fans.
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
    /// Input: a triangle with a repeated vertex index.
    #[error(
        "triangle {triangle} names a vertex twice; repair the mesh first (`mesh::repair`, `plumbline mesh repair`)"
    )]
    RepeatedCorner {
        /// The triangle, numbered from 0.
        triangle: usize,
    },
    /// Input: nodes, skins, morph targets or animations inconsistent with the mesh or with each other.
    #[error("how the model moves is not consistent: {fault}")]
    Articulation {
        /// The inconsistency.
        fault: String,
    },
    /// Input: a file that violates the specification of its format.
    #[error("{format}, {at}: {fault}")]
    Malformed {
        /// Format the file was read as.
        format: MeshFormat,
        /// Position in the file.
        at: Position,
        /// The fault with the offending value, and the remedy.
        fault: String,
    },
    /// Input: a file of an unknown format.
    #[error("not a mesh that is read here ({seen}); OBJ, PLY, OFF, STL, glTF, GLB, FBX and Medit .mesh are")]
    UnknownFormat {
        /// First bytes of the file, or its name.
        seen: String,
    },
    /// Input, or the limit: a quantity exceeds its limit.
    #[error("{what} of {value} is more than the limit of {limit}; raise the limit if the file is to be trusted")]
    TooLarge {
        /// Name of the quantity.
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
    /// Another error, with the path of the file.
    #[error("{path}: {fault}")]
    InFile {
        /// The file.
        path: String,
        /// The error.
        fault: Box<MeshError>,
    },
    /// The run was interrupted, or its time budget is exhausted.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl MeshError {
    /// Wraps the error in [`Self::InFile`] with the path; interruptions are returned unchanged.
    pub(super) fn of_file(self, path: &std::path::Path) -> Self {
        // An interrupted run is not an error of the file.
        if let Self::Interrupted(_) = self {
            return self;
        }
        Self::InFile { path: path.display().to_string(), fault: Box::new(self) }
    }

    /// Whether the error concerns the output, not the input.
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
    /// Line number in a text file, from 1.
    Line(usize),
    /// Byte offset in a binary file, from 0.
    Byte(usize),
    /// JSON pointer to a value, such as `/accessors/3/count`.
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
