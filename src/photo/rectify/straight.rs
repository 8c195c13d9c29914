//! Marked lines as the energy sees them: virtual vertices, and what keeps them on a straight line.
//!
//! A line is cut into *virtual vertices* `u_k`, points of the grid that move with the corners of their cells: the marked
//! points themselves, and between them points of the great circle through each two, half a cell apart at most. With `N` a
//! given or current normal, `s_k` a place along the line,
//!
//! ```text
//! sliding   Σₖ (N·u_k − c)²               the angle stays, points slide along the line          unknown: c
//! turning   Σₖ ‖u_k − (a + s_k d)‖²       the places stay, the line turns and stretches         unknown: a, d
//! ```
//!
//! Both vanish where the points lie on one line, and each is one linear least squares: alternating them makes lines of free
//! orientation straight. Lines of given orientation only slide. The paper measures from a line's first point and its chord;
//! here offset, origin and direction are unknowns of the same solve, so that no marked point counts more than another.
//!
//! # Reference
//! Carroll et al. 2009, section 4.2.

use super::sphere_grid::SphereGrid;
use crate::camera::{Lens, Vec3};
use crate::math::{Point2, Vec2};
use crate::mesh::CellPoint;
use crate::photo::warp::FittedLine;
use crate::photo::{Line, Orientation};

/// Largest distance of virtual vertices, cells.
const SPACING: f64 = 0.5;

/// A line on the grid.
#[derive(Clone, Debug)]
pub(super) struct GridLine {
    /// The virtual vertices, in order.
    pub(super) vertices: Vec<CellPoint>,
    /// The marked points among them, or `None` for a marked point that the grid does not hold.
    pub(super) marked: Vec<Option<CellPoint>>,
    /// The normal where the orientation is given.
    pub(super) normal: Option<Vec2>,
}

/// One row of a line's energy at a virtual vertex.
#[derive(Clone, Copy, Debug)]
pub(super) enum Constraint {
    /// `N·u − c`.
    Slide(Vec2),
    /// `u − (a + s d)`.
    Turn(f64),
}

/// Which of the two half steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HalfStep {
    Slide,
    Turn,
}

impl GridLine {
    /// The part of `line` that the grid holds; `None` where that is less than two points.
    pub(super) fn new(line: &Line, lens: &Lens, sphere: &SphereGrid) -> Option<Self> {
        let rays: Vec<Option<Vec3>> = line.points.iter().map(|p| lens.unproject(*p)).collect();
        let place = |ray: &Vec3| sphere.locate(sphere.chart.at(ray)?);
        let marked: Vec<Option<CellPoint>> = rays.iter().map(|ray| place(ray.as_ref()?)).collect();
        let mut vertices = Vec::new();
        for (k, ray) in rays.iter().enumerate() {
            vertices.extend(marked[k]);
            if let (Some(from), Some(Some(to))) = (ray, rays.get(k + 1)) {
                vertices.extend(between(from, to, sphere).iter().filter_map(place));
            }
        }
        let normal = match line.orientation {
            Orientation::Free => None,
            Orientation::Horizontal => Some(Vec2::new(0.0, 1.0)),
            Orientation::Vertical => Some(Vec2::new(1.0, 0.0)),
            Orientation::Angle(a) => Some(Vec2::new(-a.sin(), a.cos())),
        };
        (vertices.len() >= 2).then_some(Self { vertices, marked, normal })
    }

    /// What keeps the line straight in a half step from where its vertices lie now; empty where they lie on one spot.
    pub(super) fn constraints(&self, now: &[Point2], step: HalfStep) -> Vec<Constraint> {
        if let Some(normal) = self.normal {
            return vec![Constraint::Slide(normal); now.len()];
        }
        let Some(line) = FittedLine::through(now) else { return Vec::new() };
        match step {
            HalfStep::Slide => vec![Constraint::Slide(line.normal()); now.len()],
            HalfStep::Turn => now.iter().map(|p| Constraint::Turn(line.along(*p))).collect(),
        }
    }
}

/// Directions of the great circle between two, so many that neighbors are at most [`SPACING`] cells apart; none of the ends.
fn between(from: &Vec3, to: &Vec3, sphere: &SphereGrid) -> Vec<Vec3> {
    let ends = [from, to].map(|ray| sphere.chart.at(ray));
    let [Some(a), Some(b)] = ends else { return Vec::new() };
    let parts = ((b - a).norm() / (SPACING * sphere.cell())).ceil().clamp(1.0, 1e4) as usize;
    let angle = from.cross(to).norm().atan2(from.dot(to));
    if !(angle > 0.0 && angle < std::f64::consts::PI - 1e-6) {
        return Vec::new();
    }
    let at = |k: usize| {
        let t = k as f64 / parts as f64;
        (from * ((1.0 - t) * angle).sin() + to * (t * angle).sin()) / angle.sin()
    };
    (1..parts).map(at).collect()
}
