//! Lines that were found beside marked ones, as soft constraints.
//!
//! A found line is straight in the world with a probability that grows with the part of it that an edge was seen along, its coverage
//! `c`; its weight is `w = W c²` of a marked line's. Found again along a marked line it says nothing new, and is left out.

use super::{DetectedLine, Line};
use crate::rectify::SoftLine;
use plumbline_camera::Lens;
use plumbline_num::math::{Point2, Vec2};

/// `W`: with the default weight of 10⁴ a line that lies alone is straight to a hundredth of its bend, at a tenth of it to a
/// twenty-fifth; marks, and the shapes of faces, weigh more.
const WEIGHT: f64 = 1e-2;
/// Distance of a course from a marked line within which it repeats it, as a fraction of the picture's diagonal, and the part of its
/// points there: the two edges of a bar bend alike.
const NEAR: f64 = 0.002;
const REPEATED: f64 = 0.6;
/// Least number of steps of a course; a line that was followed has hundreds of points, and they are compared with those of every other.
const STEPS: usize = 24;

/// The found lines that repeat no marked one, with their weights; all in px of the picture that `lens` is of.
pub fn unmarked(found: &[DetectedLine], marked: &[Line], lens: &Lens) -> Vec<SoftLine> {
    let near = NEAR * lens.size.0.hypot(lens.size.1);
    let courses: Vec<Vec<Point2>> = marked.iter().map(|line| sampled(line, lens)).collect();
    let repeats = |line: &Line| {
        let points = sampled(line, lens);
        let close = |p: &&Point2| courses.iter().any(|course| distance(course, p) <= near);
        points.iter().filter(close).count() as f64 > REPEATED * points.len() as f64
    };
    let fresh = found.iter().filter(|detected| !repeats(&detected.line));
    fresh
        .map(|detected| SoftLine { points: detected.line.points.clone(), weight: WEIGHT * detected.coverage.powi(2) })
        .collect()
}

/// The course of a line in [`STEPS`] to twice as many steps, the ends among them.
fn sampled(line: &Line, lens: &Lens) -> Vec<Point2> {
    let spans = line.points.len().saturating_sub(1).max(1);
    let course = line.course(Some(lens), STEPS.div_ceil(spans));
    let stride = (course.len() / STEPS).max(1);
    let last = course.len().saturating_sub(1);
    course.iter().enumerate().filter(|(k, _)| k % stride == 0 || *k == last).map(|(_, p)| *p).collect()
}

/// Distance of a point from a polyline.
fn distance(course: &[Point2], p: &Point2) -> f64 {
    let to = |pair: &[Point2]| {
        let (span, d): (Vec2, Vec2) = (pair[1] - pair[0], p - pair[0]);
        let t = (d.dot(&span) / span.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (d - span * t).norm()
    };
    course.windows(2).map(to).fold(f64::INFINITY, f64::min)
}
