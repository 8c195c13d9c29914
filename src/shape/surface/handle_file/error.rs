//! Why a handle file was refused.

use std::io;

/// A handle file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HandleFileError {
    /// Input: not JSON of the expected shape; the message ends with line and column.
    #[error("not a file of handles: {0}")]
    Syntax(#[source] serde_json::Error),
    /// Input: some other JSON.
    #[error("format {found:?} is not a file of handles (expected {expected:?})")]
    Format {
        /// What `format` says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// Input: made by a program of another version.
    #[error("version {found} of a file of handles is not supported (expected 1)")]
    Version {
        /// What `version` says.
        found: u64,
    },
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
    /// Input: larger than any file of handles.
    #[error("{bytes} bytes are too many for a file of handles (at most {most}): is this the right file?")]
    TooLarge {
        /// Its size.
        bytes: u64,
        /// The largest that is read.
        most: u64,
    },
    /// Environment: reading failed.
    #[error("{0}")]
    Io(#[from] io::Error),
}
