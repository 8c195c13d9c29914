//! A regular grid of quads laid over an image.

use crate::math::Point2;

/// A grid of `cols × rows` quads. Vertex `(i, j)` of the regular grid over the source image, `i` along x, stands at
/// index `j·(cols + 1) + i` and lands at `vertices[..]` in the output.
#[derive(Clone, Debug, PartialEq)]
pub struct GridMesh {
    /// Quads along x, ≥ 1.
    pub cols: usize,
    /// Quads along y, ≥ 1.
    pub rows: usize,
    /// `(cols + 1)·(rows + 1)` positions in the output, row-major, px.
    pub vertices: Vec<Point2>,
}
