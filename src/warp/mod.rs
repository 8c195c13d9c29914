//! Image warps: energies over a [`GridMesh`](crate::mesh::GridMesh) and the maps made of them.

mod content_preserving;
mod error;
mod fade;
mod salience;

pub use content_preserving::{ContentPreserving, ContentPreservingOptions, PointPair, WarpReport};
pub use error::WarpError;
pub use fade::fade;
pub use salience::cell_salience;
//! Image warps: backward fields from forward meshes and maps, and the lattice through which they are sampled.

mod field;
mod inverse_mesh;
mod lattice;

pub use field::{FieldError, Map, WarpField};
pub use inverse_mesh::InverseMesh;
pub use lattice::Lattice;
