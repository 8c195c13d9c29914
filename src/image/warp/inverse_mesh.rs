//! Inversion of a forward grid mesh, cell by cell.
//!
//! Cell `(i, j)` carries its corners `a, b, c, d` (top left, top right, bottom left, bottom right) by the bilinear map
//!
//! ```text
//! x(s, t) = a + s e + t f + st g,    e = b − a,  f = c − a,  g = a − b − c + d,    s, t ∈ [0, 1].
//! ```
//!
//! About the center of the cell, with `v = (s − ½, t − ½)` and the Jacobian `J` there, `x − x(½, ½) = J v + v₁v₂ g`, so
//! that the solution of `x(s, t) = x` is the fixed point
//!
//! ```text
//! v = J⁻¹(x − x(½, ½)) − v₁ v₂ k,    k = J⁻¹ g,
//! ```
//!
//! which contracts by `|k|`: for the nearly parallelogram cells of a video warp a few multiplications yield rounding
//! error. Bent cells are left to Newton's method.
//!
//! The cell is found by walking: the cell that contained the previous point is tried first, and `(⌊s⌋, ⌊t⌋)` says how many
//! cells to go on. Along a scan line the walk is almost always zero or one cell long, so that no search structure is needed.
//!
//! Outside the mesh the border cell is linearised at its nearest point, so that the field is defined, continuous across
//! the border, and grows no faster than the border cell itself. Cells that are folded over or degenerate yield the best
//! `(s, t)` found, never NaN.
//!
//! The inverse bends where the mesh does. [`InverseMesh::interpolation_error`] bounds from the second differences of the
//! vertices by how much it departs from its bilinear interpolation on a lattice, so that a lattice fine enough is found
//! without sampling a finer one.

use nalgebra::Matrix2;

use super::WarpError;
use crate::grid::GridMesh;
use plumbline_num::math::{Point2, PointMap, Vec2};

/// Iterations of the fixed point before Newton's method takes over. Cells of a video warp, `|k|` below 0.03, need three
/// to five.
const FIXED_POINT_STEPS: usize = 6;
/// Maximum number of Newton iterations. Three suffice for convex cells; strongly sheared ones near a corner take up to
/// six.
const NEWTON_STEPS: usize = 8;
/// Step of `(s, t)` at which the iteration ends: the error left is smaller by the factor `|k|`, or quadratic.
const STEP_TOLERANCE: f64 = 1e-8;
/// A point this far outside a cell, in cells, still counts as inside: both neighbors agree there, and without slack
/// rounding could send the walk back and forth.
const SLACK: f64 = 1e-7;
/// Cells visited before the walk gives up. Jumps of `⌊s⌋` cells make three typical, even across the whole mesh.
const MAX_WALK: usize = 512;
/// Jumps before the walk goes on cell by cell: where widths differ several times over, jumps can circle among three cells.
const MAX_JUMPS: usize = 16;

#[derive(Clone, Copy, Debug)]
struct Cell {
    a: Vec2,
    e: Vec2,
    f: Vec2,
    g: Vec2,
    /// `x(½, ½)`, `J⁻¹` and `k`; the latter two zero where the cell is degenerate.
    center: Vec2,
    inverse: Matrix2<f64>,
    k: Vec2,
}

/// Initial guess of Newton's method.
const CENTER: Vec2 = Vec2::new(0.5, 0.5);

impl Cell {
    /// The cell with corners `a b c d`.
    fn new([a, b, c, d]: [Vec2; 4]) -> Self {
        let (e, f, g) = (b - a, c - a, a - b - c + d);
        let (p, q) = (e + 0.5 * g, f + 0.5 * g);
        let regular = regular(p, q).map(|det| Matrix2::new(q.y, -q.x, -p.y, p.x) / det);
        let inverse = regular.unwrap_or_else(Matrix2::zeros);
        Self { a, e, f, g, center: a + 0.5 * (e + q), inverse, k: inverse * g }
    }

    fn at(&self, u: Vec2) -> Vec2 {
        self.a + u.x * self.e + u.y * self.f + u.x * u.y * self.g
    }

    /// `∂x/∂(s, t)`.
    fn jacobian(&self, u: Vec2) -> Matrix2<f64> {
        Matrix2::from_columns(&[self.e + u.y * self.g, self.f + u.x * self.g])
    }

