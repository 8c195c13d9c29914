//! Scale-and-stretch: cells that matter change size alike both ways, the others take up the rest.
//!
//! Each cell `f` would like to be scaled by some `s_f`, the same along x and y; grid lines would like to keep their
//! direction. Over the edges `e = v_i − v_j` of the cells, with `'` for the output,
//!
//! ```text
//! E = Σ_f w_f Σ_{e ∈ f} |e' − s_f e|²  +  λ Σ_f Σ_{e ∈ f} |e' − l_e e|²  +  strain  +  lines,
//! ```
//!
//! border vertices sliding along their sides. The paper alternates between `s_f`, `l_e` (closed forms of the present mesh)
//! and the mesh. For a given mesh the best `s_f` is the mean over the cell's edges of `a_e = (e'·e)/|e|²`, which makes the
//! first sum a quadratic form in the mesh alone: the spread of the four `a_e` about their mean, plus what edges deviate
//! sideways. The same holds for `l_e = a_e` of the second sum, which is left with the sideways deviations. So `s` and `l` are
//! eliminated and the fixed point of the alternation is reached in one solve. (The paper's `l_e = |e'|/|e|` differs at second
//! order of the deviation.)
//!
//! Three departures from the paper. The first sum is divided by the square of the cell's own size (geometric mean of
//! its scales along x and y), and sideways deviations by the plain resize's: otherwise a cell distorts the less the
//! smaller it is, and squeezing unimportant cells costs too little compared with scaling important ones. *Strain* keeps
//! cells from vanishing, turning over and becoming streaks: with `a` the scale of an edge,
//!
//! ```text
//! κ Σ_f Σ_{e ∈ f} [2 m/a − 1]₊² + ς² x² (1 + 2x)²,      x = [a/M − 1]₊,
//! ```
//!
//! rises without bound as an edge shortens towards nothing, steeply as it grows, and is zero between twice the least
//! scale `m` and the largest, `M`. `E` is minimized by Gauss–Newton steps from the axis-aligned initial guess, with a
//! line search that halves a step until `E` decreases and no cell folds. Lines: see `straight.rs`.
//!
//! A plain resize of equal weights costs the same in every cell, hence is stationary; of one scale both ways it costs nothing.
//!
//! # Reference
//! Y.-S. Wang, C.-L. Tai, O. Sorkine, T.-Y. Lee, *Optimized scale-and-stretch for image resizing*, ACM Trans. Graph.
//! (SIGGRAPH Asia) 27 (2008), section 3.3.

use super::straight::{LinePosition, Straight};
use crate::PhotoError;
use plumbline_image::grid::{Grid, GridMesh, Quad};
use plumbline_num::energy::{Ordering, QuadraticEnergy};
use plumbline_num::math::Point2;
use plumbline_num::run::Run;

/// `κ`: at 0.01 the least important cells end at 1.05 `m`, at 1 near 2 `m`.
const STRAIN: f64 = 0.1;
/// `ς`: at 0.1 skies become streaks, at 1 they hardly stretch.
const STRETCH: f64 = 0.4;
/// Lower bound on a cell's Jacobian, as a fraction of the minimum area `m_x m_y |cell|`: keeps the line search away
/// from folds that rounding could produce.
const MIN_DETERMINANT: f64 = 0.02;
/// Energy below which the initial mesh is optimal up to rounding.
const NEGLIGIBLE_ENERGY: f64 = 1e-12;
/// Maximum halvings of a step in the line search; after 20 the step is below 10⁻⁶ of a Gauss–Newton step.
const MAX_HALVINGS: usize = 20;

/// Weights and stopping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    /// `λ`.
    pub(super) bending: f64,
    /// `m` relative to the plain resize.
    pub(super) least: f64,
    /// `M` relative to the larger scale of the plain resize.
    pub(super) most: f64,
    /// Maximum number of iterations.
    pub(super) max_iterations: usize,
    /// Relative energy decrease per iteration below which the solver stops.
    pub(super) tolerance: f64,
}

/// How a minimization went.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Descent {
    /// The energy of the initial mesh and after every step: non-increasing.
    pub(super) energies: Vec<f64>,
    /// True where the tolerance was reached.
    pub(super) converged: bool,
}

/// The energy of one grid, its weights and its lines: the pattern is analyzed once, sizes may follow.
#[derive(Debug)]
pub(super) struct ScaleAndStretch {
    grid: Grid,
    weights: Vec<f64>,
    lines: Vec<Straight>,
    settings: Settings,
    /// Whether each coordinate (x of vertex 0, y of vertex 0, x of vertex 1, …) is free, and if so its unknown.
    unknown_of: Vec<Option<u32>>,
    energy: QuadraticEnergy,
}

