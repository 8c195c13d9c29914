//! A regular grid of quads over an image, and its deformed mesh.

mod mesh;
mod quad;

pub use mesh::{CellPoint, Grid, GridMesh};
pub use quad::Quad;
