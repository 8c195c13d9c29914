//! The initial grid: the regular grid of the expanded rectangle, mapped back through the seams.
//!
//! Seam displacements are integral and clustered; the grid is smoothed, its border sliding along the outline, until no
//! cell folds. Then the border is moved inwards until the straight edges between its vertices lie inside the outline,
//! so that every cell contains only picture.

use super::outline::{Depth, Outline};
use super::seams::Canvas;
use crate::PhotoError;
use crate::retarget::grid_over;
use plumbline_image::PlaneRef;
use plumbline_image::grid::{Grid, GridMesh};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::Run;

/// Depth of the grid's border inside the outline, blocks: below half a block, so that little picture is lost.
const MARGIN: f64 = 0.4;
/// Minimum and maximum number of smoothing iterations: the first spreads the integral steps of seams over neighboring
/// cells, the second bounds the time before a coarser grid is tried.
const SMOOTHING_ITERATIONS: (usize, usize) = (4, 400);
/// Maximum distance, blocks, that a border vertex moves towards the outline per iteration: larger steps may cross the
/// picture's concavities.
const MAX_STEP: f64 = 3.0;
/// Maximum number of iterations that move the border inwards; the loop ends earlier as soon as no edge leaves the
/// outline.
const MAX_INSET_ITERATIONS: usize = 200;
/// Number of cells of the coarsest grid that is tried: the lower limit of the option.
const MIN_CELLS: usize = 64;
/// Points at which an edge of the border is checked.
const SAMPLES: usize = 33;

/// The outline cannot be laid out without folds.
fn ragged() -> PhotoError {
    PhotoError::Input("the outline of the picture is too ragged to become a rectangle: crop it first".to_owned())
}

/// The grid of about `cells` cells, px of the picture; `luma` is the picture at any resolution.
pub(super) fn initial_grid(
    outline: &Outline,
    luma: PlaneRef<'_, u8>,
    size: (usize, usize),
    cells: usize,
    run: &Run,
) -> Result<GridMesh, PhotoError> {
    let [x0, y0, x1, y1] = outline.bounds();
    let (width, height) = (x1 - x0, y1 - y0);
    let inside: Vec<bool> =
        (0..width * height).map(|k| outline.inside[(y0 + k / width) * outline.cols + x0 + k % width]).collect();
    let level = |k: usize| {
        let sample = |i: usize, px: usize, n: usize| {
            let center = (i as f64 + 0.5) * outline.block as f64 / px as f64 * n as f64;
            (center as usize).min(n - 1)
        };
        let y = sample(y0 + k / width, size.1, luma.height());
        f32::from(luma.row(y)[sample(x0 + k % width, size.0, luma.width())])
    };
    let gray = (0..width * height).map(level).collect();
    let mut canvas = Canvas::new(width, height, gray, inside.iter().map(|v| !v).collect());
    if !canvas.grow(run)? {
        return Err(ragged());
    }
    let depth = Depth::of(width, height, &inside);
    let laid = |cells: usize| {
        let mut mesh = carried_back(&canvas, &grid_over(width as f64, height as f64, cells));
        smooth(&mut mesh, Some(&depth));
        inset(&mut mesh, &depth);
        smooth(&mut mesh, None);
        (mesh.folded_cells() == 0).then_some(mesh)
    };
    // A coarser grid follows a ragged outline less closely.
    let mut coarser = std::iter::successors(Some(cells), |n| Some(n / 2)).take_while(|n| *n >= MIN_CELLS);
    let mesh = coarser.find_map(|cells| if run.check().is_ok() { laid(cells) } else { None });
    let mut mesh = run.complete(mesh)?.ok_or_else(ragged)?;
    let (origin, block) = (Vec2::new(x0 as f64, y0 as f64), outline.block as f64);
    mesh.vertices.iter_mut().for_each(|v| *v = Point2::from((v.coords + origin) * block));
    Ok(mesh)
}

