//! How straight the lines of a picture became, measured along their edges.
//!
//! A solver's residual is small by construction: it knows the lens that it was given and the points that it was given, and a wrong
//! lens or a mark that ends early leaves a bend that it cannot see. So the edge of each line is followed in the source as far as it goes
//! ([`EdgeTracer`]), each of its samples is sent through the map, and the distance of the edge in the result from its best straight line
//! is reported. It is followed in the source since a lens, whichever it is, bends lines smoothly, as a cubic does over their length: where
//! an edge leaves the cubic through what is known of it, beyond the line's own ends, another edge begins, such as the shadow of a board
//! or a hand that holds it. In the result, a map that straightens a line as far as it is marked and no farther has a corner there, behind
//! which the rest of the line would be hidden.
//!
//! What is reported is the smooth part of the edge: the polynomial of degree five nearest to its samples. A map of cells a fiftieth of
//! the picture wide bends no line faster, and the noise of one sample, a quarter of a pixel, is not taken for a bend.

use rayon::prelude::*;

use super::warp::{FittedLine, PhotoWarp, Straightness};
use super::{Line, LineReport};
use plumbline_camera::Lens;
use plumbline_image::PlaneRef;
use plumbline_image::feature::{EdgeTracer, SmoothCurve};
use plumbline_num::math::{Point2, Rect, Vec2};

/// Largest distance of an edge's continuation from the cubic through what is known of it, px: the scatter of samples. Twice as much, as for
/// edges that are made straight, leads into other edges, which on four boards of eight looked like lines bent by 1 to 4 px.
const MAX_OFF: f64 = 0.35;
/// Points per marked piece at which a course is laid along its great circle.
const COURSE: usize = 16;
/// Points at which the smooth part of an edge is compared with a line.
const PARTS: usize = 48;
/// Least number of samples of an edge that is measured: twice as many as its polynomial has coefficients.
const MIN_SAMPLES: usize = 12;

/// Measures the lines of a warp, which are those it was made from, on their edges, and enters what is found into its reports. `luma` are
/// the gray levels, 0 to 255, of the source of `source_size` px at any resolution.
pub fn measure_straightness(
    warp: &mut PhotoWarp,
    lines: &[Line],
    lens: Option<&Lens>,
    luma: PlaneRef<'_, f32>,
    source_size: (usize, usize),
) {
    let per = Vec2::new(luma.width() as f64 / source_size.0 as f64, luma.height() as f64 / source_size.1 as f64);
    let shown = Rect { min: Point2::origin(), max: Point2::new(warp.size.0 as f64, warp.size.1 as f64) };
    let tracer = EdgeTracer::new(luma);
    let measured = |line: &Line| {
        let course: Vec<Point2> =
            line.course(lens, COURSE).iter().map(|p| Point2::from(p.coords.component_mul(&per))).collect();
        // Across the seam of a panorama there is no edge to follow.
        if course.windows(2).any(|p| (p[1].x - p[0].x).abs() > 0.5 * luma.width() as f64) {
            return None;
        }
        let source = tracer.trace(&course, EdgeTracer::REACH)?.smooth(MAX_OFF).points.into_iter();
        let edge = source.filter_map(|p| (warp.forward)(Point2::from(p.coords.component_div(&per))));
        bend(&edge.filter(|p| shown.contains(*p)).collect::<Vec<_>>())
    };
    let found: Vec<Option<Straightness>> = lines.par_iter().map(measured).collect();
    let reports: Vec<&mut LineReport> = warp.lines.iter_mut().collect();
    reports.into_iter().zip(found).for_each(|(report, edge)| report.edge = edge);
}

/// The largest distance of the smooth part of an edge from its best straight line.
fn bend(edge: &[Point2]) -> Option<Straightness> {
    if edge.len() < MIN_SAMPLES {
        return None;
    }
    let smooth = SmoothCurve::<6>::through(edge)?;
    let course: Vec<Point2> = (0..=PARTS).map(|k| smooth.at(k as f64 / PARTS as f64)).collect();
    let fit = FittedLine::through(&course)?;
    let max_px = course.iter().map(|p| fit.off(*p).abs()).fold(0.0, f64::max);
    Some(Straightness { max_px, length_px: (edge[edge.len() - 1] - edge[0]).norm() })
}
