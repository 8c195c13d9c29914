//! Retargeting of pictures to another size: important objects keep their proportions, lines stay straight, the rest is
//! resized.
//!
//! A grid is laid over the picture, or over the window that is kept of it where the change of shape is extreme
//! (`window.rs`). Each cell is weighted by its importance. Row heights and column widths give an initial guess without
//! folds (`axis_aligned.rs`), which scale-and-stretch with straight lines refines (`scale_and_stretch.rs`,
//! `straight.rs`). The border is exact and no cell folds, whatever the size.
//!
//! [`retarget`] is the one-line call; a [`Retargeter`] keeps everything that does not depend on the size, for
//! interactive resizing.

pub(super) mod axis_aligned;
mod scale_and_stretch;
mod straight;
#[cfg(test)]
mod tests;
mod virtual_points;
mod window;

use nalgebra::Matrix2x3;

use super::{FittedLine, Line, LineReport, Orientation, PhotoError, PhotoWarp};
use axis_aligned::{Bounds, axis_aligned};
use plumbline_image::feature::{Face, Importance};
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::{Map, WarpField};
use plumbline_num::math::{Point2, Rect, Vec2};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;
use scale_and_stretch::{Descent, ScaleAndStretch, Settings};
use straight::Straight;
use virtual_points::virtual_points;
pub(super) use window::{kept_share, strip_profile};

/// Largest side of a picture, px: the largest that JPEG can hold.
const MAX_SIDE: usize = 65_535;
/// Samples at which a line is measured, in addition to the marked points.
const SAMPLES: usize = 64;
/// Angle error, rad, above which the constraint on a line's direction counts as failed: half a degree.
const MAX_ANGLE_ERROR: f64 = 0.01;

/// Options of [`retarget`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetargetOptions {
    /// Approximate number of grid cells, 64 to 10 000, default 1200. Fewer than 400 cannot follow small objects; more
    /// than 2000 take longer than a display frame to re-solve.
    pub cells: usize,
    /// Minimum scale of a cell relative to the plain resize, above 0, below 1, default 0.3. At 0.1 unimportant strips
    /// almost vanish and their texture shows it; at 0.8 the result hardly differs from the plain resize.
    pub min_scale: f64,
    /// Scale above which cells resist stretching, relative to the larger scale of the plain resize, 1 to 1000, default
    /// 2. At 1.1 skies hardly stretch; at 3 they become streaks.
    pub max_scale: f64,
    /// Bending stiffness of grid lines relative to a cell of full importance, at least 0, default 0.3. At 0 the
    /// surroundings of important objects bulge; from 10 on rows and columns stay straight.
    pub bending: f64,
    /// Exponent of the importance, above 0 up to 8, default 1. At 0.5 all texture resists alike and little is gained;
    /// at 4 only the most salient objects resist.
    pub contrast: f64,
    /// Weight of faces relative to a cell of full importance, at least 1, default 10.
    pub face_weight: f64,
    /// Ratio of the scales along the two axes below which the picture is cropped before it is resized, 0 to 1, default
    /// 0.5. 0 never crops; at 0.4 backgrounds of portrait outputs become streaks, and towers and chair legs thin; at
    /// 0.6 the window cuts important objects in two of ten photos at a quarter of the width, at 0.7 more than necessary
    /// is cropped. (Aspect ratio similarity, which counts everything cropped as lost, falls from .76 over .70 to .64 at
    /// 0.4, 0.5 and 0.6 for 9:16, from .52 over .47 to .43 for a quarter of the width.)
    pub crop_below: f64,
    /// Refine rows and columns by scale-and-stretch, default true. Without it, lines that are neither horizontal nor
    /// vertical may bend.
    pub refine: bool,
}

impl Default for RetargetOptions {
    fn default() -> Self {
        Self {
            cells: 1200,
            min_scale: 0.3,
            max_scale: 2.0,
            bending: 0.3,
            contrast: 1.0,
            face_weight: 10.0,
            crop_below: 0.5,
            refine: true,
        }
    }
}