/// The grid's vertices where the pixels under them came from.
fn carried_back(canvas: &Canvas, grid: &Grid) -> GridMesh {
    let (width, height) = (grid.width as usize, grid.height as usize);
    let vertex = |k: usize| {
        let v = grid.vertex(k);
        let (i, j) = ((v.x as usize).min(width - 1), (v.y as usize).min(height - 1));
        let (x, y) = canvas.source()[j * width + i];
        Point2::new(f64::from(x) + v.x - i as f64, f64::from(y) + v.y - j as f64)
    };
    GridMesh { cols: grid.cols, rows: grid.rows, vertices: (0..grid.vertex_count()).map(vertex).collect() }
}

/// Whether a vertex lies on the sides, and its neighbors: along the side for those that do, around for all others. Corners
/// have none.
fn neighbors(mesh: &GridMesh, k: usize) -> (bool, Vec<usize>) {
    let stride = mesh.cols + 1;
    let (i, j) = (k % stride, k / stride);
    let (level, upright) = (j == 0 || j == mesh.rows, i == 0 || i == mesh.cols);
    match (level, upright) {
        (true, true) => (true, Vec::new()),
        (true, false) => (true, vec![k - 1, k + 1]),
        (false, true) => (true, vec![k - stride, k + stride]),
        (false, false) => (false, vec![k - 1, k + 1, k - stride, k + stride]),
    }
}

/// Moves vertices half the way to the middle of their neighbors until no cell folds; those of the border along the outline where
/// its depth is given, and not at all otherwise.
fn smooth(mesh: &mut GridMesh, depth: Option<&Depth>) {
    let around: Vec<(bool, Vec<usize>)> = (0..mesh.vertices.len()).map(|k| neighbors(mesh, k)).collect();
    let least = if depth.is_some() { SMOOTHING_ITERATIONS.0 } else { 0 };
    for iteration in 0..SMOOTHING_ITERATIONS.1 {
        if iteration >= least && mesh.folded_cells() == 0 {
            return;
        }
        let before = mesh.vertices.clone();
        for (k, (border, near)) in around.iter().enumerate() {
            let count = near.len() as f64;
            let mean = near.iter().fold(Vec2::zeros(), |sum, &n| sum + before[n].coords / count);
            let mut v = if near.is_empty() { before[k].coords } else { 0.5 * (before[k].coords + mean) };
            match (border, depth) {
                (true, None) => continue,
                (true, Some(depth)) => v -= depth.inwards(v) * (depth.at(v) - MARGIN).clamp(-MAX_STEP, MAX_STEP),
                (false, _) => {}
            }
            mesh.vertices[k] = Point2::from(v);
        }
    }
}

/// The vertices of the border, once around.
fn around(mesh: &GridMesh) -> Vec<usize> {
    let (cols, rows, stride) = (mesh.cols, mesh.rows, mesh.cols + 1);
    let down = (1..=rows).map(move |j| j * stride + cols);
    let back = (0..cols).rev().map(move |i| rows * stride + i);
    let up = (1..rows).rev().map(move |j| j * stride);
    (0..=cols).chain(down).chain(back).chain(up).collect()
}

/// Moves the border inwards until its edges lie inside the outline.
fn inset(mesh: &mut GridMesh, depth: &Depth) {
    let border = around(mesh);
    for _ in 0..MAX_INSET_ITERATIONS {
        let mut push = vec![Vec2::zeros(); border.len()];
        for n in 0..border.len() {
            let ends = [n, (n + 1) % border.len()];
            let [a, b] = ends.map(|n| mesh.vertices[border[n]].coords);
            for k in 0..SAMPLES {
                let t = k as f64 / (SAMPLES - 1) as f64;
                let p = a + (b - a) * t;
                let lacks = MARGIN - depth.at(p);
                let direction = depth.inwards(p) * lacks;
                for (n, w) in [(ends[0], 1.0 - t), (ends[1], t)] {
                    if lacks > 1e-3 && (direction * w).norm() > push[n].norm() {
                        push[n] = direction * w;
                    }
                }
            }
        }
        if push.iter().all(|p| *p == Vec2::zeros()) {
            return;
        }
        for (&k, push) in border.iter().zip(&push) {
            mesh.vertices[k] += *push;
        }
    }
}
