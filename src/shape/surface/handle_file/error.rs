//! Why a handle file was refused.

use plumbline_num::document::DocumentError;

/// A handle file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HandleFileError {
    /// Input: no such document, or one that cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: a value that it cannot have.
    #[error("{place}: {field} is {value} (expected {expected})")]
    Value {
        /// The handle or set, and the key in it.
        place: String,
        /// The field.
        field: &'static str,
        /// What stands there.
        value: String,
        /// What may stand there.
        expected: String,
    },
    /// Input: a vertex that the mesh does not have.
    #[error("{place}: the mesh has no vertex {vertex} (expected 0 to {}, in the order of the file)", .vertices.saturating_sub(1))]
    NoSuchVertex {
        /// The handle or set.
        place: String,
        /// What stands there.
        vertex: u64,
        /// Number of vertices of the mesh.
        vertices: usize,
    },
    /// Input: a name that no set has.
    #[error("{place}: there is no set {name:?} (sets: {known})")]
    NoSuchSet {
        /// The handle or set that names it.
        place: String,
        /// The name.
        name: String,
        /// Names of the sets.
        known: String,
    },
    /// Input: sets that are made of themselves.
    #[error("{place}: the set {name:?} is made of itself; take one of the names out")]
    Circular {
        /// The handle or set that names it.
        place: String,
        /// The name.
        name: String,
    },
    /// Input: a handle that holds nothing.
    #[error("{place}: no vertex of the mesh lies in it; the mesh reaches from {low} to {high}")]
    Empty {
        /// The handle.
        place: String,
        /// Lowest coordinates of the mesh.
        low: String,
        /// Highest coordinates of the mesh.
        high: String,
    },
    /// Input: a vertex that two handles claim.
    #[error(
        "vertex {vertex} belongs to {first} and to {second}, {shared} in all: take them out of one, for example by {{\"not\": …}}"
    )]
    Claimed {
        /// The first such vertex.
        vertex: u32,
        /// The earlier handle.
        first: String,
        /// The later handle.
        second: String,
        /// How many they share.
        shared: usize,
    },
}
