//! Meshes: the regular grid laid over an image, and the same grid after its vertices have moved.

mod grid;
mod quad;

pub use grid::{CellPoint, Grid, GridMesh};
pub use quad::Quad;
