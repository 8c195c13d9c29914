//! Image warps: energies over a [`GridMesh`](crate::grid::GridMesh), and the backward fields made of the solved meshes.
//!
//! Solvers produce *forward* meshes `out_from_src`; a [`WarpField`] is *backward*, `src_from_out`, and a renderer samples
//! it through a [`Lattice`].

mod cell_saliency;
mod content_preserving;
mod coverage;
mod error;
mod field;
mod inverse_mesh;
mod lattice;

pub use cell_saliency::cell_saliency;
pub use content_preserving::{ContentPreserving, ContentPreservingOptions, PointPair, WarpReport};
pub use coverage::keep_covered;
pub use error::WarpError;
pub use field::{Map, WarpField};
pub use inverse_mesh::InverseMesh;
pub use lattice::Lattice;