impl RetargetOptions {
    fn check(&self) -> Result<(), OptionError> {
        let check = OptionError::check;
        check((64..=10_000).contains(&self.cells), "cells", self.cells as f64, "64 to 10000")?;
        check(self.min_scale > 0.0 && self.min_scale < 1.0, "min_scale", self.min_scale, "above 0, below 1")?;
        check(self.max_scale >= 1.0 && self.max_scale <= 1e3, "max_scale", self.max_scale, "1 to 1000")?;
        check(self.bending >= 0.0 && self.bending <= 1e6, "bending", self.bending, "0 to 1000000")?;
        check(self.contrast > 0.0 && self.contrast <= 8.0, "contrast", self.contrast, "above 0, at most 8")?;
        check(self.face_weight >= 1.0 && self.face_weight <= 1e6, "face_weight", self.face_weight, "1 to 1000000")?;
        check(self.crop_below >= 0.0 && self.crop_below <= 1.0, "crop_below", self.crop_below, "0 to 1")
    }
}

/// A picture's new shape.
#[derive(Debug)]
pub struct Retargeted {
    /// The map, the grid as it lies in the output, and the lines.
    pub warp: PhotoWarp,
    /// The part of the picture that the output shows, source px; the grid covers it.
    pub window: Rect,
    /// The energy of the initial guess and after every step, non-increasing.
    pub energies: Vec<f64>,
    /// Names of lines whose constraint was dropped because it could not be met together with the others.
    pub released: Vec<String>,
}

/// Gives a picture of `source` px the size `out` px: [`Retargeter::new`] and [`Retargeter::solve`] in one.
///
/// # Errors
/// As those two.
pub fn retarget(
    source: (usize, usize),
    out: (usize, usize),
    importance: &Importance,
    lines: &[Line],
    faces: &[Face],
    options: &RetargetOptions,
    run: &Run,
) -> Result<Retargeted, PhotoError> {
    Retargeter::new(source, importance.clone(), lines.to_vec(), faces.to_vec(), *options)?.solve(out, run)
}

/// Retargets one picture to any size.
#[derive(Debug)]
pub struct Retargeter {
    source: (f64, f64),
    importance: Importance,
    lines: Vec<Line>,
    faces: Vec<Face>,
    options: RetargetOptions,
    /// What depends on the window alone, of the last window.
    prepared: Option<Prepared>,
}

/// The grid over a window, its weights and its energy.
#[derive(Debug)]
struct Prepared {
    window: Rect,
    grid: Grid,
    weights: Vec<f64>,
    /// Lines in px of the window.
    lines: Vec<Line>,
    energy: ScaleAndStretch,
    /// Indices of lines whose constraint was dropped.
    released: Vec<usize>,
}

impl Retargeter {
    /// Takes a picture of `source` px; lines and faces are in px of it.
    ///
    /// # Errors
    /// [`PhotoError::Input`] for a size, a line or a face that is none, [`PhotoError::Option`].
    pub fn new(
        source: (usize, usize),
        importance: Importance,
        lines: Vec<Line>,
        faces: Vec<Face>,
        options: RetargetOptions,
    ) -> Result<Self, PhotoError> {
        options.check()?;
        check_source(source)?;
        let finite = |p: &Point2| p.x.is_finite() && p.y.is_finite();
        let given = |o: Orientation| !matches!(o, Orientation::Angle(a) if !a.is_finite());
        if let Some(line) = lines.iter().find(|l| !(l.points.iter().all(finite) && given(l.orientation))) {
            return Err(PhotoError::Input(format!(
                "line {:?} has a point that is not finite; mark it again",
                line.name
            )));
        }
        let sound = |r: &Rect| finite(&r.min) && finite(&r.max) && r.width() > 0.0 && r.height() > 0.0;
        if let Some(index) = faces.iter().position(|f| !sound(&f.rect)) {
            return Err(PhotoError::Input(format!("face {index} has an empty box or one that is not finite")));
        }
        let source = (source.0 as f64, source.1 as f64);
        Ok(Self { source, importance, lines, faces, options, prepared: None })
    }

