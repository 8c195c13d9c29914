//! Lines continued beyond their marks.
//!
//! A line is constrained where it is marked. Marks that end early leave the rest of an edge to bend, at full length where the lens
//! bends it most. So the edge is followed beyond both ends ([`EdgeTracer`]) as far as it is smooth, and the lens decides what continues
//! the line: with `n` the normal of the great circle nearest to the samples so far and `d(p)` the distance of a sample from it, px, the next run of
//! samples belongs to the line where
//!
//! ```text
//! median |d(p)| ≤ MAX_OFF,
//! ```
//!
//! and `n` is estimated again with it ([`grown`]). Where an edge leaves the circle, another begins, or the lens is wrong.

use std::ops::Range;

use rayon::prelude::*;

use super::Line;
use crate::{Sight, best_circle};
use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_image::PlaneRef;
use plumbline_image::feature::{EdgeTracer, MAX_OFF_CUBIC, TracedEdge, averaged, grown};
use plumbline_num::math::{Point2, Vec2};

/// Steps between two marks along which an edge is looked for.
pub(super) const COURSE: usize = 16;
/// Largest median distance of a run of samples from the circle, and of a mark, px, for lines that are measured: half the least
/// distance between edges that the tracer distinguishes, four times the error of a calibrated lens. At half of it some lines of boards seen by a
/// fisheye are not followed.
const MAX_OFF: f64 = 2.0;
/// The same for lines of two points, of which the lens gives the course: at twice as much edges of bodies and of water are taken for
/// continuations of what was found there.
const MAX_OFF_LENS: f64 = 1.0;
/// Samples per further point, 16 px: the mean of eight is accurate to a twentieth of a pixel.
const AVERAGED: usize = 8;
/// Least length of a continuation, px: shorter ones are within the error of a mark.
const MIN_CONTINUATION: f64 = 4.0;

/// The lines, continued beyond each end past which the picture shows an edge on the same great circle. Marks of three points or more get
/// measurements of it, as far as it goes; of lines of two points, whose course the lens gives, the ends move there. `lens` has the
/// picture's size; `levels` are its gray levels, 0 to 255, at any resolution. Panoramas, on which a line may run off one side and on
/// from the other, are left as they are.
///
/// # Example
/// ```
/// use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection};
/// use plumbline_image::Plane;
/// use plumbline_num::math::Point2;
/// use plumbline_photo::line_detection::continued;
/// use plumbline_photo::{Line, Orientation};
///
/// let levels = Plane::from_fn(300, 200, |x, y| if y < 120 || x > 250 { 30.0 } else { 200.0 });
/// let fov = FieldOfView::degrees(90.0, FieldAxis::Horizontal);
/// let lens = Lens::from_field_of_view(Projection::Rectilinear, fov, (300.0, 200.0))?;
/// let points = vec![Point2::new(80.0, 120.0), Point2::new(160.0, 120.0)];
/// let sill = Line { name: "sill".to_owned(), points, orientation: Orientation::Free };
/// let whole = continued(&[sill], &lens, levels.as_ref()).remove(0).points;
/// assert!(whole[0].x < 8.0 && (whole[whole.len() - 1].x - 250.0).abs() < 8.0, "{whole:?}");
/// # Ok::<(), plumbline_camera::LensError>(())
/// ```
pub fn continued(lines: &[Line], lens: &Lens, levels: PlaneRef<'_, f32>) -> Vec<Line> {
    carried_on(lines, lens, levels, |line, lens, tracer| match line.points.len() {
        2 => Followed::new(line, lens, tracer, (EdgeTracer::REACH, MAX_OFF_LENS))?
            .if_marked(line, lens)?
            .ends(line, lens),
        _ => Followed::new(line, lens, tracer, (EdgeTracer::REACH, MAX_OFF))?.if_marked(line, lens)?.with_marks(line),
    })
}

/// The lines as their edges are measured over their whole visible length, where one is seen along them; else as they are. For lines that
/// were found: their ends are not anybody's marks.
pub(super) fn followed(lines: &[Line], lens: &Lens, levels: PlaneRef<'_, f32>) -> Vec<Line> {
    carried_on(lines, lens, levels, |line, lens, tracer| {
        let mut followed = Followed::new(line, lens, tracer, (found_reach(lens), MAX_OFF))?;
        if !leaves_straight(lens) {
            followed = followed.if_marked(line, lens)?;
        }
        Some(followed.measured(followed.known.clone())).filter(|points| points.len() >= 2)
    })
}

/// True for a lens that leaves lines straight, so that how it was found does not decide which edges are lines.
pub(super) fn leaves_straight(lens: &Lens) -> bool {
    lens.projection == Projection::Rectilinear
}

/// How far off the course of a line that was found its edge may be, px. Pieces within 2 px of one circle in a view of half as many pixels are
/// joined to a line, which is 4 px here, where a lens leaves lines straight. Others are not known well enough to tell what lies so far
/// off from the next edge.
pub(super) fn found_reach(lens: &Lens) -> usize {
    if leaves_straight(lens) { EdgeTracer::MAX_REACH } else { EdgeTracer::REACH }
}

