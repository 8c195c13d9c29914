//! Detection of the straight lines of a photo.
//!
//! What is straight in the world is bent by a wide lens, so edges are not looked for on the photo but on perspective
//! views of it (`view`), where they are straight. Each edge is a piece of a great circle on the viewing sphere; pieces
//! of one circle that nearly touch are joined (`arc`), since the sphere is common to all views. Circles whose lines are
//! parallel in space meet in a vanishing point (`vanishing`): the vertical one first, then horizontal ones. Lines that
//! run to a vanishing point are likely to be of buildings and preferred (`select`): long lines, spread over the
//! picture, with lines of no group only where they are long.
//!
//! Only verticals of a nearly level camera, and horizontals parallel to the image plane, get an orientation:
//! constraining others would distort the picture more than it helps. Each line has a name and can be switched off by
//! it.
//!
//! Without a lens the photo is the view, and is taken as a perspective one.

mod arc;
mod continuation;
mod curves;
mod search;
mod select;
mod snap;
mod straight;
#[cfg(test)]
mod tests;
mod unmarked;
mod vanishing;
mod view;

use std::f64::consts::PI;

use rayon::prelude::*;

use super::{Line, Orientation};
use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_image::PlaneRef;
use plumbline_image::feature::segments;
use plumbline_num::math::{Point2, Rect, Vec2};
use plumbline_num::run::{Run, Stopped};

pub use continuation::continued;
pub use curves::curves;
pub use search::{LineConstraints, LineSearch};
pub use snap::snapped;
pub use unmarked::unmarked;

use arc::Arc;
use vanishing::Directions;
use view::View;

/// Margin around a face's box for hair and chin, as a fraction of it.
const FACE_MARGIN: f64 = 0.25;
/// Points at which a line is tested against face boxes.
const SAMPLES: usize = 33;

/// Settings of [`detect_lines`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineDetectionOptions {
    /// Longest side of the picture on which edges are detected, px, default 1400: finer edges are too short to matter
    /// for a warp.
    pub max_side: usize,
    /// Maximum number of lines, default 60.
    pub max_lines: usize,
    /// Minimum length of a line that meets a vanishing point, as a fraction of the photo's diagonal, default 0.07;
    /// faint and blurred edges, such as those of clouds, must be longer.
    pub min_length: f64,
    /// Minimum length of any other line, as a fraction of the diagonal, default 0.12: foliage and clothes have short
    /// edges.
    pub min_free_length: f64,
}

impl Default for LineDetectionOptions {
    fn default() -> Self {
        Self { max_side: 1400, max_lines: 60, min_length: 0.07, min_free_length: 0.12 }
    }
}

/// The lines of a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct LineDetection {
    /// The best lines, the best first.
    pub lines: Vec<DetectedLine>,
    /// Direction of gravity in the lens's axes, if vertical lines determine it.
    pub down: Option<Vec3>,
    /// Directions of horizontal groups, the strongest first.
    pub horizontals: Vec<Vec3>,
}

/// A line of a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectedLine {
    /// The line: its course in source px.
    pub line: Line,
    /// Which lines it is parallel to in space.
    pub group: LineGroup,
    /// Length, source px.
    pub length_px: f64,
    /// Fraction of the length along which an edge is detected, in [0, 1].
    pub coverage: f64,
}

/// Lines that are parallel in space.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineGroup {
    /// Along gravity.
    Vertical,
    /// Along one of [`LineDetection::horizontals`], by index.
    Horizontal(usize),
    /// None.
    Free,
}

/// Finds the lines of a photo of gray levels 0 to 255; `lens`, of the photo's size, gives its viewing rays.
///
/// # Errors
/// [`Stopped`].
pub fn detect_lines(
    luma: PlaneRef<'_, f32>,
    lens: Option<&Lens>,
    options: &LineDetectionOptions,
    run: &Run,
) -> Result<LineDetection, Stopped> {
    let size = (luma.width() as f64, luma.height() as f64);
    if luma.width() < 8 || luma.height() < 8 {
        return Ok(LineDetection { lines: Vec::new(), down: None, horizontals: Vec::new() });
    }
    let flat = flat_lens(size);
    let sight = lens.unwrap_or(&flat);
    let views = View::all(luma, sight, options.max_side);
    run.check()?;
    let of_view = |view: &View| if run.check().is_ok() { arcs_of(view) } else { Vec::new() };
    let arcs: Vec<Arc> = views.par_iter().flat_map_iter(of_view).collect();
    run.check()?;
    let arcs = arc::without_repeats(arc::joined(arcs));
    run.check()?;
    let directions = if lens.is_some() { Directions::find(&arcs) } else { Directions::default() };
    run.check()?;
    let lines = select::best(&arcs, &directions, sight, lens.is_none(), options);
    Ok(LineDetection { lines, down: directions.down, horizontals: directions.horizontals })
}

/// The lines outside faces: straight edges on faces are glasses or hair.
pub fn off_faces(lines: Vec<Line>, faces: &[Rect]) -> Vec<Line> {
    let on = |p: &Point2| {
        faces.iter().any(|face| {
            let margin = Vec2::new(face.width(), face.height()) * FACE_MARGIN;
            Rect { min: face.min - margin, max: face.max + margin }.contains(*p)
        })
    };
    let free = |line: &Line| 2 * sampled(line).filter(on).count() < SAMPLES;
    lines.into_iter().filter(free).collect()
}

/// Points of a line, evenly spread from mark to mark.
fn sampled(line: &Line) -> impl Iterator<Item = Point2> + '_ {
    let pieces = (line.points.len() - 1) as f64;
    (0..SAMPLES).map(move |k| {
        let at = pieces * k as f64 / (SAMPLES - 1) as f64;
        let first = (at as usize).min(line.points.len() - 2);
        line.points[first] + (line.points[first + 1] - line.points[first]) * (at - first as f64)
    })
}

/// Least length of an edge, px of the view: three times the distance of the samples along it.
const MIN_LENGTH: f64 = 12.0;

/// The edges of a view as pieces of great circles.
fn arcs_of(view: &View) -> Vec<Arc> {
    segments(view.luma(), MIN_LENGTH).iter().filter_map(|s| Arc::of_segment(view, s)).collect()
}

/// A photo without a lens is taken as a perspective one, as wide as a usual camera's.
fn flat_lens(size: (f64, f64)) -> Lens {
    let focal = size.0.max(size.1);
    let center = Point2::new(0.5 * size.0, 0.5 * size.1);
    Lens { projection: Projection::Rectilinear, focal: Vec2::new(focal, focal), center, size }
}
