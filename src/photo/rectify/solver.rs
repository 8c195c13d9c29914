//! The energy of a view and its minimizer.
//!
//! Unknowns are the vertices `u_i` of a grid that is regular in a conformal chart of the viewing sphere, at `s_i` there.
//!
//! ```text
//! E  = w_c (E_c + E_s + E_b) + w_l E_l + w_f E_f + ε Σᵢ ‖u_i − (s_i − s̄)‖²
//! E_c = ¼ Σ_cells w² Σ_corners ‖e_v − R e_u‖²                 the two edges of a corner: equally long, at right angles
//! E_s = (ℓ/h)² Σ ‖second differences of u‖²                   scale changes slowly; h: a cell, ℓ: a length on the sphere
//! E_b   great circles beside lines bend little                `bending.rs`
//! E_l   lines are straight                                    `straight.rs`
//! E_f = Σ_faces Σₖ ‖u_k − (a t_k + b R t_k + c)‖²             a face is a similar copy of what one sees looking at it
//! ```
//!
//! `R` is the rotation by 90° from +x to +y. `E_c` is the sum of squared Cauchy–Riemann equations in the chart, which
//! is conformal: angles on the sphere are angles in the chart. Weights: `w = 1 + 2 w_L + 2 w_S + 4 w_F` (line ends,
//! saliency, faces), larger where distortion shows; the paper's `w_c = .4`, `w_l = 1000` enter squared. Its `w_s = .05`
//! belongs to its own grid; `ℓ` says the same for any grid. `E_s` is measured in the chart, so that the chart itself
//! costs nothing.
//!
//! **Scale.** `u = 0` would be straight, conformal and smooth. The minimizer under `Σ u·s = Σ s·s`, `s` from its mean `s̄`, is the
//! minimizer of `E` with the small regularization `ε`, up to a factor: the energy without it is homogeneous.
//!
//! **Translation.** The energy does not see it; `ε` makes the mean of `u` zero, and `s̄` is added after scaling. (With `s` instead of
//! `s − s̄` in the regularization the mean would be scaled, too: by a factor of hundreds, which follows the energy. A line dragged
//! by a few pixels then moved the plane by thousands.)
//!
//! **Rotation.** Where no line has an orientation, the constraint `Σ s × u = 0` fixes the rotation: a multiple of the
//! response to the right-hand side `R s` is subtracted. Without it the linearized lines of `straight.rs` would accept
//! the chart rotated by 90° as straight: they do not see distances along a line.
//!
//! **Lines** make `E_b` bilinear, and those of free orientation `E_l`: both are linearized about the present sheet until no
//! vertex moves: three or four solves, first on cells twice as large at an eighth of the cost. The unknowns of lines
//! (offsets) and faces (similarities) form a border of the sparse system ([`BorderedEnergy`]): its pattern is that of
//! the grid, so that lines may come, go and move without a new analysis.
//!
//! **Folds.** Least squares does not exclude them. Folded cells get four times the conformality weight and a quarter of that of
//! bending, continuations of lines through them are relaxed, and the grid is solved again; a grid that keeps folding is interpolated back to
//! the last one without folds, at worst the chart.
//!
//! # Reference
//! Carroll et al. 2009, sections 4.1 to 4.4.

use super::bending;
use super::folds::{drawn_back, folds, with_neighbors};
use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use super::weights::{CellWeights, FaceTarget};
use plumbline_image::grid::{CellPoint, Grid, GridMesh, Quad};
use plumbline_num::energy::{BorderedEnergy, EnergyError, Ordering};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::Run;
use plumbline_num::sparse::SparseError;

/// `ε`: five orders below the default conformality weight, so that it does not bend the solution, and ten above
/// rounding. The solution is rescaled, so its absolute size has no effect.
const REGULARIZATION: f64 = 1e-6;
/// Diagonal terms on all unknowns: keep the system definite when a line has shrunk to a point and its offsets occur in no equation.
/// Far below [`REGULARIZATION`]; the next one where that is below the rounding of what the offsets of lines are in, as where seven
/// lines at odds with each other hold each other in place.
const PIVOT_FLOORS: [f64; 3] = [1e-9, 1e-7, 1e-5];
/// Conformality of cells outside the picture relative to those inside: they only extrapolate the map, and at 1 would
/// resist as much as visible cells.
const OUTSIDE_WEIGHT: f64 = 0.1;
/// Unknowns of a face: a, b; c (2).
const FACE_UNKNOWNS: usize = 4;
/// Largest vertex displacement, cells, at which the linearization counts as converged: the error left is of second
/// order in it, below a thousandth of a cell.
const STEP_TOLERANCE: f64 = 0.02;
/// Ratio of successive steps above which the iteration oscillates; the next linearization is then about the midpoint.
const DIVERGENCE_RATIO: f64 = 0.7;
/// Factor on the conformality of folded cells per attempt, and divisor of the bending at their corners.
const FOLD_STIFFENING: f64 = 4.0;
/// Attempts before the last grid without folds is returned: `4⁸` exceeds the ratio of the default weights of lines and
/// conformality.
const MAX_FOLD_ITERATIONS: usize = 8;
/// Linear solves after a small change of the lines: the second removes the second-order error of the first.
const FOLLOW_ITERATIONS: usize = 2;

