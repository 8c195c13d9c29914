//! Retargeting of clips: importance is tracked, a smoothly moving window keeps it, and rows and columns resize around
//! it.
//!
//! Everything here is axis-aligned, since rows and columns that stay straight cannot be seen to swim. A change of shape by the
//! factor `ρ` is shared between a *window*, which cuts away the side that is squeezed more until the factor [`crop_below`] is
//! left, and a *grid* over the window, which takes the rest out of columns and rows that matter least
//! ([`super::retarget`], `axis_aligned.rs`). Both are found at *moments*, some six a second, from importance that was followed
//! along the camera's motion (`followed.rs`); the window's path is a quadratic program (`window_path.rs`).
//!
//! Between moments a uniform cubic B-spline runs with the values at moments as its control points: a frame's grid is a
//! convex combination of solved ones, so that it cannot fold nor leave the frame, its border is exact, and position,
//! speed and acceleration of every row and column are continuous. Shots are solved each on its own.
//!
//! Motion is data: nothing here knows how it was measured.
//!
//! [`crop_below`]: ClipRetargetOptions::crop_below

mod followed;
mod frame_grid;
mod importance;
mod window_path;

use std::ops::Range;

use rayon::prelude::*;

use super::PhotoError;
use super::retarget::axis_aligned::{self, Bounds};
use super::retarget::{check_source, check_target, grid_over, kept_share, strip_profile};
use followed::Followed;
pub use frame_grid::FrameGrid;
pub use importance::ClipImportance;
use plumbline_image::grid::Grid;
use plumbline_num::math::{Homography, Point2, PointMap, Rect, Similarity2};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;
use window_path::WindowScores;

/// Approximate number of grid cells: half that of a still picture, since fewer and broader rows and columns vary less
/// over time.
const CELLS: usize = 600;
/// Strips of the importance profile over which the window slides: positions 1 % of the side apart.
const STRIPS: usize = 96;
/// Minimum weight of a cell, as for still pictures: keeps the program strictly convex.
const MIN_WEIGHT: f64 = 1e-3;

/// Options of [`retarget_clip`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipRetargetOptions {
    /// Ratio of the scales along the two axes below which the clip is cropped before it is resized, 0 to 1, default
    /// 0.8. Higher than for still pictures: objects that move through columns of different width visibly change theirs.
    pub crop_below: f64,
    /// Minimum scale of a row or column relative to the plain resize, above 0, below 1, default 0.5.
    pub min_scale: f64,
    /// Standard deviation of the temporal smoothing of importance, s, above 0 up to 60, default 0.4. Larger is calmer
    /// and reacts later.
    pub follow_s: f64,
}

/// Maximum scale of a row or column relative to the larger scale of the plain resize: above, backgrounds become
/// streaks.
const MAX_SCALE: f64 = 2.0;

impl Default for ClipRetargetOptions {
    fn default() -> Self {
        Self { crop_below: 0.8, min_scale: 0.5, follow_s: 0.4 }
    }
}

impl ClipRetargetOptions {
    fn check(&self) -> Result<(), OptionError> {
        let check = OptionError::check;
        check(self.crop_below >= 0.0 && self.crop_below <= 1.0, "crop_below", self.crop_below, "0 to 1")?;
        check(self.min_scale > 0.0 && self.min_scale < 1.0, "min_scale", self.min_scale, "above 0, below 1")?;
        check(self.follow_s > 0.0 && self.follow_s <= 60.0, "follow_s", self.follow_s, "above 0 up to 60")
    }
}

/// Size, times, shots and motion of a clip.
#[derive(Clone, Copy)]
pub struct ClipData<'a> {
    /// Width and height of the pictures that get the new shape, px: of the source or of the stabilized clip.
    pub size: (usize, usize),
    /// Time of every frame, s.
    pub times_s: &'a [f64],
    /// Frames of each shot, in order, without gaps.
    pub shots: &'a [Range<usize>],
    /// Motion to every frame from the one before it, `this_from_previous`, px.
    pub motion: &'a [Similarity2],
    /// Where each frame in which motion was measured is shown in the picture that gets the new shape; empty where it is that
    /// picture.
    pub shown_from_src: &'a [Homography],
    /// From the frames in which motion was measured to those whose importance was judged, and their size, px; `None` where
    /// they are the same.
    pub judged: Option<(&'a dyn PointMap, (usize, usize))>,
}

impl std::fmt::Debug for ClipData<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut s = f.debug_struct("ClipData");
        s.field("size", &self.size)
            .field("frames", &self.times_s.len())
            .field("shots", &self.shots)
            .finish_non_exhaustive()
    }
}

