//! Rectangling of panoramas with an irregular outline.
//!
//! Stitched pictures have an irregular border. A crop to the largest rectangle loses much of the picture, inpainting
//! invents content; warping keeps everything at the cost of a small distortion. The outline is detected (`outline.rs`; what it
//! says of the picture, `verdict.rs`),
//! the picture is expanded to its bounding rectangle by seams, which places the initial grid (`seams.rs`,
//! `initial_grid.rs`), and the grid is solved for shapes, lines and a straight border (`energy.rs`). Then the aspect
//! ratio with the least stretch is chosen: with `s_x`, `s_y` the mean growth of the cells along x and y, a rectangle of
//! `w/s_x × h/s_y` leaves none, and the grid is solved again in it.
//!
//! **Folds.** The grid in the picture has none. A solution with folds is solved again with four times the weight of the
//! folded cells, and finally interpolated back to the last one without folds.
//!
//! # Reference
//! K. He, H. Chang, J. Sun, *Rectangling panoramic images via warping*, ACM Trans. Graph. (SIGGRAPH) 32 (2013).

mod energy;
mod initial_grid;
mod outline;
mod seams;
#[cfg(test)]
mod tests;
mod verdict;

use nalgebra::{Matrix2, Vector2};

pub use outline::Outline;

use super::rectify::{drawn_back, with_neighbors};
use super::warp::{MAX_SIDE, PhotoWarp};
use super::{Line, PhotoError, report};
use energy::Rectangling;
use plumbline_image::PlaneRef;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_image::warp::{InverseMesh, Map, WarpField};
use plumbline_num::math::{Point2, PointMap, Rect};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

/// Alternations between grid and rotations for each shape of the rectangle, as in the paper.
const ITERATIONS: usize = 10;
/// Attempts with fourfold weight of folded cells before the grid is interpolated back: `4⁶` exceeds the default weight
/// of lines.
const MAX_FOLD_ITERATIONS: usize = 6;
/// Minimum fraction of the picture inside its outline: below, the detected border is not one of stitching.
const MIN_INSIDE: f64 = 0.2;
/// Points along the longer side at which the result is checked for pixels from outside the outline.
const RASTER: usize = 600;

/// Shape of the output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum RectangleShape {
    /// The aspect ratio with the least stretch, at the density of the picture.
    #[default]
    Natural,
    /// This ratio of width to height, at the density of the picture.
    Aspect(f64),
    /// Width and height, px.
    Exact(usize, usize),
}

/// Options of [`rectangle`].
#[derive(Clone, Debug, PartialEq)]
pub struct RectangleOptions {
    /// Shape of the output.
    pub shape: RectangleShape,
    /// Approximate number of grid cells, 64 to 10 000, default 1600. With 400, as in the paper, ragged outlines lose
    /// more of the picture.
    pub cells: usize,
    /// `λ`: weight of line straightness relative to cell shape, 0 to 1e8, default 1000.
    pub straightness: f64,
    /// Weight of cells with faces, 1 to 1e6, default 10.
    pub faces: f64,
}

impl Default for RectangleOptions {
    fn default() -> Self {
        Self { shape: RectangleShape::default(), cells: 1600, straightness: 1000.0, faces: 10.0 }
    }
}

/// A picture to make rectangular.
#[derive(Clone, Copy, Debug)]
pub struct RectangleInput<'a> {
    /// Width and height, px.
    pub size: (usize, usize),
    /// The outline of the picture.
    pub outline: &'a Outline,
    /// Its gray levels, at any resolution.
    pub luma: PlaneRef<'a, u8>,
    /// Lines that stay straight, px.
    pub lines: &'a [Line],
    /// Faces that keep their shape, px.
    pub faces: &'a [Rect],
}

/// A picture as a rectangle.
#[derive(Debug)]
pub struct Rectangled {
    /// The map, the grid in the output, the lines.
    pub warp: PhotoWarp,
    /// Mean growth of the cells along x and y, before the scale of an exact size.
    pub stretch: [f64; 2],
    /// Fraction of the output from outside the outline.
    pub outside: f64,
}

