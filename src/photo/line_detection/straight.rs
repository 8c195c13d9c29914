//! Which of the lines that were found are lines.
//!
//! A detector joins pieces of edges that happen to lie on one great circle: the border of a board and the edge of what lies behind it,
//! or a pipe that bends a little. Followed over their whole length, such edges leave the circle, and a map that makes them straight
//! bends the picture around them. With `d` the distance of a sample of a line's edge from the great circle nearest to its smooth part,
//! px, its departure is
//!
//! ```text
//! max over runs of an eighth of its samples |median of d over the run|:
//! ```
//!
//! the part that is neither noise nor something narrow in front of the line. What is straight in the world departs by the error of the
//! lens, which all lines have in common, so a line is none where
//!
//! ```text
//! departure > max(OUTLIER · median over all lines, MIN_DEPARTURE).
//! ```
//!
//! Under a wrong lens all lines depart, and all are kept: that error is not hidden. A rectilinear lens is seldom that wrong, and under
//! it the limit is at most MAX_DEPARTURE: where nothing is a line, as in waves, the median says nothing. A fisheye that is called rectilinear
//! loses lines by it (`docs/ABLATIONS.md`).
//!
//! On eight pictures of boards of which nothing is given, up to 5 of 31 lines are dropped; without that, the worst line that the result
//! shows is 0.6 to 2.3 px off on six of them. Dropped too is a line of the board that was joined with an edge behind it. To keep the
//! longest straight part of such an edge was tried: what remains is followed into the same bend again.

use rayon::prelude::*;

use super::Line;
use super::continuation::{COURSE, found_reach, leaves_straight};
use crate::{Sight, best_circle};
use plumbline_camera::Lens;
use plumbline_image::PlaneRef;
use plumbline_image::feature::{EdgeTracer, MAX_OFF_CUBIC};
use plumbline_num::math::{Point2, median};

/// Departure of a line that is none, in medians: the limit of a calibration for its outliers.
const OUTLIER: f64 = 4.0;
/// Least departure of a line that is none, px of the gray levels: what a lens of few terms leaves at the border of a picture.
const MIN_DEPARTURE: f64 = 0.5;
/// Largest departure of a line under a lens that leaves lines straight, px of the gray levels: of 48 of 115 edges in two portraits, looked at, nearly
/// all below are lines, and from 1.3 px on none is.
const MAX_DEPARTURE: f64 = 1.0;
/// Runs of samples into which an edge is divided: what hides a line, a hand or a pole, is seldom wider than half of an eighth of it.
const RUNS: usize = 8;
/// Least number of samples of a run: the median of fewer is no less noisy than they are.
const MIN_RUN: usize = 3;

/// Of each line, whether it is one: its edge is bent no more than those of most others, or no edge is seen along it. All lines of a
/// panorama are. `lens` has the size of the gray levels, and lines are in px of them.
pub(super) fn straight(lines: &[&Line], lens: &Lens, levels: PlaneRef<'_, f32>) -> Vec<bool> {
    if lens.projection.is_panoramic() {
        return vec![true; lines.len()];
    }
    let tracer = EdgeTracer::new(levels);
    let departures: Vec<Option<f64>> = lines.par_iter().map(|line| departure(line, lens, &tracer)).collect();
    let mut known: Vec<f64> = departures.iter().flatten().copied().collect();
    known.sort_by(f64::total_cmp);
    // The lower median: of two or four lines the better half sets the scale.
    let usual = known.get(known.len().saturating_sub(1) / 2).copied().unwrap_or(0.0);
    let limit = if leaves_straight(lens) { MAX_DEPARTURE } else { f64::INFINITY };
    let most = (OUTLIER * usual).clamp(MIN_DEPARTURE, limit);
    departures.iter().map(|departure| departure.is_none_or(|d| d <= most)).collect()
}

/// How far a line's edge departs from its best great circle, px; `None` where no edge is seen along it.
fn departure(line: &Line, lens: &Lens, tracer: &EdgeTracer<'_>) -> Option<f64> {
    let course = line.course(Some(lens), COURSE);
    let sights = |points: &[Point2]| points.iter().filter_map(|p| Sight::new(lens, *p)).collect::<Vec<_>>();
    let edge = tracer.trace(&course, found_reach(lens))?;
    let smooth = edge.smooth(MAX_OFF_CUBIC);
    let normal = best_circle(&sights(&smooth.points[smooth.course.clone()]))?;
    let offs: Vec<f64> = sights(&edge.points[edge.course]).iter().map(|sight| sight.distance(&normal)).collect();
    let run = offs.len() / RUNS;
    if run < MIN_RUN {
        return None;
    }
    let middle = |run: &[f64]| median(&mut run.to_vec()).map_or(0.0, f64::abs);
    Some(offs.windows(run).map(middle).fold(0.0, f64::max))
}
