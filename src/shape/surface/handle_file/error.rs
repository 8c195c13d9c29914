//! Errors of handle files.

use plumbline_num::document::DocumentError;

/// An invalid handle file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HandleFileError {
    /// Input: not a handle file, or one that cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: a value out of its range.
    #[error("{context}: {field} is {value} (expected {expected})")]
    Value {
        /// The handle or set.
        context: String,
        /// The field.
        field: &'static str,
        /// The value.
        value: String,
        /// The allowed values.
        expected: String,
    },
    /// Input: a vertex that does not exist.
    #[error("{context}: the mesh has no vertex {vertex} (expected 0 to {}, in the order of the file)", .vertices.saturating_sub(1))]
    NoSuchVertex {
        /// The handle or set.
        context: String,
        /// The vertex.
        vertex: u64,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: an unknown set.
    #[error("{context}: there is no set {name:?} (sets: {known})")]
    NoSuchSet {
        /// The handle or set that refers to it.
        context: String,
        /// The name.
        name: String,
        /// The known sets.
        known: String,
    },
    /// Input: a set defined by itself.
    #[error("{context}: the set {name:?} is defined by itself; remove one of the references")]
    Circular {
        /// The handle or set that refers to it.
        context: String,
        /// The name.
        name: String,
    },
    /// Input: a handle without vertices.
    #[error("{context}: no vertex of the mesh is inside; the mesh extends from {low} to {high}")]
    Empty {
        /// The handle.
        context: String,
        /// Lowest coordinates of the mesh.
        low: String,
        /// Highest coordinates of the mesh.
        high: String,
    },
    /// Input: a vertex in two handles.
    #[error(
        "vertex {vertex} is in {first} and in {second} ({count} vertices in total): remove them from one, for example by {{\"not\": …}}"
    )]
    Overlap {
        /// The first such vertex.
        vertex: u32,
        /// The earlier handle.
        first: String,
        /// The later handle.
        second: String,
        /// Number of vertices in both.
        count: usize,
    },
}