/// The grids of a clip.
#[derive(Clone, Debug)]
pub struct ClipGrids {
    source: (f64, f64),
    out: (usize, usize),
    /// Fraction of width and height that a window keeps.
    fraction: (f64, f64),
    shots: Vec<ShotGrids>,
}

/// Which part of a clip's pictures its windows show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShownWindow {
    /// Part of width and height.
    pub fraction: (f64, f64),
    /// Range of the window's start along the cropped axis, px.
    pub range_px: (f64, f64),
}

impl ClipGrids {
    /// What the windows show; `None` where they show all.
    pub fn window(&self) -> Option<ShownWindow> {
        let (across, down) = self.fraction;
        if across >= 1.0 && down >= 1.0 {
            return None;
        }
        let side = if across < 1.0 { self.source.0 } else { self.source.1 };
        let starts = || self.shots.iter().flat_map(|s| &s.knots).map(|k| side * k.start);
        let range_px = (starts().fold(f64::INFINITY, f64::min), starts().fold(0.0, f64::max));
        Some(ShownWindow { fraction: self.fraction, range_px })
    }
}

#[derive(Clone, Debug)]
struct ShotGrids {
    frames: Range<usize>,
    knots: Vec<Knot>,
}

/// The solution at a moment: control points of the spline.
#[derive(Clone, Debug)]
struct Knot {
    frame: usize,
    /// Start of the window along the cropped axis, as a fraction of the picture.
    start: f64,
    /// Scales of columns and of rows relative to the plain resize, mean 1.
    columns: Vec<f64>,
    rows: Vec<f64>,
}

/// Finds the grids that give a clip the size `out` px.
///
/// # Errors
/// [`PhotoError::Input`] for a size of the clip that is none, [`PhotoError::Output`] for `out`, [`PhotoError::Option`];
/// [`PhotoError::Input`] where numerics fail.
pub fn retarget_clip(
    clip: &ClipData<'_>,
    importance: &ClipImportance,
    out: (usize, usize),
    options: &ClipRetargetOptions,
    run: &Run,
) -> Result<ClipGrids, PhotoError> {
    options.check()?;
    check_source(clip.size)?;
    check_target(out)?;
    let (width, height) = clip.size;
    let scale = (out.0 as f64 / width as f64, out.1 as f64 / height as f64);
    let kept = kept_share(scale, options.crop_below);
    let fraction = if scale.0 < scale.1 { (kept, 1.0) } else { (1.0, kept) };
    let shape = Shape { source: (width as f64, height as f64), out: (out.0 as f64, out.1 as f64), fraction };
    let solve = |frames: &Range<usize>| shape.solve(clip, importance, frames, options, run);
    let shots = clip.shots.iter().map(solve).collect::<Result<Vec<_>, _>>()?;
    Ok(ClipGrids { source: shape.source, out, fraction, shots })
}

/// Sizes of source and output, and the fraction that a window keeps.
#[derive(Clone, Copy, Debug)]
struct Shape {
    source: (f64, f64),
    out: (f64, f64),
    fraction: (f64, f64),
}

impl Shape {
    /// The window slides along x.
    fn along_x(&self) -> bool {
        self.fraction.0 < 1.0
    }

    fn kept(&self) -> f64 {
        self.fraction.0.min(self.fraction.1)
    }

    /// The window that starts at `start`, in fractions of the picture.
    fn window(&self, start: f64) -> Rect {
        let min = if self.along_x() { Point2::new(start, 0.0) } else { Point2::new(0.0, start) };
        let max = Point2::new((min.x + self.fraction.0).min(1.0), (min.y + self.fraction.1).min(1.0));
        Rect { min, max }
    }

    /// The grid over a window, px.
    fn grid(&self) -> Grid {
        let (width, height) = (self.source.0 * self.fraction.0, self.source.1 * self.fraction.1);
        grid_over(width, height, CELLS)
    }

