//! Which of the lines that were found are lines.
//!
//! A detector joins pieces of edges that happen to lie near one great circle: a curtain and the frame behind it, waves, or a pipe that
//! bends a little. Followed over their whole length, such edges leave the circle, and a map that makes them straight bends the picture
//! around them. With `d` the distance of a sample of a line's edge from the great circle nearest to its smooth part, px, its departure is
//!
//! ```text
//! max over runs of an eighth of its samples |median of d over the run|:
//! ```
//!
//! the part that is neither noise nor something narrow in front of the line. What is straight in the world departs by the error of the
//! lens, which all lines have in common. What of that error is radial is estimated from them ([`RadialError`]), with as many terms `k`
//! as pay for themselves: those of the least
//!
//! ```text
//! Σ min(departure, MAX_DEPARTURE) + k MAX_DEPARTURE,
//! ```
//!
//! since a term makes one line straight whatever it is. Then a line is none where
//!
//! ```text
//! departure > OUTLIER · median over all lines, within MIN_DEPARTURE and MAX_DEPARTURE.
//! ```
//!
//! Under a wrong lens most lines are kept, therefore: that error is not hidden. On six portraits of 4 to 12 megapixels 99 of 155 lines are
//! dropped: all 19 that were found in waves, curtains, ribs of clothes, shadows, and edges of planks that step aside by a pixel; of eight
//! boards under four wrong lenses each, 9 %. Dropped too is a line that was joined with an edge behind it.

use rayon::prelude::*;

use super::Line;
use super::continuation::{COURSE, FOUND_REACH};
use super::radial_error::RadialError;
use crate::best_circle;
use plumbline_camera::Lens;
use plumbline_image::PlaneRef;
use plumbline_image::feature::{EdgeTracer, MAX_OFF_CUBIC, averaged};
use plumbline_num::math::{Point2, median};

/// Departure of a line that is none, in medians: the limit of a calibration for its outliers.
const OUTLIER: f64 = 4.0;
/// Least departure of a line that is none, px of the gray levels: what a lens of few terms leaves at the border of a picture.
const MIN_DEPARTURE: f64 = 0.5;
/// Largest departure of a line, px of the gray levels: of 48 of 115 edges in two portraits, looked at, nearly all below are lines, and from
/// 1.3 px on none is.
const MAX_DEPARTURE: f64 = 1.0;
/// Runs of samples into which an edge is divided: what hides a line, a hand or a pole, is seldom wider than half of an eighth of it.
const RUNS: usize = 8;
/// Least number of samples of a run: the median of fewer is no less noisy than they are.
const MIN_RUN: usize = 3;
/// Points of a line by which the error of the lens is estimated.
const POINTS: usize = 16;

/// Of each line, whether it is one: its edge is bent no more than those of most others, or no edge is seen along it. All lines of a
/// panorama are, and a line that is the only one. `lens` has the size of the gray levels, and lines are in px of them.
pub(super) fn straight(lines: &[&Line], lens: &Lens, levels: PlaneRef<'_, f32>) -> Vec<bool> {
    let all = vec![true; lines.len()];
    if lens.projection.is_panoramic() {
        return all;
    }
    let tracer = EdgeTracer::new(levels);
    let edges: Vec<Option<Edge>> = lines.par_iter().map(|line| Edge::of(line, lens, &tracer)).collect();
    let smooth: Vec<&[Point2]> = edges.iter().flatten().map(|edge| edge.smooth.as_slice()).collect();
    // One line alone says nothing of the lens.
    if smooth.len() < 2 {
        return all;
    }
    let under = |terms: usize| -> (f64, Vec<Option<f64>>) {
        let error = RadialError::common(&smooth, lens, terms);
        let departures: Vec<_> = edges.par_iter().map(|edge| edge.as_ref()?.departure(lens, &error)).collect();
        let bent: f64 = departures.iter().flatten().map(|d| d.min(MAX_DEPARTURE)).sum();
        (bent + MAX_DEPARTURE * terms as f64, departures)
    };
    let least = (0..=RadialError::TERMS).map(under).reduce(|a, b| if b.0 < a.0 { b } else { a });
    let Some((_, departures)) = least else { return all };
    let usual = RadialError::usual(departures.iter().flatten().copied().collect());
    let most = (OUTLIER * usual).clamp(MIN_DEPARTURE, MAX_DEPARTURE);
    departures.iter().map(|departure| departure.is_none_or(|d| d <= most)).collect()
}

/// The edge of a line, px.
struct Edge {
    /// Its samples along the line.
    samples: Vec<Point2>,
    /// Of its smooth part, fewer points with less noise.
    smooth: Vec<Point2>,
}

impl Edge {
    /// `None` where no edge is seen along the line.
    fn of(line: &Line, lens: &Lens, tracer: &EdgeTracer<'_>) -> Option<Self> {
        let edge = tracer.trace(&line.course(Some(lens), COURSE), FOUND_REACH)?;
        let smooth = edge.smooth(MAX_OFF_CUBIC);
        let smooth = averaged(&smooth.points[smooth.course], POINTS);
        Some(Self { samples: edge.points[edge.course].to_vec(), smooth })
    }

    /// How far it departs from its best great circle, px; `None` where it is too short for that.
    fn departure(&self, lens: &Lens, error: &RadialError) -> Option<f64> {
        let sights = |points: &[Point2]| points.iter().filter_map(|p| error.sight(lens, *p)).collect::<Vec<_>>();
        let normal = best_circle(&sights(&self.smooth))?;
        let offs: Vec<f64> = sights(&self.samples).iter().map(|sight| sight.distance(&normal)).collect();
        let run = offs.len() / RUNS;
        if run < MIN_RUN {
            return None;
        }
        let middle = |run: &[f64]| median(&mut run.to_vec()).map_or(0.0, f64::abs);
        Some(offs.windows(run).map(middle).fold(0.0, f64::max))
    }
}