/// Weights of the energy's terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyWeights {
    /// `w_c`: weight of conformality, above 0, default 0.16 (the paper's 0.4 squared). Larger keeps shapes and lets
    /// lines bend.
    pub conformality: f64,
    /// `ℓ`, rad, 0 to 10, default 0.15: length over which the scale may change. 0 lets it change from cell to cell.
    pub smooth_length: f64,
    /// `ℓ_b`, rad, 0 to 100, default 3: length over which what lies beside lines stays straight. 0 lets it bend.
    pub bending_length: f64,
    /// `w_l`: weight of line straightness, 0 to 1e8, default 1e4.
    pub straightness: f64,
    /// `w_f`: weight of the rigidity of faces, 0 to 1e8, default 1000.
    pub faces: f64,
    /// Maximum number of linearizations per solve, at least 1, default 20; three or four usually suffice.
    pub iterations: usize,
}

impl Default for EnergyWeights {
    fn default() -> Self {
        Self {
            conformality: 0.16,
            smooth_length: 0.15,
            bending_length: 3.0,
            straightness: 1e4,
            faces: 1e3,
            iterations: 20,
        }
    }
}

/// The grid of one view: cells and faces are fixed, lines are given per solve, vertices are the unknowns.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) sphere: SphereGrid,
    /// `s̄`: mean of the vertices in the chart.
    mean: Vec2,
    faces: Vec<FaceTarget>,
    weights: EnergyWeights,
    /// Weights of the cells without the lines'.
    base: CellWeights,
    energy: BorderedEnergy,
    first: FirstElements,
    forms: CellForms,
}

/// First elements of the terms; those of the cells precede all.
#[derive(Debug)]
struct FirstElements {
    smooth: usize,
    regularization: usize,
    bending: usize,
}

/// Weights that lines and folds change.
#[derive(Debug)]
struct LocalWeights {
    /// `w_c w²` of each cell.
    cells: Vec<f64>,
    /// `ω` of each vertex.
    bending: Vec<f64>,
}

/// Quadratic forms over the coordinates of a cell's corners: lower triangles, row by row.
#[derive(Clone, Debug)]
struct CellForms {
    /// `¼ Σ_corners ‖e_v − R e_u‖²`.
    conformal: [f64; 36],
    /// Twice the squared mixed difference: it occurs twice in the Hessian.
    mixed: [f64; 36],
}

/// What to do with folded cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Folding {
    /// Stiffen them and solve again.
    Held,
    /// Return the folded grid: the caller has an alternative.
    Refused,
}

/// How the solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SolveReport {
    /// Linear solves.
    pub(super) iterations: usize,
    /// Cells were stiffened, or the grid interpolated back, to remove folds.
    pub(super) folded: bool,
}

impl Sheet {
    pub(super) fn new(
        sphere: SphereGrid,
        faces: Vec<FaceTarget>,
        weights: EnergyWeights,
        base: CellWeights,
    ) -> Result<Self, EnergyError> {
        let (list, first) = element_list(&sphere.grid);
        let position = |i: usize| sphere.grid.vertex(i / 2);
        let n = 2 * sphere.grid.vertex_count();
        let ordering = Ordering::NestedDissection((0..n).map(position).map(|p| [p.x, p.y, 0.0]).collect());
        let energy = BorderedEnergy::new(n, list.iter().map(Vec::as_slice), &ordering)?;
        let count = sphere.grid.vertex_count();
        let mean = (0..count).map(|i| sphere.vertex(i)).sum::<Vec2>() / count as f64;
        Ok(Self { sphere, mean, faces, weights, base, energy, first, forms: CellForms::new() })
    }

    /// The vertices in the chart from their mean: the regular grid.
    fn rest(&self) -> Vec<Vec2> {
        (0..self.sphere.grid.vertex_count()).map(|i| self.sphere.vertex(i) - self.mean).collect()
    }

