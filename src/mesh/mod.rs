//! Meshes: the regular grid laid over an image, the same grid after its vertices have moved, and surfaces of triangles.

mod error;
mod grid;
pub mod operators;
mod quad;
mod tri_mesh;

pub use error::MeshError;
pub use grid::{CellPoint, Grid, GridMesh};
pub use quad::Quad;
pub use tri_mesh::TriMesh;