    fn solve(
        &self,
        clip: &ClipData<'_>,
        importance: &ClipImportance,
        frames: &Range<usize>,
        options: &ClipRetargetOptions,
        run: &Run,
    ) -> Result<ShotGrids, PhotoError> {
        let followed = Followed::new(clip, importance, frames, options.follow_s);
        let starts = self.window_path(&followed, run)?;
        let grid = self.grid();
        let scale = (self.out.0 / grid.width, self.out.1 / grid.height);
        let bounds = Bounds { least: options.min_scale, most: MAX_SCALE };
        let solve = |(moment, start): (usize, &f64)| {
            let mut weights = followed.moments[moment].cell_means(&self.window(*start), grid.cols, grid.rows);
            for w in &mut weights {
                *w = w.max(MIN_WEIGHT);
            }
            axis_aligned::scales(&grid, &weights, scale, bounds, run)
        };
        let solved = starts.par_iter().enumerate().map(solve).collect::<Result<Vec<_>, _>>()?;
        let (columns, rows): (Vec<_>, Vec<_>) = solved.into_iter().unzip();
        let (columns, rows) = (followed.smoothed(&columns), followed.smoothed(&rows));
        let knots = followed.frames.iter().zip(starts).zip(columns.into_iter().zip(rows));
        let knots = knots.map(|((&frame, start), (columns, rows))| Knot { frame, start, columns, rows }).collect();
        Ok(ShotGrids { frames: frames.clone(), knots })
    }

    /// Where the window starts at each moment.
    fn window_path(&self, followed: &Followed, run: &Run) -> Result<Vec<f64>, PhotoError> {
        let kept = self.kept();
        if kept >= 1.0 {
            return Ok(vec![0.0; followed.frames.len()]);
        }
        let scores = |moment| WindowScores::new(&strip_profile(moment, self.along_x(), STRIPS), kept);
        let scores: Vec<WindowScores> = followed.moments.iter().map(scores).collect();
        Ok(window_path::window_path(&scores, &followed.times_s, kept, run)?)
    }
}

impl ClipGrids {
    /// Size of the output, px.
    pub fn size(&self) -> (usize, usize) {
        self.out
    }

    /// The part of width and height that the window keeps.
    pub fn fraction(&self) -> (f64, f64) {
        self.fraction
    }

    /// The grid of a frame; beyond the last shot, that of its end.
    pub fn frame(&self, frame: usize) -> FrameGrid {
        let at = self.shots.partition_point(|s| s.frames.end <= frame).min(self.shots.len().saturating_sub(1));
        let out = (self.out.0 as f64, self.out.1 as f64);
        let shape = Shape { source: self.source, out, fraction: self.fraction };
        let grid = shape.grid();
        let (start, columns, rows) = match self.shots.get(at) {
            Some(shot) if !shot.knots.is_empty() => shot.at(frame),
            _ => (0.5 * (1.0 - shape.kept()), vec![1.0; grid.cols], vec![1.0; grid.rows]),
        };
        let window = shape.window(start);
        let px = |p: Point2| Point2::new(p.x * self.source.0, p.y * self.source.1);
        let window = Rect { min: px(window.min), max: px(window.max) };
        let positions = |scales: &[f64], extent| axis_aligned::positions(scales, extent);
        FrameGrid { window, x: positions(&columns, out.0), y: positions(&rows, out.1) }
    }
}

impl ShotGrids {
    /// The spline at a frame.
    fn at(&self, frame: usize) -> (f64, Vec<f64>, Vec<f64>) {
        let (knots, last) = (&self.knots, self.knots.len() - 1);
        let stride = (knots[last].frame - knots[0].frame) as f64 / last.max(1) as f64;
        let before = knots.partition_point(|k| k.frame <= frame);
        // The span of the spline that starts at control point `first`; beyond the ends, the outermost is repeated.
        let first = before.cast_signed() - 1;
        let at = |k: isize| &knots[k.clamp(0, last.cast_signed()) as usize];
        let from = if before == 0 { knots[0].frame as f64 - stride } else { at(first).frame as f64 };
        let length = if before == 0 || before > last { stride } else { at(first + 1).frame as f64 - from };
        let u = if length > 0.0 { ((frame as f64 - from) / length).clamp(0.0, 1.0) } else { 0.0 };
        let weights = basis(u);
        let controls = [-1, 0, 1, 2].map(|k| at(first + k));
        // Relative to one of the four: constants are reproduced to the bit.
        let mix = |of: &dyn Fn(&Knot) -> f64| {
            let own = of(controls[1]);
            own + weights.iter().zip(controls).map(|(w, k)| w * (of(k) - own)).sum::<f64>()
        };
        let columns = (0..controls[1].columns.len()).map(|c| mix(&|k| k.columns[c])).collect();
        let rows = (0..controls[1].rows.len()).map(|r| mix(&|k| k.rows[r])).collect();
        (mix(&|k| k.start), columns, rows)
    }
}

/// The uniform cubic B-spline's four weights; positive, their sum is 1.
fn basis(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    let (uu, vv) = (u * u, v * v);
    [vv * v / 6.0, (3.0 * uu * u - 6.0 * uu + 4.0) / 6.0, (3.0 * vv * v - 6.0 * vv + 4.0) / 6.0, uu * u / 6.0]
}

#[cfg(test)]
mod tests;