/// Lines with other points, which are found in px of the gray levels.
fn carried_on(
    lines: &[Line],
    lens: &Lens,
    levels: PlaneRef<'_, f32>,
    points: impl Fn(&Line, &Lens, &EdgeTracer<'_>) -> Option<Vec<Point2>> + Sync,
) -> Vec<Line> {
    let size = (levels.width() as f64, levels.height() as f64);
    let small = if lens.projection.is_panoramic() { None } else { lens.resized(size).ok() };
    let Some(small) = small else { return lines.to_vec() };
    let tracer = EdgeTracer::new(levels);
    let scale = Vec2::new(lens.size.0 / size.0, lens.size.1 / size.1);
    let whole = |line: &Line| {
        let marks = line.points.iter().map(|p| Point2::from(p.coords.component_div(&scale))).collect();
        let found = points(&Line { points: marks, ..line.clone() }, &small, &tracer);
        let large = |p: Point2| Point2::from(p.coords.component_mul(&scale));
        let points = found.map(|points| points.into_iter().map(large).collect());
        Line { points: points.unwrap_or_else(|| line.points.clone()), ..line.clone() }
    };
    lines.par_iter().map(whole).collect()
}

/// An edge along a line and beyond its ends, px of the gray levels.
struct Followed {
    edge: TracedEdge,
    sights: Vec<Option<Sight>>,
    /// The samples on one great circle with those along the line, and its normal.
    known: Range<usize>,
    normal: Vec3,
    max_off: f64,
}

impl Followed {
    /// `None` where no edge is seen along a line.
    fn new(line: &Line, lens: &Lens, tracer: &EdgeTracer<'_>, (reach, max_off): (usize, f64)) -> Option<Self> {
        let edge = tracer.trace(&line.course(Some(lens), COURSE), reach)?.smooth(MAX_OFF_CUBIC);
        let sights: Vec<Option<Sight>> = edge.points.iter().map(|p| Sight::new(lens, *p)).collect();
        let (known, normal) = supported(&sights, edge.course.clone(), max_off)?;
        Some(Self { edge, sights, known, normal, max_off })
    }

    /// Itself where the marks of the line lie on its circle.
    fn if_marked(self, line: &Line, lens: &Lens) -> Option<Self> {
        let is_on =
            |p: &Point2| Sight::new(lens, *p).is_some_and(|mark| mark.distance(&self.normal).abs() <= self.max_off);
        line.points.iter().all(is_on).then_some(self)
    }

    /// Two ends on the circle: where the edge ends, or the mark of an end beyond which it does not go.
    fn ends(&self, line: &Line, lens: &Lens) -> Option<Vec<Point2>> {
        let end = |sample: usize, mark: Point2| {
            let sight = self.sights[sample].as_ref().filter(|_| !self.edge.course.contains(&sample))?;
            let end = lens.project(&(sight.ray - self.normal * self.normal.dot(&sight.ray)))?;
            ((end - mark).norm() >= MIN_CONTINUATION).then_some(end)
        };
        let marks = [line.points[0], line.points[1]];
        let (first, last) = (end(self.known.start, marks[0]), end(self.known.end - 1, marks[1]));
        let is_longer = first.is_some() || last.is_some();
        is_longer.then(|| vec![first.unwrap_or(marks[0]), last.unwrap_or(marks[1])])
    }

    /// The marks, and beyond them the edge.
    fn with_marks(&self, line: &Line) -> Option<Vec<Point2>> {
        let (first, last) = (line.points.first()?, line.points.last()?);
        let long = |points: &Vec<Point2>, mark: &Point2| {
            points.iter().map(|p| (p - mark).norm()).fold(0.0, f64::max) >= MIN_CONTINUATION
        };
        let before = Some(self.measured(self.known.start..self.edge.course.start)).filter(|p| long(p, first));
        let after = Some(self.measured(self.edge.course.end..self.known.end)).filter(|p| long(p, last));
        let is_longer = before.is_some() || after.is_some();
        let own = line.points.iter().copied();
        is_longer.then(|| before.into_iter().flatten().chain(own).chain(after.into_iter().flatten()).collect())
    }

    /// Some of the samples by fewer points with less noise.
    fn measured(&self, part: Range<usize>) -> Vec<Point2> {
        let is_on = |sight: &Sight| sight.distance(&self.normal).abs() <= self.max_off;
        let on = |k: &usize| self.sights[*k].as_ref().is_some_and(is_on);
        let samples: Vec<Point2> = part.filter(on).map(|k| self.edge.points[k]).collect();
        averaged(&samples, samples.len() / AVERAGED)
    }
}

/// The samples of an edge that lie on one great circle with those of `course`, and its normal; `None` where those of `course` do not.
fn supported(sights: &[Option<Sight>], course: Range<usize>, max_off: f64) -> Option<(Range<usize>, Vec3)> {
    let circle = |known: Range<usize>| best_circle(&seen(&sights[known]));
    let off = |normal: &Vec3, k: usize| sights[k].as_ref().map(|s| s.distance(normal).abs());
    let (known, normal) = grown(course.clone(), sights.len(), max_off, circle, off)?;
    let on = course.clone().filter(|k| off(&normal, *k).is_some_and(|off| off <= max_off)).count();
    (2 * on > course.len()).then_some((known, normal))
}

fn seen(sights: &[Option<Sight>]) -> Vec<Sight> {
    sights.iter().flatten().copied().collect()
}