    /// The minimizer without folds, in chart units; lines are first linearized about `initial`. With
    /// [`Folding::Refused`] the result may have folds.
    pub(super) fn solve(
        &mut self,
        lines: &[GridLine],
        initial: Option<GridMesh>,
        folding: Folding,
        run: &Run,
    ) -> Result<(GridMesh, SolveReport), EnergyError> {
        let mut initial = initial.unwrap_or_else(|| self.mesh(self.rest()));
        if initial.folded_cells() > 0 {
            initial = self.mesh(self.rest());
        }
        self.unfolded(lines, initial, folding, self.weights.iterations, run)
    }

    /// The same after a small change of the lines, from the previous solution.
    pub(super) fn follow(
        &mut self,
        lines: &[GridLine],
        before: &GridMesh,
        folding: Folding,
        run: &Run,
    ) -> Result<(GridMesh, SolveReport), EnergyError> {
        self.unfolded(lines, before.clone(), folding, FOLLOW_ITERATIONS, run)
    }

    /// Solves from `sound`, which has no folds, with at most so many linearizations per attempt at a grid without folds.
    fn unfolded(
        &mut self,
        lines: &[GridLine],
        mut sound: GridMesh,
        folding: Folding,
        max_iterations: usize,
        run: &Run,
    ) -> Result<(GridMesh, SolveReport), EnergyError> {
        let mut lines = lines.to_vec();
        let mut local = self.local_weights(&lines);
        let mut report = SolveReport { iterations: 0, folded: false };
        for _ in 0..MAX_FOLD_ITERATIONS {
            let found = self.straightened(&lines, &local, &sound, max_iterations, &mut report.iterations, run)?;
            let folded: Vec<usize> = (0..found.cols * found.rows).filter(|&cell| folds(&found.quad(cell))).collect();
            if folded.is_empty() {
                return Ok((found, report));
            }
            report.folded = true;
            if folding == Folding::Refused {
                return Ok((found, report));
            }
            sound = drawn_back(&sound, &found);
            let touched = with_neighbors(&folded, (self.sphere.grid.cols, self.sphere.grid.rows));
            local.stiffen(&touched, &self.sphere.grid);
            for line in &mut lines {
                line.relax(&touched);
            }
        }
        Ok((sound, report))
    }

    fn local_weights(&self, lines: &[GridLine]) -> LocalWeights {
        let weights = self.base.with_ends(&self.sphere, lines);
        let shown =
            |(w, inside): (&f64, &bool)| self.weights.conformality * if *inside { w * w } else { OUTSIDE_WEIGHT };
        let cells = weights.0.iter().zip(&self.sphere.inside).map(shown).collect();
        LocalWeights { cells, bending: bending::nearness(&self.sphere, lines) }
    }

    /// Iterates from `initial` until no vertex moves by more than [`STEP_TOLERANCE`].
    fn straightened(
        &mut self,
        lines: &[GridLine],
        local: &LocalWeights,
        initial: &GridMesh,
        max_iterations: usize,
        iterations: &mut usize,
        run: &Run,
    ) -> Result<GridMesh, EnergyError> {
        let tolerance = STEP_TOLERANCE * self.sphere.cell();
        let linear = lines.iter().all(GridLine::is_side);
        let (mut mesh, mut before) = (initial.clone(), f64::INFINITY);
        for k in 0..max_iterations.max(1) {
            run.step(k as f64 / max_iterations.max(1) as f64)?;
            let mut next = self.linearized_solve(lines, local, &mesh, run)?;
            *iterations += 1;
            let moved = mesh.vertices.iter().zip(&next.vertices).map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
            if linear || !(moved > tolerance) {
                return Ok(next);
            }
            if moved > DIVERGENCE_RATIO * before {
                next.vertices.iter_mut().zip(&mesh.vertices).for_each(|(b, a)| *b = nalgebra::center(a, b));
            }
            (mesh, before) = (next, moved);
        }
        Ok(mesh)
    }

