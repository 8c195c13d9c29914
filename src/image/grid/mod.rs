//! A regular grid of quads over an image, and what it becomes when its vertices move.

mod mesh;
mod quad;

pub use mesh::{CellPoint, Grid, GridMesh};
pub use quad::Quad;
