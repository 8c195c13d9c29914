//! The rows and columns of one frame, and the map they mean.
//!
//! Positions of columns and rows are known at their edges; in between, each axis is a monotone cubic (Fritsch–Carlson,
//! with the harmonic mean of neighboring slopes): the map has no kinks that would be seen to move, and cannot fold.
//!
//! # Reference
//! F. N. Fritsch, R. E. Carlson, *Monotone piecewise cubic interpolation*, SIAM J. Numer. Anal. 17 (1980).

use nalgebra::Matrix2;

use plumbline_image::grid::GridMesh;
use plumbline_num::math::{Point2, PointMap, Rect};

/// An axis-aligned grid: columns and rows of equal size in the source, as they lie in the output.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameGrid {
    /// The part of the picture that the output shows, px.
    pub window: Rect,
    /// Where the edges of columns lie in the output, px; ascending from 0 to its width.
    pub x: Vec<f64>,
    /// Where the edges of rows lie in the output, px; ascending from 0 to its height.
    pub y: Vec<f64>,
}

impl FrameGrid {
    /// The forward mesh over the window, `out_from_window`.
    pub fn mesh(&self) -> GridMesh {
        let vertices = self.y.iter().flat_map(|&y| self.x.iter().map(move |&x| Point2::new(x, y))).collect();
        GridMesh { cols: self.x.len() - 1, rows: self.y.len() - 1, vertices }
    }

    /// The map from the output to the picture.
    pub fn map(&self) -> RowsAndColumns {
        let (window, size) = (&self.window, |extent: f64, positions: &[f64]| extent / (positions.len() - 1) as f64);
        RowsAndColumns {
            x: Axis::new(&self.x, window.min.x, size(window.width(), &self.x)),
            y: Axis::new(&self.y, window.min.y, size(window.height(), &self.y)),
        }
    }
}

/// The backward map of a [`FrameGrid`]: x and y each by themselves.
#[derive(Clone, Debug)]
pub struct RowsAndColumns {
    x: Axis,
    y: Axis,
}

/// A monotone function by its values and slopes.
#[derive(Clone, Debug)]
struct Axis {
    positions: Vec<f64>,
    from: f64,
    size: f64,
    slopes: Vec<f64>,
}

impl Axis {
    /// Takes the value `from + i·size` at `positions[i]`.
    fn new(positions: &[f64], from: f64, size: f64) -> Self {
        let secants: Vec<f64> = positions.windows(2).map(|p| size / (p[1] - p[0])).collect();
        let slope = |i: usize| match (i.checked_sub(1), secants.get(i)) {
            (Some(before), Some(&after)) => {
                let (a, b) = (secants[before], after);
                2.0 * a * b / (a + b)
            }
            (None, Some(&only)) => only,
            (Some(before), None) => secants[before],
            (None, None) => 1.0,
        };
        Self { positions: positions.to_vec(), from, size, slopes: (0..positions.len()).map(slope).collect() }
    }

    /// Value and slope; straight on beyond the ends.
    fn at(&self, p: f64) -> (f64, f64) {
        let last = self.positions.len() - 1;
        let cell = self.positions.partition_point(|x| *x <= p).saturating_sub(1).min(last - 1);
        let (start, length) = (self.positions[cell], self.positions[cell + 1] - self.positions[cell]);
        let u = (p - start) / length;
        let value = |i: usize| self.from + i as f64 * self.size;
        if u < 0.0 {
            return (value(0) + self.slopes[0] * (p - start), self.slopes[0]);
        }
        if u > 1.0 {
            return (value(last) + self.slopes[last] * (p - self.positions[last]), self.slopes[last]);
        }
        let (m0, m1) = (self.slopes[cell] * length / self.size, self.slopes[cell + 1] * length / self.size);
        // Hermite from 0 to 1: u²(3 − 2u) + m₀ u(1 − u)² − m₁ u²(1 − u).
        let v = 1.0 - u;
        let share = u * u * (3.0 - 2.0 * u) + m0 * u * v * v - m1 * u * u * v;
        let slope = 6.0 * u * v + m0 * v * (v - 2.0 * u) + m1 * u * (u - 2.0 * v);
        (value(cell) + share * self.size, slope * self.size / length)
    }
}

impl PointMap for RowsAndColumns {
    fn map(&self, p: Point2) -> Option<Point2> {
        let mapped = Point2::new(self.x.at(p.x).0, self.y.at(p.y).0);
        (mapped.x.is_finite() && mapped.y.is_finite()).then_some(mapped)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let (dx, dy) = (self.x.at(p.x).1, self.y.at(p.y).1);
        (dx.is_finite() && dy.is_finite()).then(|| Matrix2::new(dx, 0.0, 0.0, dy))
    }
}
