//! What a mesh can be refused for.

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
}
