//! Image warps: energies over a [`GridMesh`](crate::mesh::GridMesh) and the maps made of them.

mod content_preserving;
mod error;
mod fade;
mod salience;

pub use content_preserving::{ContentPreserving, ContentPreservingOptions, PointPair, WarpReport};
pub use error::WarpError;
pub use fade::fade;
pub use salience::cell_salience;