    /// The minimizer of the energy linearized about `mesh`.
    fn linearized_solve(
        &mut self,
        lines: &[GridLine],
        local: &LocalWeights,
        mesh: &GridMesh,
        run: &Run,
    ) -> Result<GridMesh, EnergyError> {
        let rest = self.rest();
        let pairs = |x: &[f64]| x.chunks_exact(2).map(|u| Vec2::new(u[0], u[1])).collect::<Vec<_>>();
        let mut floors = PIVOT_FLOORS.into_iter().peekable();
        let mut found = loop {
            let floor = floors.next().unwrap_or_default();
            self.assemble(lines, local, mesh, floor);
            match self.energy.minimize(run) {
                Err(EnergyError::Solve(SparseError::Pivot { .. })) if floors.peek().is_some() => {}
                found => break pairs(found?),
            }
        };
        if lines.iter().all(|line| line.normal.is_none()) {
            let aside: Vec<f64> = rest.iter().flat_map(|s| [-s.y, s.x]).collect();
            let answer = pairs(&self.energy.response(&aside));
            let rotation = |a: &[Vec2]| a.iter().zip(&rest).map(|(a, s)| s.perp(a)).sum::<f64>();
            let factor = rotation(&found) / rotation(&answer);
            found.iter_mut().zip(answer).for_each(|(u, a)| *u -= factor * a);
        }
        let dot = |a: &[Vec2]| a.iter().zip(&rest).map(|(a, s)| a.dot(s)).sum::<f64>();
        let scale = dot(&rest) / dot(&found);
        Ok(self.mesh(found.into_iter().map(|u| scale * u).collect()))
    }

    /// Enters the energy linearized about `mesh`.
    fn assemble(&mut self, lines: &[GridLine], local: &LocalWeights, mesh: &GridMesh, floor: f64) {
        let offsets: usize = lines.iter().map(GridLine::offsets).sum();
        self.energy.clear(offsets + FACE_UNKNOWNS * self.faces.len());
        self.add_cells(&local.cells);
        self.add_bends(&local.bending, mesh);
        self.add_lines(lines, mesh);
        self.add_faces(offsets);
        self.add_regularization(floor);
    }

    /// Vertices from their mean as a mesh in the chart.
    fn mesh(&self, vertices: Vec<Vec2>) -> GridMesh {
        let grid = &self.sphere.grid;
        let vertices = vertices.into_iter().map(|u| Point2::from(u + self.mean)).collect();
        GridMesh { cols: grid.cols, rows: grid.rows, vertices }
    }

    /// `E_c` and `E_s`.
    fn add_cells(&mut self, cells: &[f64]) {
        let smooth = self.weights.conformality * (self.weights.smooth_length / self.sphere.cell()).powi(2);
        let mut form = [0.0; 36];
        for (cell, w) in cells.iter().enumerate() {
            let parts = self.forms.conformal.iter().zip(&self.forms.mixed);
            form.iter_mut().zip(parts).for_each(|(form, (c, m))| *form = w * c + smooth * m);
            self.energy.add_form(cell, &form);
        }
        for element in self.first.smooth..self.first.regularization {
            self.energy.add(element, smooth, &[1.0, -2.0, 1.0], 0.0);
        }
    }

    /// `E_b`.
    fn add_bends(&mut self, near: &[f64], mesh: &GridMesh) {
        let scale = self.weights.conformality * (self.weights.bending_length / self.sphere.cell()).powi(2);
        for bend in bending::bends(&self.sphere, mesh) {
            let w = scale * near[bend.vertex] * bend.weight;
            self.energy.add(self.first.bending + bend.star, w, &bend.coefficients, 0.0);
        }
    }

    fn add_lines(&mut self, lines: &[GridLine], mesh: &GridMesh) {
        let mut first = 0;
        for line in lines {
            let offset = first;
            first += line.offsets();
            let Some(position) = line.position(mesh) else { continue };
            for (k, vertex) in line.vertices.iter().enumerate() {
                let w = self.weights.straightness * line.weights[k];
                let mut a = [0.0; 8];
                point_coefficients(&mut a, vertex, position.normal.x, position.normal.y);
                let s = position.along[k];
                let shared = [(offset, s - 1.0), (first - 1, -s)];
                self.energy.add_shared(vertex.cell, w, &a, &shared[..], 0.0);
            }
        }
    }

    fn add_faces(&mut self, first: usize) {
        for (face, at) in self.faces.iter().zip((first..).step_by(FACE_UNKNOWNS)) {
            let w = self.weights.faces / face.points.len() as f64;
            for (vertex, t) in &face.points {
                for (x, y, unknowns) in [(1.0, 0.0, [-t.x, t.y, -1.0, 0.0]), (0.0, 1.0, [-t.y, -t.x, 0.0, -1.0])] {
                    let mut a = [0.0; 8];
                    point_coefficients(&mut a, vertex, x, y);
                    let shared = [0, 1, 2, 3].map(|k| (at + k, unknowns[k]));
                    self.energy.add_shared(vertex.cell, w, &a, &shared, 0.0);
                }
            }
        }
    }