    /// One Newton step from `u`; `None` where the cell is degenerate or folded there.
    fn step(&self, x: Vec2, u: Vec2) -> Option<Vec2> {
        let (r, p, q) = (x - self.at(u), self.e + u.y * self.g, self.f + u.x * self.g);
        regular(p, q).map(|det| Vec2::new(r.perp(&q), p.perp(&r)) / det)
    }

    /// `(s, t)` of `x`. Where Newton's method does not converge (`x` far outside, the cell folded) the estimate of the
    /// cell linearised at its center, which is enough to walk on.
    fn invert(&self, x: Vec2) -> Vec2 {
        let linear = self.inverse * (x - self.center);
        if linear.amax() <= 2.5 {
            let mut v = linear;
            for _ in 0..FIXED_POINT_STEPS {
                let next = linear - self.k * (v.x * v.y);
                let moved = (next - v).amax();
                v = next;
                if moved < STEP_TOLERANCE {
                    return CENTER + v;
                }
            }
            return self.newton(x, CENTER + linear);
        }
        CENTER + linear
    }

    /// Newton's method from `linear`, which is the result where it does not converge.
    fn newton(&self, x: Vec2, linear: Vec2) -> Vec2 {
        let mut u = linear;
        for _ in 1..NEWTON_STEPS {
            let Some(du) = self.step(x, u) else { break };
            u += du;
            if du.amax() < STEP_TOLERANCE {
                return u;
            }
        }
        linear
    }

    /// `(s, t)` of `x` with the cell linearised at its point nearest to `u`, for points outside the mesh.
    fn extrapolate(&self, x: Vec2, u: Vec2) -> Vec2 {
        let inside = Vec2::new(u.x.clamp(0.0, 1.0), u.y.clamp(0.0, 1.0));
        self.step(x, inside).map_or(inside, |du| inside + du)
    }
}

/// The determinant of the columns `p, q` where the cell is neither degenerate nor folded.
fn regular(p: Vec2, q: Vec2) -> Option<f64> {
    let det = p.perp(&q);
    (det > 1e-9 * (p.norm_squared() + q.norm_squared())).then_some(det)
}

/// How far `(s, t)` lies outside its cell, in cells.
fn distance(u: Vec2) -> f64 {
    let outside = |s: f64| (-s).max(s - 1.0).max(0.0);
    outside(u.x).max(outside(u.y))
}

/// A forward mesh and the coefficients of its cells, ready to be asked for source positions.
#[derive(Clone, Debug)]
pub struct InverseMesh {
    cols: usize,
    rows: usize,
    /// Size of a cell in the source, px.
    cell: Vec2,
    cells: Vec<Cell>,
    bend: Bend,
}

/// The largest second derivatives of the inverse.
#[derive(Clone, Copy, Debug, Default)]
struct Bend {
    /// Change of slope where cells meet, along x and y together, source px per output px.
    kink: f64,
    /// Smallest distance of such kinks, output px.
    pitch: f64,
    /// Mixed derivative inside a cell, source px per squared output px. It counts where mesh and lattice are rotated.
    twist: f64,
}