    /// The shape for an output of `out` px. What depends on the picture alone is kept from one call to the next; the result
    /// does not depend on earlier calls.
    ///
    /// # Errors
    /// [`PhotoError::Output`] for a size that is none; [`PhotoError::Input`], [`PhotoError::Energy`] where numerics fail;
    /// [`PhotoError::Interrupted`].
    pub fn solve(&mut self, out: (usize, usize), run: &Run) -> Result<Retargeted, PhotoError> {
        check_target(out)?;
        let size = (out.0 as f64, out.1 as f64);
        let window = window::window(self.source, size, &self.importance, self.options.crop_below);
        self.solve_in(window, out, run)
    }

    /// [`Self::solve`] with the window given, px of the picture.
    ///
    /// # Errors
    /// [`PhotoError::Input`] for a window that is empty or reaches outside the picture; as [`Self::solve`] otherwise.
    pub fn solve_in(&mut self, window: Rect, out: (usize, usize), run: &Run) -> Result<Retargeted, PhotoError> {
        check_target(out)?;
        let size = (out.0 as f64, out.1 as f64);
        let slack = 1e-9 * self.source.0.max(self.source.1);
        let inside = window.min.x >= -slack
            && window.min.y >= -slack
            && window.max.x <= self.source.0 + slack
            && window.max.y <= self.source.1 + slack;
        if !(inside && window.width() > slack && window.height() > slack) {
            let Rect { min, max } = window;
            let from_to = format!("from ({}, {}) to ({}, {})", min.x, min.y, max.x, max.y);
            return Err(PhotoError::Input(format!("the window {from_to} is empty or reaches outside the picture")));
        }
        if self.prepared.as_ref().is_none_or(|p| p.window != window || !p.released.is_empty()) {
            self.prepared = Some(self.prepare(window, Vec::new())?);
        }
        loop {
            let prepared = self.prepared.as_mut().expect("set above");
            let (mesh, descent) = prepared.solve(size, &self.options, run)?;
            let reports = prepared.measure(&mesh);
            let bent = prepared.bent(&reports);
            if bent.is_empty() || !self.options.refine {
                return prepared.retargeted(mesh, &descent, reports, out);
            }
            let released = [std::mem::take(&mut prepared.released), bent].concat();
            self.prepared = Some(self.prepare(window, released)?);
        }
    }

    fn prepare(&self, window: Rect, released: Vec<usize>) -> Result<Prepared, PhotoError> {
        let (w, h) = (window.width(), window.height());
        let grid = grid_over(w, h, self.options.cells);
        let weights = self.weights(&window, &grid);
        let lines: Vec<Line> = self.lines.iter().map(|line| moved(line, -window.min.coords)).collect();
        let constrained = lines.iter().enumerate().filter(|(i, _)| !released.contains(i));
        let straight =
            constrained.filter_map(|(_, line)| Straight::new(virtual_points(line, &grid), line.orientation)).collect();
        let RetargetOptions { bending, min_scale: least, max_scale: most, .. } = self.options;
        let settings = Settings { bending, least, most, max_iterations: MAX_ITERATIONS, tolerance: TOLERANCE };
        let energy = ScaleAndStretch::new(grid, weights.clone(), straight, settings)?;
        Ok(Prepared { window, grid, weights, lines, energy, released })
    }

    /// Weights of the cells: importance, and more where faces are.
    fn weights(&self, window: &Rect, grid: &Grid) -> Vec<f64> {
        let fraction = |p: Point2| Point2::new(p.x / self.source.0, p.y / self.source.1);
        let in_picture = Rect { min: fraction(window.min), max: fraction(window.max) };
        let mut weights = self.importance.cell_means(&in_picture, grid.cols, grid.rows);
        for w in &mut weights {
            *w = w.powf(self.options.contrast);
        }
        let (cw, ch) = grid.cell_size();
        for face in &self.faces {
            // Hair, ears and chin are outside the detector's box.
            let margin = Vec2::new(0.25 * face.rect.width(), 0.4 * face.rect.height()) + Vec2::new(0.5 * cw, 0.5 * ch);
            let reach = Rect { min: face.rect.min - margin, max: face.rect.max + margin };
            for (cell, w) in weights.iter_mut().enumerate() {
                let (c, r) = ((cell % grid.cols) as f64 + 0.5, (cell / grid.cols) as f64 + 0.5);
                if reach.contains(window.min + Vec2::new(c * cw, r * ch)) {
                    *w = self.options.face_weight;
                }
            }
        }
        // A mask may be zero; cells without weight would be undetermined.
        for w in &mut weights {
            *w = w.max(MIN_WEIGHT);
        }
        weights
    }
}