/// The warp that makes a picture with an irregular outline a rectangle.
///
/// # Errors
/// [`PhotoError`]: an option out of range, an outline of nothing or too ragged, an interruption.
pub fn rectangle(input: &RectangleInput<'_>, options: &RectangleOptions, run: &Run) -> Result<Rectangled, PhotoError> {
    check(options)?;
    let share = input.outline.inside_fraction();
    if share < MIN_INSIDE {
        let percent = 100.0 * share;
        return Err(PhotoError::Input(format!(
            "only {percent:.1} % of the picture lies inside its border (expected at least {:.0}): is it the right picture?",
            100.0 * MIN_INSIDE
        )));
    }
    let source = initial_grid::initial_grid(input.outline, input.luma, input.size, options.cells, run)?;
    let weights = weights(&source, input.faces, options.faces);
    let lines: Vec<Line> = input.lines.iter().filter(|line| !input.outline.runs_along(line)).cloned().collect();
    let mut energy = Rectangling::new(&source, &lines, weights, options.straightness)?;
    let bounds = input.outline.bounds_px();
    let first = shaped((bounds.width(), bounds.height()), options.shape);
    let (mut mesh, mut solves) = solved(&mut energy, regular(&source, first), first, run)?;
    let mut size = first;
    if options.shape == RectangleShape::Natural {
        let [sx, sy] = stretch(&source, &mesh);
        size = (first.0 / sx, first.1 / sy);
        let start = scaled(&mesh, size.0 / first.0, size.1 / first.1);
        let (again, more) = solved(&mut energy, start, size, run)?;
        (mesh, solves) = (again, solves + more);
    }
    let stretch = stretch(&source, &mesh);
    let out = pixels(size, options.shape)?;
    let mesh = scaled(&mesh, out.0 as f64 / size.0, out.1 as f64 / size.1);
    let mut warp = warp(&source, mesh, out, solves)?;
    warp.lines = lines.iter().map(|line| report::of_line(line, None, &warp)).collect();
    let outside = outside(&warp, input.outline);
    Ok(Rectangled { warp, stretch, outside })
}

fn check(options: &RectangleOptions) -> Result<(), PhotoError> {
    let aspect = if let RectangleShape::Aspect(aspect) = options.shape { aspect } else { 1.0 };
    let (width, height) = if let RectangleShape::Exact(w, h) = options.shape { (w, h) } else { (1, 1) };
    let side = |n: usize| (1..=MAX_SIDE).contains(&n);
    let check = OptionError::check;
    check((0.01..=100.0).contains(&aspect), "ratio of the rectangle", aspect, "0.01 to 100")?;
    check(side(width), "width of the output", width as f64, "1 to 16384 px")?;
    check(side(height), "height of the output", height as f64, "1 to 16384 px")?;
    check((64..=10_000).contains(&options.cells), "cells", options.cells as f64, "64 to 10000")?;
    check((0.0..=1e8).contains(&options.straightness), "straightness", options.straightness, "0 to 1e8")?;
    check((1.0..=1e6).contains(&options.faces), "weight of faces", options.faces, "1 to 1e6")?;
    Ok(())
}

/// The rectangle of the wanted shape with the area of another.
fn shaped((width, height): (f64, f64), shape: RectangleShape) -> (f64, f64) {
    let aspect = match shape {
        RectangleShape::Natural => return (width, height),
        RectangleShape::Aspect(aspect) => aspect,
        RectangleShape::Exact(w, h) => w as f64 / h as f64,
    };
    let area = width * height;
    ((area * aspect).sqrt(), (area / aspect).sqrt())
}

fn pixels(size: (f64, f64), shape: RectangleShape) -> Result<(usize, usize), PhotoError> {
    if let RectangleShape::Exact(w, h) = shape {
        return Ok((w, h));
    }
    let side = |name, v: f64| {
        let px = v.round();
        let valid = (1.0..=MAX_SIDE as f64).contains(&px);
        OptionError::check(valid, name, v, "1 to 16384 px").map(|()| px as usize)
    };
    Ok((side("width of the output", size.0)?, side("height of the output", size.1)?))
}

/// Cell weights: `face` at faces, 1 elsewhere.
fn weights(source: &GridMesh, faces: &[Rect], face: f64) -> Vec<f64> {
    let weight = |cell: usize| {
        let center = source.quad(cell).at(0.5, 0.5);
        let near = |r: &Rect| {
            let d = center - r.center();
            d.x.abs() < 0.75 * r.width() && d.y.abs() < 0.9 * r.height()
        };
        if faces.iter().any(near) { face } else { 1.0 }
    };
    (0..source.cols * source.rows).map(weight).collect()
}

fn regular(source: &GridMesh, (width, height): (f64, f64)) -> GridMesh {
    Grid { cols: source.cols, rows: source.rows, width, height }.to_mesh()
}

fn scaled(mesh: &GridMesh, x: f64, y: f64) -> GridMesh {
    let vertices = mesh.vertices.iter().map(|v| Point2::new(v.x * x, v.y * y)).collect();
    GridMesh { cols: mesh.cols, rows: mesh.rows, vertices }
}