    fn add_regularization(&mut self, floor: f64) {
        self.energy.add_everywhere(floor, 0.0);
        for i in 0..self.sphere.grid.vertex_count() {
            let s = self.sphere.vertex(i) - self.mean;
            self.energy.add(self.first.regularization + 2 * i, REGULARIZATION, &[1.0], s.x);
            self.energy.add(self.first.regularization + 2 * i + 1, REGULARIZATION, &[1.0], s.y);
        }
    }
}

impl LocalWeights {
    /// Where cells are touched by folds shapes count more, and lines less.
    fn stiffen(&mut self, touched: &[bool], grid: &Grid) {
        for cell in (0..touched.len()).filter(|cell| touched[*cell]) {
            self.cells[cell] *= FOLD_STIFFENING;
            grid.corners(cell).into_iter().for_each(|i| self.bending[i] /= FOLD_STIFFENING);
        }
    }
}

impl CellForms {
    fn new() -> Self {
        // Corners a b / c d; at each, its neighbor along u and along v, and the signs of the steps there.
        const CORNERS: [(usize, usize, usize, f64, f64); 4] =
            [(0, 1, 2, 1.0, 1.0), (1, 0, 3, -1.0, 1.0), (2, 3, 0, 1.0, -1.0), (3, 2, 1, -1.0, -1.0)];
        let (mut conformal, mut mixed) = ([0.0; 36], [0.0; 36]);
        for (corner, along, down, su, sv) in CORNERS {
            let (mut x, mut y) = ([0.0; 8], [0.0; 8]);
            for (vertex, u, v) in [(along, su, 0.0), (down, 0.0, sv), (corner, -su, -sv)] {
                // e_v − R e_u with R (x, y) = (−y, x).
                (x[2 * vertex], x[2 * vertex + 1]) = (v, u);
                (y[2 * vertex + 1], y[2 * vertex]) = (v, -u);
            }
            add_square(&mut conformal, 0.25, &x);
            add_square(&mut conformal, 0.25, &y);
        }
        add_square(&mut mixed, 2.0, &[1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0]);
        add_square(&mut mixed, 2.0, &[0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0]);
        Self { conformal, mixed }
    }
}

/// Adds `w a aᵀ` to a lower triangle.
fn add_square(form: &mut [f64; 36], w: f64, a: &[f64; 8]) {
    let pairs = (0..8).flat_map(|i| (0..=i).map(move |j| (i, j)));
    form.iter_mut().zip(pairs).for_each(|(form, (i, j))| *form += w * a[i] * a[j]);
}

/// The coefficients of `x u_x + y u_y` at a point of a cell, over the coordinates of the cell's corners.
fn point_coefficients(a: &mut [f64], vertex: &CellPoint, x: f64, y: f64) {
    for (k, w) in Quad::weights(vertex.s, vertex.t).into_iter().enumerate() {
        (a[2 * k], a[2 * k + 1]) = (w * x, w * y);
    }
}

/// The mesh with each cell cut into four.
pub(super) fn halved(mesh: &GridMesh) -> GridMesh {
    let (cols, rows) = (2 * mesh.cols, 2 * mesh.rows);
    let grid = Grid { cols: mesh.cols, rows: mesh.rows, width: mesh.cols as f64, height: mesh.rows as f64 };
    let vertex = |k: usize| {
        let (i, j) = (k % (cols + 1), k / (cols + 1));
        grid.locate(Point2::new(0.5 * i as f64, 0.5 * j as f64)).map(|p| mesh.at(p))
    };
    let vertices = (0..(cols + 1) * (rows + 1)).map(|k| vertex(k).expect("inside the grid")).collect();
    GridMesh { cols, rows, vertices }
}

/// The unknowns of every element, each list ascending: cells, second differences, regularization, bends.
fn element_list(grid: &Grid) -> (Vec<Vec<usize>>, FirstElements) {
    let corners = |cell: usize| grid.corners(cell).into_iter().flat_map(|i| [2 * i, 2 * i + 1]);
    let mut list: Vec<Vec<usize>> = (0..grid.cell_count()).map(|cell| corners(cell).collect()).collect();
    let smooth = list.len();
    for i in 0..grid.vertex_count() {
        let (col, row) = (i % (grid.cols + 1), i / (grid.cols + 1));
        let mut triple = |step: usize| list.extend([0, 1].map(|k| [i - step, i, i + step].map(|v| 2 * v + k).to_vec()));
        if col > 0 && col < grid.cols {
            triple(1);
        }
        if row > 0 && row < grid.rows {
            triple(grid.cols + 1);
        }
    }
    let regularization = list.len();
    list.extend((0..2 * grid.vertex_count()).map(|i| vec![i]));
    let bending = list.len();
    list.extend(bending::stars(grid));
    (list, FirstElements { smooth, regularization, bending })
}
