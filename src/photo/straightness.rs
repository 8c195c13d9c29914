//! How straight the lines of a picture became, measured on edges found in the result.
//!
//! A solver's residual is small by construction: it knows the lens that it was given and the points that it was given, and a wrong
//! lens or a mark that ends early leaves a bend that it cannot see. So the result itself is looked at: the picture is sampled
//! through the map, the edge of each line is followed in it as far as it goes ([`EdgeTracer`]), and the distance of the edge from
//! its best straight line is reported.
//!
//! A lens that is wrong bends lines smoothly, as a cubic does over their length. Where an edge leaves the cubic through what is
//! known of it, beyond the line's own ends, another edge begins: the shadow of a board, a hand that holds it.
//!
//! What is reported is the smooth part of the edge: the polynomial of degree five nearest to its samples, without those that lie
//! off it by more than noise does, as where a shadow or a hand crosses the edge. A map of cells a fiftieth of the picture wide bends
//! no line faster, and the noise of one sample, a quarter of a pixel, is not taken for a bend.

use rayon::prelude::*;

use super::warp::{FittedLine, PhotoWarp, Straightness};
use super::{Line, LineReport};
use plumbline_camera::Lens;
use plumbline_image::feature::{EdgeTracer, SmoothCurve};
use plumbline_image::warp::Lattice;
use plumbline_image::{Plane, PlaneRef};
use plumbline_num::math::{Point2, Vec2};

/// Longest side of the result that is looked at, px. Larger results show no more of a bend, smaller ones hide one of a pixel.
const MAX_SIDE: f64 = 2000.0;
/// Points per marked piece at which a course is laid along its great circle.
const COURSE: usize = 16;
/// Points at which the smooth part of an edge is compared with a line.
const PARTS: usize = 48;
/// Least number of samples of an edge that is measured: twice as many as its polynomial has coefficients.
const MIN_SAMPLES: usize = 12;

/// Measures the lines of a warp, which are those it was made from, on the edges of its result, and enters what is found into
/// its reports. `luma` are the gray levels, 0 to 255, of the source of `source_size` px at any resolution.
pub fn measure_straightness(
    warp: &mut PhotoWarp,
    lines: &[Line],
    lens: Option<&Lens>,
    luma: PlaneRef<'_, f32>,
    source_size: (usize, usize),
) {
    let (width, height) = (warp.size.0 as f64, warp.size.1 as f64);
    // No finer than the levels that are there.
    let known = luma.width().max(luma.height()) as f64 / source_size.0.max(source_size.1) as f64;
    let scale = (MAX_SIDE / width.max(height)).min(known).min(1.0);
    let result = sampled(warp, scale, luma, source_size);
    let tracer = EdgeTracer::new(result.as_ref());
    let measured = |line: &Line| {
        let seen: Vec<Point2> =
            line.course(lens, COURSE).into_iter().filter_map(|p| (warp.forward)(p)).map(|p| p * scale).collect();
        let edge = bend(&tracer.trace(&seen)?.smooth().points)?;
        Some(Straightness { max_px: edge.max_px / scale, length_px: edge.length_px / scale })
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

/// The result's gray levels at a scale; no numbers where the source does not reach.
fn sampled(warp: &PhotoWarp, scale: f64, luma: PlaneRef<'_, f32>, source_size: (usize, usize)) -> Plane<f32> {
    let side = |length: usize| ((length as f64 * scale).ceil() as usize).max(1);
    let (cols, rows) = (side(warp.size.0), side(warp.size.1));
    let lattice = Lattice::between(&warp.field, warp.size, source_size);
    let per = Vec2::new(luma.width() as f64 / source_size.0 as f64, luma.height() as f64 / source_size.1 as f64);
    let mut out = Plane::new(cols, rows);
    let (data, stride) = out.as_mut().into_data();
    data.par_chunks_mut(stride).take(rows).enumerate().for_each(|(y, row)| {
        for (x, sample) in row[..cols].iter_mut().enumerate() {
            let at = Point2::new((x as f64 + 0.5) / scale, (y as f64 + 0.5) / scale);
            let src = lattice.src_from_out(at).map(|p| Point2::from(p.coords.component_mul(&per)));
            *sample = src.and_then(|p| bilinear(luma, p)).unwrap_or(f32::NAN);
        }
    });
    out
}

/// The gray level between the four nearest pixels; `None` outside.
fn bilinear(luma: PlaneRef<'_, f32>, p: Point2) -> Option<f32> {
    let (x, y) = (p.x - 0.5, p.y - 0.5);
    let (w, h) = (luma.width() as f64, luma.height() as f64);
    if !(x >= -0.5 && y >= -0.5 && x <= w - 0.5 && y <= h - 0.5) {
        return None;
    }
    let split = |v: f64, n: usize| {
        let v = v.clamp(0.0, (n - 1) as f64);
        let i = (v as usize).min(n.saturating_sub(2));
        (i, (i + 1).min(n - 1), (v - i as f64) as f32)
    };
    let ((i, i1, s), (j, j1, t)) = (split(x, luma.width()), split(y, luma.height()));
    let mix = |row: &[f32]| row[i] + s * (row[i1] - row[i]);
    let (upper, lower) = (mix(luma.row(j)), mix(luma.row(j1)));
    Some(upper + t * (lower - upper))
}