/// Scales and sideways deviations of a cell's edges: top, bottom, left, right.
#[derive(Clone, Copy)]
struct Edges {
    along: [f64; 4],
    aside: [f64; 4],
}

impl Edges {
    /// Scale of the cell: geometric mean of the mean scales along x and along y.
    fn size(&self) -> f64 {
        let [top, bottom, left, right] = self.along;
        (0.25 * (top + bottom) * (left + right)).sqrt()
    }

    /// Derivatives of the logarithm of [`Self::size`] by the scales of the edges.
    fn growth(&self) -> [f64; 4] {
        let [top, bottom, left, right] = self.along;
        let (x, y) = (0.5 / (top + bottom), 0.5 / (left + right));
        [x, x, y, y]
    }
}

/// Corners of the edges, from → to.
const EDGES: [[usize; 2]; 4] = [[0, 1], [2, 3], [0, 2], [1, 3]];
/// An orthonormal basis of the four edge scales orthogonal to their mean.
const SPREAD: [[f64; 4]; 3] = [
    [std::f64::consts::FRAC_1_SQRT_2, -std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0],
    [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, -std::f64::consts::FRAC_1_SQRT_2],
    [0.5, 0.5, -0.5, -0.5],
];

impl ScaleAndStretch {
    /// Analyzes the pattern.
    ///
    /// # Errors
    /// [`PhotoError::Energy`] where the pattern cannot be analyzed.
    pub(super) fn new(
        grid: Grid,
        weights: Vec<f64>,
        lines: Vec<Straight>,
        settings: Settings,
    ) -> Result<Self, PhotoError> {
        let (unknown_of, mut count) = number_free_coordinates(&grid);
        let of_cell = |cell: usize| -> Vec<usize> {
            let coordinates = grid.corners(cell).into_iter().flat_map(|v| [2 * v, 2 * v + 1]);
            coordinates.filter_map(|c| unknown_of[c].map(|u| u as usize)).collect()
        };
        let mut elements: Vec<Vec<usize>> = (0..grid.cell_count()).map(of_cell).collect();
        for line in &lines {
            let offsets = count..count + line.offsets();
            elements.extend(line.points.iter().map(|p| of_cell(p.cell).into_iter().chain(offsets.clone()).collect()));
            count = offsets.end;
        }
        let energy = QuadraticEnergy::new(count, elements.iter().map(|e| &e[..]), &Ordering::Amd)?;
        Ok(Self { grid, weights, lines, settings, unknown_of, energy })
    }

    /// Minimizes from `mesh`, which must have no fold and its border in place.
    ///
    /// # Errors
    /// [`PhotoError::Energy`] where a step cannot be solved.
    pub(super) fn minimize(&mut self, mesh: &mut GridMesh, size: (f64, f64), run: &Run) -> Result<Descent, PhotoError> {
        let scales = Scales::new(&self.grid, size, &self.settings);
        let mut energies = vec![self.cost(mesh, &scales)];
        if energies[0] < NEGLIGIBLE_ENERGY {
            return Ok(Descent { energies, converged: true });
        }
        let mut trial = mesh.clone();
        for iteration in 0..self.settings.max_iterations {
            run.step(iteration as f64 / self.settings.max_iterations as f64)?;
            self.assemble(mesh, &scales);
            self.energy.minimize(run)?;
            let before = energies[iteration];
            let mut factor = 1.0;
            let after = (0..MAX_HALVINGS).find_map(|_| {
                self.moved(mesh, factor, &mut trial);
                factor *= 0.5;
                let cost = if scales.allow(&self.grid, &trial) { self.cost(&trial, &scales) } else { f64::NAN };
                (cost < before).then_some(cost)
            });
            let Some(after) = after else { return Ok(Descent { energies, converged: true }) };
            mesh.copy_from(&trial);
            energies.push(after);
            // A shortened step does not measure the distance to the minimum.
            if factor == 0.5 && before - after <= self.settings.tolerance * before {
                return Ok(Descent { energies, converged: true });
            }
        }
        Ok(Descent { energies, converged: false })
    }

    /// `mesh` after `factor` times the last step.
    fn moved(&self, mesh: &GridMesh, factor: f64, trial: &mut GridMesh) {
        trial.copy_from(mesh);
        let step = self.energy.solution();
        for (i, v) in trial.vertices.iter_mut().enumerate() {
            let by = |c: usize| self.unknown_of[c].map_or(0.0, |u| factor * step[u as usize]);
            *v = Point2::new(v.x + by(2 * i), v.y + by(2 * i + 1));
        }
    }

