//! Report on a marked line, measured at the marked points only.

use super::Line;
use super::warp::{FittedLine, LineReport, PhotoWarp};
use plumbline_camera::{Lens, Vec3};
use plumbline_num::math::{Point2, Rect};

/// Samples of a line with two marked points.
const SAMPLES: usize = 33;

/// The report on `line` under `warp`.
pub(super) fn of_line(line: &Line, lens: Option<&Lens>, warp: &PhotoWarp) -> LineReport {
    let marked = measured(line, lens);
    let frame = Rect::of_size(warp.size.0 as f64, warp.size.1 as f64);
    let shown: Vec<Point2> = marked.iter().filter_map(|p| (warp.forward)(*p)).filter(|p| frame.contains(*p)).collect();
    let fraction = shown.len() as f64 / marked.len().max(1) as f64;
    let off_lens_px = lens.filter(|_| line.points.len() > 2).and_then(|lens| off_great_circle(&line.points, lens));
    let none = LineReport {
        name: line.name.clone(),
        max_px: 0.0,
        rms_px: 0.0,
        length_px: 0.0,
        angle: 0.0,
        angle_error: None,
        off_lens_px,
        shown: fraction,
        edge: None,
    };
    let Some(fit) = FittedLine::through(&shown) else { return none };
    let offs = || shown.iter().map(|p| fit.off(*p).abs());
    let alongs = || shown.iter().map(|p| fit.along(*p));
    let angle = (fit.direction.y / fit.direction.x).atan();
    LineReport {
        max_px: offs().fold(0.0, f64::max),
        rms_px: (offs().map(|d| d * d).sum::<f64>() / shown.len() as f64).sqrt(),
        length_px: alongs().fold(f64::NEG_INFINITY, f64::max) - alongs().fold(f64::INFINITY, f64::min),
        angle,
        angle_error: line.orientation.angle().map(|w| undirected(angle - w)),
        ..none
    }
}

/// The angle between undirected lines whose directions differ by `angle`, in [0, π/2].
fn undirected(angle: f64) -> f64 {
    let turned = angle.rem_euclid(std::f64::consts::PI);
    turned.min(std::f64::consts::PI - turned)
}

/// The points to measure: the marked ones, or for two ends the line between them.
fn measured(line: &Line, lens: Option<&Lens>) -> Vec<Point2> {
    if line.points.len() == 2 { line.course(lens, SAMPLES - 1) } else { line.points.clone() }
}

/// Largest distance, source px, of points from the great circle nearest to their directions.
fn off_great_circle(points: &[Point2], lens: &Lens) -> Option<f64> {
    let rays: Option<Vec<Vec3>> = points.iter().map(|p| lens.unproject(*p)).collect();
    let rays = rays?;
    let spread = rays.iter().fold(nalgebra::Matrix3::zeros(), |m, r| m + r * r.transpose());
    let eigen = spread.symmetric_eigen();
    let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let off = |(p, ray): (&Point2, &Vec3)| Some((lens.project(&(ray - normal * normal.dot(ray)))? - p).norm());
    points.iter().zip(&rays).map(off).try_fold(0.0, |worst: f64, d| Some(worst.max(d?)))
}