/// Maximum number of Gauss–Newton iterations; most pictures take five to ten.
const MAX_ITERATIONS: usize = 25;
/// Relative energy decrease per iteration below which the solver stops: the displacement left is below a hundredth of a
/// cell.
const TOLERANCE: f64 = 5e-4;
/// Upper bound on the initial guess's scales relative to the scale where strain sets in. At 1, a maximum scale of 1
/// would leave it no freedom.
const INITIAL_STRETCH: f64 = 1.25;
/// Minimum weight of a cell: keeps the energy definite where a mask gives no importance at all.
const MIN_WEIGHT: f64 = 1e-3;

/// Refuses a picture without pixels, or one too large for maps.
pub(super) fn check_source((width, height): (usize, usize)) -> Result<(), PhotoError> {
    let refused = || format!("the picture has {width}×{height} px (expected 1 to {MAX_SIDE} each way)");
    is_size((width, height)).then_some(()).ok_or_else(|| PhotoError::Input(refused()))
}

/// Refuses an output without pixels, or one too large for maps.
pub(super) fn check_target((width, height): (usize, usize)) -> Result<(), PhotoError> {
    let refused = || format!("target size {width}×{height} px is invalid (expected 1 to {MAX_SIDE} each way)");
    is_size((width, height)).then_some(()).ok_or_else(|| PhotoError::Output(refused()))
}

fn is_size((width, height): (usize, usize)) -> bool {
    (1..=MAX_SIDE).contains(&width) && (1..=MAX_SIDE).contains(&height)
}

/// A grid of about square cells.
pub(super) fn grid_over(width: f64, height: f64, cells: usize) -> Grid {
    let along = |a: f64, b: f64| ((cells as f64 * a / b).sqrt().round() as usize).clamp(4, cells / 4);
    Grid { cols: along(width, height), rows: along(height, width), width, height }
}

fn moved(line: &Line, by: Vec2) -> Line {
    Line { points: line.points.iter().map(|p| p + by).collect(), ..line.clone() }
}

impl Prepared {
    fn solve(
        &mut self,
        size: (f64, f64),
        options: &RetargetOptions,
        run: &Run,
    ) -> Result<(GridMesh, Descent), PhotoError> {
        let plain = plain_resize(&self.grid, size);
        let similar = (size.0 * self.grid.height - size.1 * self.grid.width).abs() < 1e-12 * size.0 * self.grid.height;
        let bounds = Bounds { least: options.min_scale, most: INITIAL_STRETCH * options.max_scale };
        let mut mesh = if similar { plain } else { axis_aligned(&self.grid, &self.weights, size, bounds, run)? };
        if !options.refine {
            return Ok((mesh, Descent { energies: Vec::new(), converged: true }));
        }
        let descent = self.energy.minimize(&mut mesh, size, run)?;
        Ok((mesh, descent))
    }

    fn measure(&self, mesh: &GridMesh) -> Vec<LineReport> {
        self.lines.iter().map(|line| report(line, &self.grid, mesh)).collect()
    }

    /// Indices of the constrained lines that are bent or have the wrong direction. A free line can always be straight:
    /// while a line of given direction fails, only that one is dropped.
    fn bent(&self, reports: &[LineReport]) -> Vec<usize> {
        let bent = |r: &LineReport| r.is_bent() || r.angle_error.is_some_and(|e| e.abs() > MAX_ANGLE_ERROR);
        let failed = (0..reports.len()).filter(|&i| bent(&reports[i]) && !self.released.contains(&i));
        let (given, free): (Vec<usize>, Vec<usize>) = failed.partition(|&i| reports[i].angle_error.is_some());
        if given.is_empty() { free } else { given }
    }