    /// The energy of a mesh for an output of `size` px.
    #[cfg(test)]
    pub(super) fn cost_of(&self, mesh: &GridMesh, size: (f64, f64)) -> f64 {
        self.cost(mesh, &Scales::new(&self.grid, size, &self.settings))
    }

    fn cost(&self, mesh: &GridMesh, scales: &Scales) -> f64 {
        let cells: f64 = (0..self.grid.cell_count()).map(|cell| self.cell_cost(cell, &mesh.quad(cell), scales)).sum();
        let lines: f64 = self.lines.iter().map(|line| line.weight() * line.squared_distances(mesh)).sum();
        cells + lines / (scales.cell_px * scales.cell_px)
    }

    fn cell_cost(&self, cell: usize, quad: &Quad, scales: &Scales) -> f64 {
        let edges = scales.edges(quad);
        let w = self.weights[cell];
        let spread: f64 = SPREAD.iter().map(|row| (dot(row, &edges.along) / edges.size()).powi(2)).sum();
        let aside: f64 = edges.aside.iter().map(|b| (b / scales.plain).powi(2)).sum();
        let strain: f64 = (0..4).map(|e| scales.strain(e, edges.along[e]).0.powi(2)).sum();
        w * spread + (w + self.settings.bending) * aside + STRAIN * strain
    }

    /// The quadratic about `mesh`, in steps from it.
    fn assemble(&mut self, mesh: &GridMesh, scales: &Scales) {
        self.energy.clear();
        for cell in 0..self.grid.cell_count() {
            self.add_cell(cell, &scales.edges(&mesh.quad(cell)), scales);
        }
        let mut element = self.grid.cell_count();
        for l in 0..self.lines.len() {
            let position = self.lines[l].position(mesh);
            self.add_line(l, position.as_ref(), element, scales);
            element += self.lines[l].points.len();
        }
    }

    fn add_cell(&mut self, cell: usize, edges: &Edges, scales: &Scales) {
        let (w, stiff) = (self.weights[cell], self.weights[cell] + self.settings.bending);
        let (size, growth) = (edges.size(), edges.growth());
        for row in &SPREAD {
            let mut a = [0.0; 8];
            let residual = dot(row, &edges.along) / size;
            (0..4).for_each(|e| scales.add_along(e, row[e] / size - residual * growth[e], &mut a));
            self.add_row(cell, cell, w, &a, &[], residual);
        }
        for e in 0..4 {
            let mut a = [0.0; 8];
            scales.add_aside(e, &mut a);
            self.add_row(cell, cell, stiff, &a, &[], edges.aside[e] / scales.plain);
            let (strain, slope) = scales.strain(e, edges.along[e]);
            if strain > 0.0 {
                let mut a = [0.0; 8];
                scales.add_along(e, slope, &mut a);
                self.add_row(cell, cell, STRAIN, &a, &[], strain);
            }
        }
    }

    /// The rows of a line's virtual vertices, whose elements start at `first`.
    fn add_line(&mut self, l: usize, position: Option<&LinePosition>, first: usize, scales: &Scales) {
        let unit = 1.0 / scales.cell_px;
        let weight = self.lines[l].weight();
        for k in 0..self.lines[l].points.len() {
            let point = self.lines[l].points[k];
            let mut a = [0.0; 8];
            let Some(position) = position else {
                // A line shrunk to a point has no residual; its offsets are fixed to keep the system definite.
                let offsets = [1.0, 1.0];
                self.add_row(first + k, point.cell, 1.0, &a, &offsets[..self.lines[l].offsets()], 0.0);
                continue;
            };
            for (corner, beta) in Quad::weights(point.s, point.t).into_iter().enumerate() {
                a[2 * corner] = beta * position.normal.x * unit;
                a[2 * corner + 1] = beta * position.normal.y * unit;
            }
            let s = position.along[k];
            let offsets = if self.lines[l].offsets() == 1 { [-unit, 0.0] } else { [(s - 1.0) * unit, -s * unit] };
            let offsets = &offsets[..self.lines[l].offsets()];
            self.add_row(first + k, point.cell, weight, &a, offsets, position.off[k] * unit);
        }
    }

