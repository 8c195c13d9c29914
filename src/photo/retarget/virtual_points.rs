//! Marked lines on the grid: the points at which they cross it.
//!
//! A line is cut where it crosses the grid's lines, and halved between; each of these *virtual vertices* is a bilinear
//! combination of its cell's corners. In a cell the map is bilinear, so that a straight piece of the line becomes a curve
//! whose distance from any straight line is a polynomial of second degree along the piece: zero at both ends and in the
//! middle, it is zero throughout. Lines whose virtual vertices are collinear are straight everywhere, not only there.
//!
//! # Reference
//! R. Carroll, M. Agrawala, A. Agarwala, *Optimizing content-preserving projections for wide-angle images*, ACM Trans.
//! Graph. (SIGGRAPH) 28 (2009), section 3.3: virtual vertices.

use crate::Line;
use plumbline_image::grid::{CellPoint, Grid};
use plumbline_num::math::{Point2, Rect, Vec2};

/// Minimum length of a piece, cells: shorter ones would weigh a corner of a cell like a whole crossing.
const MIN_PIECE: f64 = 1e-3;

/// The virtual vertices of a line in order, in cells of a grid laid over `[0, width] × [0, height]`; empty where the line
/// runs outside, or is a point.
pub(super) fn virtual_points(line: &Line, grid: &Grid) -> Vec<CellPoint> {
    let mut points: Vec<CellPoint> = Vec::new();
    for ends in line.points.windows(2) {
        let Some((a, b)) = clipped(ends[0], ends[1], grid).filter(|(a, b)| a != b) else { continue };
        let cuts = crossings(a, b, grid);
        for piece in cuts.windows(2) {
            // The cell of the middle: ends may lie on a border between two.
            let middle = a + (b - a) * (0.5 * (piece[0] + piece[1]));
            let Some(at) = grid.locate(middle) else { continue };
            let place = |u: f64| place_in(grid, at.cell, a + (b - a) * u);
            if points.is_empty() {
                points.push(place(piece[0]));
            }
            points.push(at);
            points.push(place(piece[1]));
        }
    }
    points
}

/// A point in the coordinates of a given cell.
fn place_in(grid: &Grid, cell: usize, p: Point2) -> CellPoint {
    let (w, h) = grid.cell_size();
    let (col, row) = ((cell % grid.cols) as f64, (cell / grid.cols) as f64);
    CellPoint { cell, s: p.x / w - col, t: p.y / h - row }
}

/// The part of a segment inside the grid's rectangle (Liang–Barsky).
fn clipped(a: Point2, b: Point2, grid: &Grid) -> Option<(Point2, Point2)> {
    let frame = Rect::of_size(grid.width, grid.height);
    let d = b - a;
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (start, slope, low, high) in [(a.x, d.x, frame.min.x, frame.max.x), (a.y, d.y, frame.min.y, frame.max.y)] {
        if slope == 0.0 {
            if !(start >= low && start <= high) {
                return None;
            }
            continue;
        }
        let (u, v) = ((low - start) / slope, (high - start) / slope);
        from = from.max(u.min(v));
        to = to.min(u.max(v));
    }
    (from < to).then(|| (a + d * from, a + d * to))
}

/// Fractions of a segment, ascending from 0 to 1, at which it crosses the grid's lines.
fn crossings(a: Point2, b: Point2, grid: &Grid) -> Vec<f64> {
    let (w, h) = grid.cell_size();
    let in_cells = Vec2::new((b.x - a.x) / w, (b.y - a.y) / h);
    let shortest = MIN_PIECE / in_cells.norm().max(MIN_PIECE);
    let mut cuts = vec![0.0, 1.0];
    for (start, slope) in [(a.x / w, in_cells.x), (a.y / h, in_cells.y)] {
        let (low, high) = (start.min(start + slope), start.max(start + slope));
        let mut k = low.floor() + 1.0;
        while k < high {
            cuts.push((k - start) / slope);
            k += 1.0;
        }
    }
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|next, kept| *next - *kept < shortest);
    // The end stays the end, whatever was merged into it.
    if let Some(last) = cuts.last_mut() {
        *last = 1.0;
    }
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Orientation;

    const GRID: Grid = Grid { cols: 6, rows: 4, width: 600.0, height: 400.0 };

    fn line(points: &[(f64, f64)]) -> Line {
        let points = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
        Line { name: String::new(), points, orientation: Orientation::Free }
    }

    #[test]
    fn a_line_is_cut_at_the_grid_and_in_the_middle_between() {
        let mesh = GRID.to_mesh();
        let points = virtual_points(&line(&[(50.0, 30.0), (350.0, 30.0)]), &GRID);
        let x: Vec<f64> = points.iter().map(|&p| mesh.at(p).x).collect();
        let expected = [50.0, 75.0, 100.0, 150.0, 200.0, 250.0, 300.0, 325.0, 350.0];
        assert!(x.len() == 9 && x.iter().zip(expected).all(|(x, e)| (x - e).abs() < 1e-9), "{x:?}");
        assert!(points.iter().all(|&p| (mesh.at(p).y - 30.0).abs() < 1e-12));
    }

    #[test]
    fn pixels_outside_are_clipped() {
        let mesh = GRID.to_mesh();
        let points = virtual_points(&line(&[(-100.0, 100.0), (700.0, 300.0)]), &GRID);
        let (first, last) = (mesh.at(points[0]), mesh.at(points[points.len() - 1]));
        assert!((first - Point2::new(0.0, 125.0)).norm() < 1e-9 && (last - Point2::new(600.0, 275.0)).norm() < 1e-9);
        assert!(virtual_points(&line(&[(-5.0, 0.0), (-5.0, 400.0)]), &GRID).is_empty());
        assert!(virtual_points(&line(&[(100.0, 500.0), (300.0, 401.0)]), &GRID).is_empty());
    }

    #[test]
    fn points_and_repeated_points_make_no_vertices() {
        assert!(virtual_points(&line(&[(50.0, 30.0), (50.0, 30.0)]), &GRID).is_empty());
        assert!(virtual_points(&line(&[(50.0, 30.0)]), &GRID).is_empty());
    }

    #[test]
    fn a_bilinear_cell_keeps_a_line_straight_whose_three_points_are() {
        let mut mesh = GRID.to_mesh();
        mesh.vertices[9] += Vec2::new(17.0, -11.0);
        let ends = line(&[(110.0, 120.0), (190.0, 180.0)]);
        let points = virtual_points(&ends, &GRID);
        assert_eq!(points.len(), 3, "in one cell: both ends and the middle");
        let at = |u: f64| {
            let p = ends.points[0] + (ends.points[1] - ends.points[0]) * u;
            mesh.at(GRID.locate(p).expect("inside"))
        };
        let normal = Vec2::new(0.6, -0.8);
        let f = |u: f64| normal.dot(&at(u).coords);
        // The second-degree polynomial through three points is the function itself.
        for u in [0.1, 0.3, 0.8] {
            let (f0, f1, f2) = (f(0.0), f(0.5), f(1.0));
            let through = f0 * (1.0 - u) * (1.0 - 2.0 * u) + 4.0 * f1 * u * (1.0 - u) + f2 * u * (2.0 * u - 1.0);
            assert!((f(u) - through).abs() < 1e-9);
        }
    }
}