    fn retargeted(
        &self,
        mesh: GridMesh,
        descent: &Descent,
        lines: Vec<LineReport>,
        size: (usize, usize),
    ) -> Result<Retargeted, PhotoError> {
        let mut field = WarpField::from_forward_mesh(&mesh, self.grid.width, self.grid.height)?;
        if self.window.min != Point2::origin() {
            let (x, y) = (self.window.min.x, self.window.min.y);
            field = field.then(Map::Affine(Matrix2x3::new(1.0, 0.0, x, 0.0, 1.0, y)));
        }
        let iterations = descent.energies.len().saturating_sub(1);
        let (grid, moved, corner) = (self.grid, mesh.clone(), self.window.min.coords);
        let forward = Box::new(move |p: Point2| Some(moved.at(grid.locate(p - corner)?)));
        let warp = PhotoWarp { lines, iterations, ..PhotoWarp::new(field, size, mesh, forward) };
        let released = self.released.iter().map(|&i| self.lines[i].name.clone()).collect();
        let energies = descent.energies.clone();
        Ok(Retargeted { warp, window: self.window, energies, released })
    }
}

/// The grid scaled to `size`.
fn plain_resize(grid: &Grid, size: (f64, f64)) -> GridMesh {
    let at = |i: usize, n: usize, extent: f64| if i == n { extent } else { extent * i as f64 / n as f64 };
    let vertex = |i: usize| {
        let (col, row) = (i % (grid.cols + 1), i / (grid.cols + 1));
        Point2::new(at(col, grid.cols, size.0), at(row, grid.rows, size.1))
    };
    GridMesh { cols: grid.cols, rows: grid.rows, vertices: (0..grid.vertex_count()).map(vertex).collect() }
}

/// The report on a line in the output.
fn report(line: &Line, grid: &Grid, mesh: &GridMesh) -> LineReport {
    let samples = sampled(line);
    let shown: Vec<Point2> = samples.iter().filter_map(|&p| grid.locate(p)).map(|p| mesh.at(p)).collect();
    let fitted = FittedLine::through(&shown);
    let off = |p: &Point2| fitted.map_or(0.0, |line| line.off(*p).abs());
    let squares: f64 = shown.iter().map(|p| off(p).powi(2)).sum();
    let direction = fitted.map_or(Vec2::x(), |line| line.direction);
    let angle = within_half_turn(direction.y.atan2(direction.x));
    let wanted = line.orientation.angle();
    LineReport {
        name: line.name.clone(),
        max_px: shown.iter().map(off).fold(0.0, f64::max),
        rms_px: (squares / shown.len().max(1) as f64).sqrt(),
        length_px: match (shown.first(), shown.last()) {
            (Some(a), Some(b)) => (b - a).norm(),
            _ => 0.0,
        },
        angle,
        angle_error: wanted.filter(|_| fitted.is_some()).map(|wanted| within_half_turn(angle - wanted)),
        off_lens_px: None,
        shown: shown.len() as f64 / samples.len().max(1) as f64,
        edge: None,
    }
}

/// An angle of a line without direction: in (−π/2, π/2].
fn within_half_turn(angle: f64) -> f64 {
    let turned = angle.rem_euclid(std::f64::consts::PI);
    if turned > std::f64::consts::FRAC_PI_2 { turned - std::f64::consts::PI } else { turned }
}

/// The marked points and points between them, about evenly spread.
fn sampled(line: &Line) -> Vec<Point2> {
    let length = |ends: &[Point2]| (ends[1] - ends[0]).norm();
    let total: f64 = line.points.windows(2).map(length).sum();
    let mut samples: Vec<Point2> = line.points.first().copied().into_iter().collect();
    for ends in line.points.windows(2) {
        let pieces = if total > 0.0 { (SAMPLES as f64 * length(ends) / total).ceil().max(1.0) as usize } else { 1 };
        samples.extend((1..=pieces).map(|k| ends[0] + (ends[1] - ends[0]) * (k as f64 / pieces as f64)));
    }
    samples
}
