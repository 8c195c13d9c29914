//! Rectification of wide-angle pictures: straight lines without stretched edges.
//!
//! No flat picture of a wide field is both straight (only the rectilinear one is, and it stretches the edges by `1/cos
//! θ`) and true in shape (only conformal ones are, and they bend lines). Distortion is minimized where it is visible,
//! at lines, faces and salient regions, and moved to the rest. See `solver.rs` for the energy.
//!
//! # Reference
//! R. Carroll, M. Agrawala, A. Agarwala, *Optimizing content-preserving projections for wide-angle images*, ACM Trans. Graph.
//! (SIGGRAPH) 28 (2009).

mod attempt;
mod bending;
mod chart;
mod fixed;
mod folds;
mod frame;
mod notation;
mod people;
mod rectifier;
mod solver;
mod sphere_grid;
mod straight;
mod weights;

use nalgebra::Rotation3;

pub(super) use folds::{drawn_back, with_neighbors};
pub use frame::{Crop, OutputSize};
pub use rectifier::Rectifier;
pub use solver::EnergyWeights;
pub use sphere_grid::Window;

use super::warp::PhotoWarp;
use super::{Line, PhotoError, report};
use plumbline_camera::{Lens, Projection, Vec3};
use plumbline_image::Plane;
use plumbline_num::math::{Point2, Rect};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

/// Most lines that [`Target::Optimized`] makes straight at once. Each adds two unknowns that meet all of the grid, three where it
/// was found at an angle, so that time grows with the square of their number: of lines that cross at random 24 take less than
/// 1.6 s of CPU, 500 take 16 s.
pub const MAX_LINES: usize = 500;

/// The projection of the output: `"optimized"`, `"perspective"`, `"panini:0.8"` …
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Target {
    /// The minimizer of the energy.
    #[default]
    Optimized,
    /// A closed-form projection.
    Fixed(Projection),
}

/// Viewing direction relative to the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// Yaw to the right, rad.
    pub yaw: f64,
    /// Pitch upwards, rad.
    pub pitch: f64,
    /// Roll clockwise, rad.
    pub roll: f64,
}

impl View {
    /// Rotation from camera to view.
    pub fn view_from_camera(&self) -> Rotation3<f64> {
        let rotation = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let camera_from_view = rotation(Vec3::y_axis(), self.yaw)
            * rotation(Vec3::x_axis(), self.pitch)
            * rotation(Vec3::z_axis(), self.roll);
        camera_from_view.inverse()
    }
}

/// Options of [`rectify`].
#[derive(Clone, Debug, PartialEq)]
pub struct RectifyOptions {
    /// The projection of the output: `"optimized"`, `"perspective"`, `"panini:0.8"` …
    pub target: Target,
    /// Viewing direction.
    pub view: View,
    /// Angular extent of the view; `None`: the whole picture, up to the limits of the projection.
    pub window: Option<Window>,
    /// Crop of the output.
    pub crop: Crop,
    /// Size of the output.
    pub size: OutputSize,
    /// Cells along the longer side of the grid, even, 4 to 512, default 48. The time grows with the square.
    pub cells: usize,
    /// Weights of the energy's terms.
    pub weights: EnergyWeights,
}

impl Default for RectifyOptions {
    fn default() -> Self {
        Self {
            target: Target::default(),
            view: View::default(),
            window: None,
            crop: Crop::default(),
            size: OutputSize::default(),
            cells: 48,
            weights: EnergyWeights::default(),
        }
    }
}

/// A picture to rectify.
#[derive(Clone, Copy, Debug)]
pub struct RectifyInput<'a> {
    /// The lens, for the picture's size.
    pub lens: &'a Lens,
    /// Lines to make straight, source px; at most [`MAX_LINES`] where the projection is [`Target::Optimized`].
    pub lines: &'a [Line],
    /// Lines that shall not bend more than they must, source px: they are no part of the report.
    pub soft_lines: &'a [SoftLine],
    /// The lines were found, not marked: their orientations are preferences, which yield to shapes.
    pub found: bool,
    /// Faces whose shape is preserved, source px.
    pub faces: &'a [Rect],
    /// Saliency of the whole picture at any resolution, in [0, 1].
    pub saliency: Option<&'a Plane<f32>>,
}

/// A line that nobody marked, found in the picture: it may bend where marked lines, faces or shapes need it.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftLine {
    /// Its course; of any orientation in the output.
    pub points: Vec<Point2>,
    /// Weight of its straightness relative to that of a marked line, above 0.
    pub weight: f64,
}

/// The warp that rectifies a picture.
///
/// # Errors
/// [`PhotoError`]: an option out of range, too many lines, a view that shows nothing, an output without pixels, an interruption.
pub fn rectify(input: &RectifyInput<'_>, options: &RectifyOptions, run: &Run) -> Result<PhotoWarp, PhotoError> {
    let Target::Fixed(projection) = &options.target else { return Rectifier::new(input, options, run)?.warp() };
    check(options)?;
    let mut warp = fixed::unframed(input.lens, projection, options)?.framed(input.lens, input.faces, options)?;
    warp.lines = input.lines.iter().map(|line| report::of_line(line, Some(input.lens), &warp)).collect();
    Ok(warp)
}

/// The view does not overlap the picture.
fn empty_view() -> PhotoError {
    let text = "the view shows nothing of the picture: choose another direction, or a larger field of view";
    PhotoError::Output(text.to_owned())
}

fn check_count(lines: &[Line]) -> Result<(), PhotoError> {
    if lines.len() <= MAX_LINES {
        return Ok(());
    }
    let remedy = "keep the longest, or switch others off";
    Err(PhotoError::Input(format!("{} lines are to be straight, at most {MAX_LINES} can be: {remedy}", lines.len())))
}

fn check(options: &RectifyOptions) -> Result<(), PhotoError> {
    if let OutputSize::Exact(w, h) = options.size {
        frame::check_size(w as f64, h as f64)?;
    }
    let aspect = if let Crop::Aspect(aspect) = options.crop { aspect.value() } else { 1.0 };
    let w = &options.weights;
    let check = OptionError::check;
    check((4.0..=512.0).contains(&(options.cells as f64)), "cells", options.cells as f64, "4 to 512")?;
    check(aspect > 0.0 && aspect.is_finite(), "ratio of the crop", aspect, "above 0")?;
    check(w.conformality > 0.0 && w.conformality.is_finite(), "weight of conformality", w.conformality, "above 0")?;
    check((0.0..=10.0).contains(&w.smooth_length), "smooth length", w.smooth_length, "0 to 10 rad")?;
    check((0.0..=100.0).contains(&w.bending_length), "bending length", w.bending_length, "0 to 100 rad")?;
    check((0.0..=1e8).contains(&w.straightness), "weight of lines", w.straightness, "0 to 1e8")?;
    check((0.0..=1e8).contains(&w.faces), "weight of faces", w.faces, "0 to 1e8")?;
    Ok(())
}

#[cfg(test)]
mod tests;