/// The solution over a rectangle, given a grid without folds, and the number of solves.
fn solved(
    energy: &mut Rectangling<'_>,
    mut sound: GridMesh,
    size: (f64, f64),
    run: &Run,
) -> Result<(GridMesh, usize), PhotoError> {
    let mut solves = 0;
    for _ in 0..MAX_FOLD_ITERATIONS {
        let mut found = energy.solve(size, None, run)?;
        for _ in 0..ITERATIONS {
            run.check()?;
            let rotations = energy.rotations(&found);
            found = energy.solve(size, Some(&rotations), run)?;
        }
        solves += ITERATIONS + 1;
        let folded: Vec<usize> =
            (0..energy.weights.len()).filter(|&cell| !(found.quad(cell).min_jacobian() > 0.0)).collect();
        if folded.is_empty() {
            return Ok((found, solves));
        }
        sound = drawn_back(&sound, &found);
        stiffen(&mut energy.weights, &folded, (found.cols, found.rows));
    }
    Ok((sound, solves))
}

/// Four times the weight in these cells and those around them.
fn stiffen(weights: &mut [f64], folded: &[usize], size: (usize, usize)) {
    let touched = with_neighbors(folded, size);
    weights.iter_mut().zip(touched).filter(|(_, touched)| *touched).for_each(|(w, _)| *w *= 4.0);
}

/// Mean growth of the cells along x and y.
fn stretch(source: &GridMesh, out: &GridMesh) -> [f64; 2] {
    let cells = source.cols * source.rows;
    let extent = |mesh: &GridMesh, cell: usize, axis: usize| {
        let along = mesh.quad(cell).0.map(|p| p[axis]);
        along.into_iter().fold(f64::MIN, f64::max) - along.into_iter().fold(f64::MAX, f64::min)
    };
    let mean = |axis: usize| {
        (0..cells).map(|cell| extent(out, cell, axis) / extent(source, cell, axis)).sum::<f64>() / cells as f64
    };
    [mean(0), mean(1)]
}

/// The warp of a grid in the picture and in the output.
fn warp(source: &GridMesh, mesh: GridMesh, size: (usize, usize), iterations: usize) -> Result<PhotoWarp, PhotoError> {
    let (cols, rows) = (source.cols as f64, source.rows as f64);
    let grid = Grid { cols: source.cols, rows: source.rows, width: cols, height: rows };
    let inverse = Map::Mesh(InverseMesh::new(&mesh, cols, rows)?);
    let field = WarpField { chain: vec![inverse, Map::Radial(Box::new(InPicture { grid, mesh: source.clone() }))] };
    let (back, moved) = (InverseMesh::new(source, cols, rows)?, mesh.clone());
    let forward = Box::new(move |p: Point2| Some(moved.at(grid.locate(back.map(p)?)?)));
    Ok(PhotoWarp { iterations, ..PhotoWarp::new(field, size, mesh, forward) })
}

/// From the unit cells of a grid to the picture.
#[derive(Clone, Debug)]
struct InPicture {
    grid: Grid,
    mesh: GridMesh,
}

impl PointMap for InPicture {
    fn map(&self, p: Point2) -> Option<Point2> {
        let clamped = Point2::new(p.x.clamp(0.0, self.grid.width), p.y.clamp(0.0, self.grid.height));
        Some(self.mesh.at(self.grid.locate(clamped)?))
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let clamped = Point2::new(p.x.clamp(0.0, self.grid.width), p.y.clamp(0.0, self.grid.height));
        let at = self.grid.locate(clamped)?;
        let [a, b, c, d] = self.mesh.quad(at.cell).0;
        let along: Vector2<f64> = (b - a) * (1.0 - at.t) + (d - c) * at.t;
        let down: Vector2<f64> = (c - a) * (1.0 - at.s) + (d - b) * at.s;
        Some(Matrix2::from_columns(&[along, down]))
    }
}

/// Fraction of the output from outside the outline.
fn outside(warp: &PhotoWarp, outline: &Outline) -> f64 {
    let (width, height) = (warp.size.0 as f64, warp.size.1 as f64);
    let step = width.max(height) / RASTER as f64;
    let count = |length: f64| (length / step).ceil().max(1.0) as usize;
    let (cols, rows) = (count(width), count(height));
    let at = |k: usize| {
        let (i, j) = ((k % cols) as f64 + 0.5, (k / cols) as f64 + 0.5);
        Point2::new(width * i / cols as f64, height * j / rows as f64)
    };
    let lost = (0..cols * rows).filter(|&k| !warp.field.map(at(k)).is_some_and(|p| outline.contains(p))).count();
    lost as f64 / (cols * rows) as f64
}
