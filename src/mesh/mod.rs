//! Regular grids of quads over an image.

mod grid;

pub use grid::GridMesh;