impl InverseMesh {
    /// Prepares the inverse of `mesh`, whose regular grid covers a source of `width × height` px.
    ///
    /// # Errors
    /// [`WarpError::Input`] for a mesh of another shape or with a vertex that is not finite, and for an empty source.
    pub fn new(mesh: &GridMesh, width: f64, height: f64) -> Result<Self, WarpError> {
        let (cols, rows, vertices) = (mesh.cols, mesh.rows, mesh.vertices.len());
        if cols == 0 || rows == 0 || vertices != (cols + 1) * (rows + 1) {
            let expected = "expected (cols + 1)·(rows + 1), at least 4";
            return Err(WarpError::Input(format!(
                "a grid of {cols}×{rows} cells has {vertices} vertices ({expected})"
            )));
        }
        if let Some(index) = mesh.vertices.iter().position(|v| !(v.x.is_finite() && v.y.is_finite())) {
            let text = format!("vertex {index} of the grid is not finite; every vertex needs a position");
            return Err(WarpError::Input(text));
        }
        if !(width > 0.0 && height > 0.0 && width.is_finite() && height.is_finite()) {
            let text = format!("source size {width}×{height} px is invalid (expected both > 0)");
            return Err(WarpError::Input(text));
        }
        let vertex = |i: usize, j: usize| mesh.vertices[j * (cols + 1) + i].coords;
        let cell = |k: usize| {
            let (i, j) = (k % cols, k / cols);
            Cell::new([vertex(i, j), vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)])
        };
        let size = Vec2::new(width / cols as f64, height / rows as f64);
        let cells: Vec<Cell> = (0..cols * rows).map(cell).collect();
        let bend = Bend::of(&cells, cols, size);
        Ok(Self { cols, rows, cell: size, cells, bend })
    }

    /// Bound on the error, source px, of the inverse interpolated bilinearly between the points of a lattice of step
    /// `h` output px, inside the mesh. A change `κ` of slope errs by `κ h/4` at most where it falls into the middle of a
    /// step; several of them, one each `c` px, act like the second derivative `κ/c` and err by `κ h²/8c`.
    pub(super) fn interpolation_error(&self, h: f64) -> f64 {
        let Bend { kink, pitch, twist } = self.bend;
        kink * (h / 4.0).max(h * h / (8.0 * pitch)) + twist * h * h / 8.0
    }

    /// Source position of `p`. `hint` is the cell to try first (any value is allowed) and holds the cell found.
    pub(super) fn map_from(&self, p: Point2, hint: &mut usize) -> Option<Point2> {
        let (k, u) = self.locate(p.coords, *hint)?;
        *hint = k;
        let corner = Vec2::new((k % self.cols) as f64, (k / self.cols) as f64);
        Some(Point2::from((corner + u).component_mul(&self.cell)))
    }

    /// The cell of `x` and `(s, t)` in it; `None` only for a point that is not finite.
    fn locate(&self, x: Vec2, hint: usize) -> Option<(usize, Vec2)> {
        if !(x.x.is_finite() && x.y.is_finite()) {
            return None;
        }
        let start = if hint < self.cells.len() { hint } else { self.rows / 2 * self.cols + self.cols / 2 };
        let (mut k, mut before, mut reach) = (start, usize::MAX, usize::MAX);
        let mut u = self.cells[k].invert(x);
        for visited in 0..MAX_WALK {
            let next = self.toward(k, u, reach);
            if next == k {
                break;
            }
            if next == before && reach == 1 {
                (k, u) = self.nearest(x, k);
                break;
            }
            if next == before || visited == MAX_JUMPS {
                // Two cells of different size overshoot to each other across those between them.
                (before, reach) = (usize::MAX, 1);
                continue;
            }
            (before, k) = (k, next);
            u = self.cells[k].invert(x);
        }
        Some((k, if distance(u) > SLACK { self.cells[k].extrapolate(x, u) } else { u }))
    }

    /// The cell around `k` that contains `x` or comes nearest to it. Two cells can each send the walk to the other:
    /// outside the mesh, and where a bent cell continued beyond its edges takes in what belongs to its neighbor.
    fn nearest(&self, x: Vec2, k: usize) -> (usize, Vec2) {
        let (i, j) = (k % self.cols, k / self.cols);
        let mut best = (k, self.cells[k].invert(x));
        for l in j.saturating_sub(1)..=(j + 1).min(self.rows - 1) {
            for m in i.saturating_sub(1)..=(i + 1).min(self.cols - 1) {
                let u = self.cells[l * self.cols + m].invert(x);
                if distance(u) < distance(best.1) {
                    best = (l * self.cols + m, u);
                }
            }
        }
        best
    }

    /// The cell that lies `⌊u⌋` cells from `k`, but at most `reach` along each axis, held inside the mesh.
    fn toward(&self, k: usize, u: Vec2, reach: usize) -> usize {
        let go = |i: usize, s: f64, n: usize| {
            let whole = if (-SLACK..=1.0 + SLACK).contains(&s) { 0 } else { s.floor() as isize };
            let near = (i.saturating_sub(reach), i.saturating_add(reach).min(n - 1));
            i.saturating_add_signed(whole).clamp(near.0, near.1)
        };
        go(k / self.cols, u.y, self.rows) * self.cols + go(k % self.cols, u.x, self.cols)
    }
}

