//! Image warps: backward fields from forward meshes and maps, and the lattice through which they are sampled.

mod field;
mod inverse_mesh;
mod lattice;

pub use field::{FieldError, Map, WarpField};
pub use inverse_mesh::InverseMesh;
pub use lattice::Lattice;
