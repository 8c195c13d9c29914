//! Straight-line terms: distance of the virtual vertices from a straight line.
//!
//! A line of virtual vertices `u_k` with a given direction, normal `n`, is straight where all `n·u_k` equal one offset
//! `q`: linear, and therefore exact in one solve. A free line is straight where the least-squares line through the
//! `u_k` leaves no distances. With its normal `n` and the positions `s_k` ∈ [0, 1] of the vertices along it,
//!
//! ```text
//! r_k(u) = n·u_k − (1 − s_k) q₀ − s_k q₁
//! ```
//!
//! is linear in the vertices and in the offsets `q₀`, `q₁` of the line's ends, which become unknowns of their own.
//! About a straight configuration it agrees with the true distance to first order for *every* motion: vertices slide
//! along the line where `n` does not see them, and the line rotates with `q₀` and `q₁`. Carroll et al. alternate
//! between fixing the direction and fixing the positions; this Gauss–Newton step allows both.

use crate::{FittedLine, Orientation};
use plumbline_image::grid::{CellPoint, GridMesh};
use plumbline_num::math::{Point2, Vec2};

/// Weight of a squared distance, cells, for a line with a given direction. The term is linear, so that a large weight
/// costs no iterations; the distance left is 1e-8 of a cell.
const DIRECTED_LINE_WEIGHT: f64 = 1e8;
/// Weight of a squared distance, cells, for a free line. A tenth leaves lines of ten cells bent by a thousandth of
/// their length; ten times as much shortens the steps, because the line search sees the second-order distances that a
/// rotation leaves.
const FREE_LINE_WEIGHT: f64 = 1e4;

/// A line as the solver sees it.
#[derive(Clone, Debug)]
pub(super) struct Straight {
    /// Virtual vertices, at least two.
    pub(super) points: Vec<CellPoint>,
    /// The given direction's normal; `None` for a free line.
    normal: Option<Vec2>,
}

/// A line on the current mesh: normal, and per virtual vertex distance and position along it.
#[derive(Clone, Debug)]
pub(super) struct LinePosition {
    pub(super) normal: Vec2,
    pub(super) off: Vec<f64>,
    pub(super) along: Vec<f64>,
}

impl Straight {
    /// A line through virtual vertices; `None` for fewer than two.
    pub(super) fn new(points: Vec<CellPoint>, orientation: Orientation) -> Option<Self> {
        let normal = orientation.normal();
        (points.len() > 1).then_some(Self { points, normal })
    }

    /// Number of unknowns of its own: offsets of its ends, or one for both.
    pub(super) fn offsets(&self) -> usize {
        if self.normal.is_some() { 1 } else { 2 }
    }

    /// Weight of its squared distances, in cells.
    pub(super) fn weight(&self) -> f64 {
        if self.normal.is_some() { DIRECTED_LINE_WEIGHT } else { FREE_LINE_WEIGHT }
    }

    /// The line on a mesh; distances in the mesh's unit, positions from 0 to 1. `None` where it has shrunk to a point.
    pub(super) fn position(&self, mesh: &GridMesh) -> Option<LinePosition> {
        let at: Vec<Point2> = self.points.iter().map(|&p| mesh.at(p)).collect();
        if let Some(normal) = self.normal {
            let mean = at.iter().map(|p| normal.dot(&p.coords)).sum::<f64>() / at.len() as f64;
            let off = at.iter().map(|p| normal.dot(&p.coords) - mean).collect();
            return Some(LinePosition { normal, off, along: vec![0.0; at.len()] });
        }
        let line = FittedLine::through(&at)?;
        let (first, last) = (line.along(at[0]), line.along(at[at.len() - 1]));
        let along = at.iter().map(|&p| (line.along(p) - first) / (last - first)).collect();
        let off = at.iter().map(|&p| line.off(p)).collect();
        (last > first).then_some(LinePosition { normal: line.normal(), off, along })
    }

    /// Sum of squared distances on a mesh, in the mesh's unit squared.
    pub(super) fn squared_distances(&self, mesh: &GridMesh) -> f64 {
        self.position(mesh).map_or(0.0, |position| position.off.iter().map(|d| d * d).sum())
    }
}