impl PointMap for InverseMesh {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.map_from(p, &mut usize::MAX.clone())
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let (k, u) = self.locate(p.coords, usize::MAX)?;
        let inside = Vec2::new(u.x.clamp(0.0, 1.0), u.y.clamp(0.0, 1.0));
        let inverse = self.cells[k].jacobian(inside).try_inverse()?;
        Some(Matrix2::from_diagonal(&self.cell) * inverse)
    }
}

impl Bend {
    /// Of row-major `cells` in `cols` columns, each `size` px large in the source. Degenerate cells bend without bound.
    fn of(cells: &[Cell], cols: usize, size: Vec2) -> Self {
        let mut bend = Self { pitch: f64::INFINITY, ..Self::default() };
        for (k, cell) in cells.iter().enumerate() {
            let (across, down) = (cell.e.norm_squared(), cell.f.norm_squared());
            let right = cells.get(k + 1).filter(|_| (k + 1) % cols != 0);
            let kink_x = right.map_or(0.0, |right| (right.e - cell.e).norm() * size.x / across);
            let kink_y = cells.get(k + cols).map_or(0.0, |below| (below.f - cell.f).norm() * size.y / down);
            bend.kink = bend.kink.max(kink_x + kink_y);
            bend.pitch = bend.pitch.min(across.min(down).sqrt());
            bend.twist = bend.twist.max(cell.g.norm() * size.max() / (across * down).sqrt() / across.min(down).sqrt());
        }
        bend
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 6×4 mesh over 600×400 whose vertices are moved by up to `amplitude` px.
    fn wavy(amplitude: f64) -> GridMesh {
        let vertex = |k: usize| {
            let (x, y) = ((k % 7) as f64 * 100.0, (k / 7) as f64 * 100.0);
            Point2::new(x + amplitude * (0.031 * y + 0.7 * x).sin(), y + amplitude * (0.02 * x + 1.3 * y).cos())
        };
        GridMesh { cols: 6, rows: 4, vertices: (0..35).map(vertex).collect() }
    }

    fn forward(mesh: &GridMesh, p: Point2) -> Point2 {
        let (i, j) = ((p.x / 100.0).floor().clamp(0.0, 5.0), (p.y / 100.0).floor().clamp(0.0, 3.0));
        let (s, t) = (p.x / 100.0 - i, p.y / 100.0 - j);
        let v = |di: usize, dj: usize| mesh.vertices[(j as usize + dj) * 7 + i as usize + di].coords;
        Point2::from((v(0, 0) * (1.0 - s) + v(1, 0) * s) * (1.0 - t) + (v(0, 1) * (1.0 - s) + v(1, 1) * s) * t)
    }

    #[test]
    fn every_source_point_is_found_again() {
        let mesh = wavy(20.0);
        let inverse = InverseMesh::new(&mesh, 600.0, 400.0).expect("well formed");
        for k in 0..4000 {
            let p = Point2::new((k * 37 % 601) as f64, (k * 91 % 401) as f64);
            let back = inverse.map(forward(&mesh, p)).expect("finite");
            assert!((back - p).norm() < 1e-6, "{p} came back as {back}");
        }
    }

    #[test]
    fn the_hint_changes_the_path_and_not_the_result() {
        let mesh = wavy(20.0);
        let inverse = InverseMesh::new(&mesh, 600.0, 400.0).expect("well formed");
        let x = forward(&mesh, Point2::new(333.0, 222.0));
        let expected = inverse.map(x).expect("finite");
        for mut hint in 0..24 {
            let found = inverse.map_from(x, &mut hint).expect("finite");
            assert!((found - expected).norm() < 1e-6);
            assert_eq!(hint, 2 * 6 + 3);
        }
    }

    #[test]
    fn columns_of_very_different_width_are_found_from_anywhere() {
        let widths = [7.0, 6.0, 8.0, 41.0, 40.0, 5.0, 5.0, 44.0, 6.0, 3.0, 90.0, 2.0];
        let mut x = vec![0.0];
        for w in &widths {
            x.push(x[x.len() - 1] + w);
        }
        let vertex = |k: usize| Point2::new(x[k % 13], 30.0 * (k / 13) as f64);
        let mesh = GridMesh { cols: 12, rows: 4, vertices: (0..65).map(vertex).collect() };
        let inverse = InverseMesh::new(&mesh, 120.0, 40.0).expect("well formed");
        for (c, &w) in widths.iter().enumerate() {
            for start in 0..48 {
                let found = inverse.map_from(Point2::new(x[c] + 0.3 * w, 71.0), &mut start.clone()).expect("finite");
                assert!((found.x - 10.0 * (c as f64 + 0.3)).abs() < 1e-9, "column {c} from cell {start}: {found}");
            }
        }
    }

    #[test]
    fn an_affine_mesh_is_affine_outside_too() {
        let vertex = |k: usize| Point2::new((k % 7) as f64 * 110.0 + 5.0, (k / 7) as f64 * 90.0 - 3.0);
        let mesh = GridMesh { cols: 6, rows: 4, vertices: (0..35).map(vertex).collect() };
        let inverse = InverseMesh::new(&mesh, 600.0, 400.0).expect("well formed");
        for (x, y) in [(-500.0, -500.0), (3000.0, 20.0), (300.0, 2000.0), (300.0, 100.0)] {
            let p = inverse.map(Point2::new(x * 1.1 + 5.0, y * 0.9 - 3.0)).expect("finite");
            assert!((p - Point2::new(x, y)).norm() < 1e-6, "({x}, {y}) came back as {p}");
        }
    }

    #[test]
    fn the_border_is_crossed_without_a_jump() {
        let mesh = wavy(10.0);
        let inverse = InverseMesh::new(&mesh, 600.0, 400.0).expect("well formed");
        let edge = forward(&mesh, Point2::new(600.0, 150.0));
        let [a, b] = [-1e-4, 1e-4].map(|d| inverse.map(edge + Vec2::new(d, 0.0)).expect("finite"));
        assert!((a - b).norm() < 1e-3, "{a} and {b}");
    }

    #[test]
    fn folded_and_flat_cells_never_yield_nan() {
        let mut mesh = wavy(10.0);
        mesh.vertices[16] = mesh.vertices[18] + Vec2::new(90.0, 0.0);
        mesh.vertices[24] = mesh.vertices[23];
        mesh.vertices[30] = mesh.vertices[23];
        mesh.vertices[31] = mesh.vertices[23];
        let inverse = InverseMesh::new(&mesh, 600.0, 400.0).expect("finite, though folded");
        for k in 0..20_000 {
            let p = inverse.map(Point2::new((k * 37 % 901) as f64 - 150.0, (k * 91 % 701) as f64 - 150.0));
            assert!(p.is_some_and(|p| p.x.is_finite() && p.y.is_finite()));
        }
        assert_eq!(inverse.map(Point2::new(f64::NAN, 0.0)), None);
    }

    #[test]
    fn the_jacobian_equals_central_differences() {
        let inverse = InverseMesh::new(&wavy(20.0), 600.0, 400.0).expect("well formed");
        let (p, h) = (Point2::new(345.0, 155.0), 1e-3);
        let j = inverse.jacobian(p).expect("regular");
        for (k, d) in [Vec2::new(h, 0.0), Vec2::new(0.0, h)].into_iter().enumerate() {
            let numeric = (inverse.map(p + d).expect("finite") - inverse.map(p - d).expect("finite")) / (2.0 * h);
            assert!((j.column(k) - numeric).norm() < 1e-5, "column {k}");
        }
    }

    #[test]
    fn malformed_meshes_are_refused_with_the_reason() {
        let mut mesh = wavy(0.0);
        let of = |mesh: &GridMesh, w| InverseMesh::new(mesh, w, 400.0).expect_err("malformed").to_string();
        assert_eq!(of(&mesh, -1.0), "source size -1×400 px is invalid (expected both > 0)");
        mesh.vertices[3].x = f64::NAN;
        assert!(of(&mesh, 600.0).starts_with("vertex 3 of the grid is not finite"));
        mesh.vertices.pop();
        assert!(of(&mesh, 600.0).starts_with("a grid of 6×4 cells has 34 vertices"));
    }
}
