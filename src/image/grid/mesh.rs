//! A grid of quads over an image, regular or deformed.

use super::Quad;
use plumbline_num::math::Point2;

/// The regular grid of `cols × rows` cells over the rectangle `[0, width] × [0, height]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Cells along x, ≥ 1.
    pub cols: usize,
    /// Cells along y, ≥ 1.
    pub rows: usize,
    /// Extent along x, px, > 0.
    pub width: f64,
    /// Extent along y, px, > 0.
    pub height: f64,
}

/// A point of a grid by its cell: it moves with the cell's corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPoint {
    /// Number of the cell, row-major.
    pub cell: usize,
    /// Position in the cell from its left edge, [0, 1].
    pub s: f64,
    /// Position in the cell from its top edge, [0, 1].
    pub t: f64,
}

/// A deformed grid: vertex `i` of the regular grid lies at `vertices[i]`.
///
/// As a warp it is the *forward* map `out_from_src`, bilinear in each cell.
#[derive(Clone, Debug, PartialEq)]
pub struct GridMesh {
    /// Cells along x.
    pub cols: usize,
    /// Cells along y.
    pub rows: usize,
    /// `(cols+1)·(rows+1)` positions, row-major, px.
    pub vertices: Vec<Point2>,
}

/// Vertex numbers of a cell's corners: top left, top right, bottom left, bottom right (ascending).
fn corners(cols: usize, cell: usize) -> [usize; 4] {
    let first = cell / cols * (cols + 1) + cell % cols;
    [first, first + 1, first + cols + 1, first + cols + 2]
}

impl Grid {
    /// Number of vertices, `(cols+1)·(rows+1)`.
    pub fn vertex_count(&self) -> usize {
        (self.cols + 1) * (self.rows + 1)
    }

    /// Number of cells, `cols·rows`.
    pub fn cell_count(&self) -> usize {
        self.cols * self.rows
    }

    /// Width and height of a cell, px.
    pub fn cell_size(&self) -> (f64, f64) {
        (self.width / self.cols as f64, self.height / self.rows as f64)
    }

    /// Position of vertex `i`, px.
    pub fn vertex(&self, i: usize) -> Point2 {
        let (col, row) = (i % (self.cols + 1), i / (self.cols + 1));
        Point2::new(self.width * col as f64 / self.cols as f64, self.height * row as f64 / self.rows as f64)
    }

    /// Vertex numbers of a cell's corners: top left, top right, bottom left, bottom right (ascending).
    pub fn corners(&self, cell: usize) -> [usize; 4] {
        corners(self.cols, cell)
    }

    /// The cell of a point, and its position in it; `None` outside the rectangle or for NaN.
    pub fn locate(&self, p: Point2) -> Option<CellPoint> {
        let inside = p.x >= 0.0 && p.x <= self.width && p.y >= 0.0 && p.y <= self.height;
        if !inside {
            return None;
        }
        let (u, v) = (p.x / self.width * self.cols as f64, p.y / self.height * self.rows as f64);
        let (col, row) = ((u as usize).min(self.cols - 1), (v as usize).min(self.rows - 1));
        Some(CellPoint { cell: row * self.cols + col, s: u - col as f64, t: v - row as f64 })
    }

    /// The point at a position in a cell.
    pub fn at(&self, p: CellPoint) -> Point2 {
        Quad(self.corners(p.cell).map(|i| self.vertex(i))).at(p.s, p.t)
    }

    /// The grid as a mesh that has not moved.
    pub fn to_mesh(&self) -> GridMesh {
        let vertices = (0..self.vertex_count()).map(|i| self.vertex(i)).collect();
        GridMesh { cols: self.cols, rows: self.rows, vertices }
    }
}

impl GridMesh {
    /// Becomes a copy of another mesh in the memory it has (a derived `clone_from` would allocate).
    pub fn copy_from(&mut self, other: &Self) {
        (self.cols, self.rows) = (other.cols, other.rows);
        self.vertices.clone_from(&other.vertices);
    }

    /// Vertex numbers of a cell's corners: top left, top right, bottom left, bottom right (ascending).
    pub fn corners(&self, cell: usize) -> [usize; 4] {
        corners(self.cols, cell)
    }

    /// The deformed quad of a cell.
    pub fn quad(&self, cell: usize) -> Quad {
        Quad(self.corners(cell).map(|i| self.vertices[i]))
    }

    /// Where a point of the grid has moved to.
    pub fn at(&self, p: CellPoint) -> Point2 {
        self.quad(p.cell).at(p.s, p.t)
    }

    /// Number of cells that fold or collapse (a Jacobian that is not positive at some corner), NaN included.
    pub fn folded_cells(&self) -> usize {
        let sound = |cell: usize| self.quad(cell).min_jacobian() > 0.0;
        (0..self.cols * self.rows).filter(|&cell| !sound(cell)).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRID: Grid = Grid { cols: 7, rows: 5, width: 640.0, height: 360.0 };

    #[test]
    fn a_located_point_evaluates_to_itself() {
        let mesh = GRID.to_mesh();
        for p in [(0.0, 0.0), (640.0, 360.0), (640.0, 0.0), (91.4, 72.0), (320.3, 11.7)].map(|(x, y)| Point2::new(x, y))
        {
            let found = GRID.locate(p).expect("inside");
            assert!((mesh.at(found) - p).norm() < 1e-12 * GRID.width, "{p} became {}", mesh.at(found));
            assert!((0.0..=1.0 + 1e-12).contains(&found.s) && (0.0..=1.0 + 1e-12).contains(&found.t), "{found:?}");
        }
    }

    #[test]
    fn points_outside_have_no_cell() {
        for (x, y) in [(-1e-9, 1.0), (640.1, 1.0), (1.0, 360.1), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            assert_eq!(GRID.locate(Point2::new(x, y)), None, "({x}, {y})");
        }
    }

    #[test]
    fn the_regular_grid_has_no_folds_and_covers_the_image() {
        let mesh = GRID.to_mesh();
        assert_eq!(mesh.vertices.len(), GRID.vertex_count());
        assert_eq!(mesh.folded_cells(), 0);
        let area: f64 = (0..GRID.cell_count()).map(|c| mesh.quad(c).area()).sum();
        assert!((area - 640.0 * 360.0).abs() < 1e-9 * area);
    }

    #[test]
    fn a_vertex_pulled_over_its_neighbor_folds_the_cells_around_it() {
        let mut mesh = GRID.to_mesh();
        let i = 3 * 8 + 3;
        mesh.vertices[i].x += 120.0;
        assert_eq!(mesh.folded_cells(), 2, "the two cells to its right");
        mesh.vertices[i].x = f64::NAN;
        assert_eq!(mesh.folded_cells(), 4, "NaN is not a place");
    }
}