    /// Adds `w (a · step + offsets · q + residual)²`; `a` is over the eight coordinates of the cell's corners.
    fn add_row(&mut self, element: usize, cell: usize, w: f64, a: &[f64; 8], offsets: &[f64], residual: f64) {
        let mut row = [0.0; 10];
        let mut n = 0;
        for (k, &a) in a.iter().enumerate() {
            if self.unknown_of[2 * self.grid.corners(cell)[k / 2] + k % 2].is_some() {
                row[n] = a;
                n += 1;
            }
        }
        for &q in offsets {
            row[n] = q;
            n += 1;
        }
        self.energy.add(element, w, &row[..n], -residual);
    }
}

/// Unknowns of the coordinates: x is fixed on the left and right side, y on the top and bottom side.
fn number_free_coordinates(grid: &Grid) -> (Vec<Option<u32>>, usize) {
    let mut count = 0;
    let mut number = |free: bool| {
        count += usize::from(free);
        free.then(|| count as u32 - 1)
    };
    let mut unknown_of = Vec::with_capacity(2 * grid.vertex_count());
    for i in 0..grid.vertex_count() {
        let (col, row) = (i % (grid.cols + 1), i / (grid.cols + 1));
        unknown_of.push(number(col != 0 && col != grid.cols));
        unknown_of.push(number(row != 0 && row != grid.rows));
    }
    (unknown_of, count)
}

fn dot(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Lengths of the cells before, and least scales after.
struct Scales {
    /// Width and height of a source cell, px.
    cell: (f64, f64),
    /// `m` along x and y.
    least: (f64, f64),
    /// `M`.
    most: f64,
    /// Scale of the plain resize, geometric mean of both axes.
    plain: f64,
    /// Length of an output cell under the plain resize, px.
    cell_px: f64,
}

impl Scales {
    fn new(grid: &Grid, size: (f64, f64), settings: &Settings) -> Self {
        let cell = grid.cell_size();
        let (sx, sy) = (size.0 / grid.width, size.1 / grid.height);
        let plain = (sx * sy).sqrt();
        let least = (settings.least * sx, settings.least * sy);
        Self { cell, least, most: settings.most * sx.max(sy), plain, cell_px: plain * (cell.0 * cell.1).sqrt() }
    }

    /// Length of edge `e` in the source, px.
    fn length(&self, e: usize) -> f64 {
        if e < 2 { self.cell.0 } else { self.cell.1 }
    }

    fn edges(&self, quad: &Quad) -> Edges {
        let vector = |e: usize| (quad.0[EDGES[e][1]] - quad.0[EDGES[e][0]]) / self.length(e);
        let v = [vector(0), vector(1), vector(2), vector(3)];
        Edges { along: [v[0].x, v[1].x, v[2].y, v[3].y], aside: [v[0].y, v[1].y, v[2].x, v[3].x] }
    }

    /// `[2m/a − 1]₊` or `ς x (1 + 2x)`, `x = [a/M − 1]₊`, of an edge of scale `a`, whichever is not zero, and its derivative.
    fn strain(&self, e: usize, a: f64) -> (f64, f64) {
        let twice = 2.0 * if e < 2 { self.least.0 } else { self.least.1 };
        if a < twice {
            (twice / a - 1.0, -twice / (a * a))
        } else if a > self.most {
            let x = a / self.most - 1.0;
            (STRETCH * x * (1.0 + 2.0 * x), STRETCH * (1.0 + 4.0 * x) / self.most)
        } else {
            (0.0, 0.0)
        }
    }

    /// Adds `c` times the gradient of edge `e`'s scale to the coefficients of the corners' coordinates.
    fn add_along(&self, e: usize, c: f64, a: &mut [f64; 8]) {
        let coordinate = usize::from(e >= 2);
        a[2 * EDGES[e][0] + coordinate] -= c / self.length(e);
        a[2 * EDGES[e][1] + coordinate] += c / self.length(e);
    }

    /// Adds the gradient of edge `e`'s sideways deviation.
    fn add_aside(&self, e: usize, a: &mut [f64; 8]) {
        let coordinate = usize::from(e < 2);
        a[2 * EDGES[e][0] + coordinate] -= 1.0 / (self.length(e) * self.plain);
        a[2 * EDGES[e][1] + coordinate] += 1.0 / (self.length(e) * self.plain);
    }

    /// True where every cell keeps its orientation with some room and no edge runs backward.
    fn allow(&self, grid: &Grid, mesh: &GridMesh) -> bool {
        let least = MIN_DETERMINANT * self.least.0 * self.least.1 * self.cell.0 * self.cell.1;
        (0..grid.cell_count()).all(|cell| {
            let quad = mesh.quad(cell);
            quad.min_jacobian() > least && self.edges(&quad).along.iter().all(|a| *a > 0.0)
        })
    }
}
