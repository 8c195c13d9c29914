//! The energy of a view and its minimizer.
//!
//! Unknowns are the vertices `u_i` of a grid that is regular in a conformal chart of the viewing sphere, at `s_i` there.
//!
//! ```text
//! E  = w_c E_c + w_s E_s + w_l E_l + w_f E_f + ε Σᵢ ‖u_i − s_i‖²
//! E_c = ¼ Σ_cells w² Σ_corners ‖e_v − R e_u‖²                 the two edges of a corner: equally long, at right angles
//! E_s = (ℓ/h)² Σ ‖second differences of u‖²                   scale changes slowly; h: a cell, ℓ: a length on the sphere
//! E_l   lines are straight                                    `straight.rs`
//! E_f = Σ_faces Σₖ ‖u_k − (a t_k + b R t_k + c)‖²             a face is a similar copy of what one sees looking at it
//! ```
//!
//! `R` is the quarter turn from +x to +y. `E_c` is the sum of squared Cauchy–Riemann equations in the chart, which is
//! conformal: angles on the sphere are angles in the chart. Weights: `w = 1 + 2 w_L + 2 w_S + 4 w_F` (line ends, salience,
//! faces), larger where distortion shows; the paper's `w_c = .4`, `w_l = 1000` enter squared. Its `w_s = .05` belongs to its
//! own grid; `ℓ` says the same for any grid. `E_s` is measured in the chart, so that the chart itself costs nothing.
//!
//! **Scale.** `u = 0` would be straight, conformal and smooth. The minimizer under `Σ u·s = Σ s·s` is the minimizer of `E`
//! with the small pull `ε`, multiplied by a number: the energy without the pull is homogeneous. That also decides the place.
//!
//! **Rotation.** Where no line has an orientation, the sheet is the one with `Σ s × u = 0`: a multiple of the energy's answer
//! to the right-hand side `R s` is taken off. It must be kept from turning: the linearized lines of `straight.rs` do not see
//! distances across a line after a quarter turn, and would have the chart, turned, for a sheet of straight lines.
//!
//! **Lines** of free orientation make `E_l` bilinear: it is linearized about the present sheet (`straight.rs`) until no vertex
//! moves, three or four solves. They are done on cells twice as large first, at an eighth of the cost. What lines and faces
//! share, their offsets and similarities, are a border of the sparse system ([`BorderedEnergy`]): its pattern is that of the
//! grid, so that lines may come, go and move without a new analysis.
//!
//! **Folds.** Least squares does not forbid them. Cells that fold get four times the conformality, lines that are continued
//! through them let go of what nobody marked, and the sheet is solved again; a sheet that keeps folding goes back along the line to the last one that does not, at worst the chart.
//!
//! # Reference
//! Carroll et al. 2009, sections 4.1 to 4.4.

use super::sphere_grid::SphereGrid;
use super::straight::GridLine;
use super::weights::{CellWeights, FaceTarget};
use plumbline_image::grid::{CellPoint, Grid, GridMesh, Quad};
use plumbline_num::energy::{BorderedEnergy, EnergyError, Ordering};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::Run;

/// `ε`: far below what conformality weighs and far above rounding. The sheet is scaled afterwards, so its size does not count.
const PULL: f64 = 1e-6;
/// Keeps unknowns of lines that have shrunk to a point.
const IDLE: f64 = 1e-9;
/// Conformality of cells that the picture does not show, relative to those it does: they only carry on.
const OUTSIDE: f64 = 0.1;
/// Unknowns of a face: a, b; c (2).
const FACE_UNKNOWNS: usize = 4;
/// A round that moves no vertex by more, cells, is the last: what the next one would move is of second order in it.
const STILL: f64 = 0.02;
/// A round that moves more than this share of the one before does not settle: the next starts half way.
const UNSETTLED: f64 = 0.7;
/// By how much the conformality of folding cells is raised each time.
const STIFFER: f64 = 4.0;
/// Times it is raised before going back.
const FOLD_ROUNDS: usize = 8;
/// Halvings on the way back to a sheet without folds.
const BACKTRACKS: i32 = 30;
/// Rounds after a small change of the lines: one goes there, the second takes out what the first left of second order.
const FOLLOWING: usize = 2;

/// What the energies weigh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnergyWeights {
    /// `w_c`: shapes are kept.
    pub conformality: f64,
    /// `ℓ`, rad: over which length scale may change. 0 lets it change from cell to cell.
    pub smooth_length: f64,
    /// `w_l`: lines are straight.
    pub straightness: f64,
    /// `w_f`: faces keep their shape as a whole.
    pub faces: f64,
    /// Rounds of linearization at most, ≥ 1.
    pub rounds: usize,
}

impl Default for EnergyWeights {
    fn default() -> Self {
        Self { conformality: 0.16, smooth_length: 0.15, straightness: 1e4, faces: 1e3, rounds: 20 }
    }
}

/// The sheet of one view: grid and faces are given for good, lines at every solve, vertices are asked for.
#[derive(Debug)]
pub(super) struct Sheet {
    pub(super) sphere: SphereGrid,
    faces: Vec<FaceTarget>,
    weights: EnergyWeights,
    /// Weights of the cells without the lines'.
    base: CellWeights,
    energy: BorderedEnergy,
    /// First element of the second differences, and of the pull; cells come first.
    smooth: usize,
    pull: usize,
    forms: CellForms,
}

/// Quadratic forms over the coordinates of a cell's corners: lower triangles, row by row.
#[derive(Clone, Debug)]
struct CellForms {
    /// `¼ Σ_corners ‖e_v − R e_u‖²`.
    conformal: [f64; 36],
    /// Twice the squared mixed difference: it occurs twice in the Hessian.
    mixed: [f64; 36],
}

/// When to give up folding cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Folding {
    /// Hold them stiffer, several times.
    Held,
    /// At once: the caller has another way.
    Refused,
}

/// How the solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SolveReport {
    /// Linear solves.
    pub(super) iterations: usize,
    /// Cells had to be held stiffer, or the sheet drawn back, to keep it from folding.
    pub(super) folded: bool,
}

impl Sheet {
    pub(super) fn new(
        sphere: SphereGrid,
        faces: Vec<FaceTarget>,
        weights: EnergyWeights,
        base: CellWeights,
    ) -> Result<Self, EnergyError> {
        let (list, smooth, pull) = element_list(&sphere.grid);
        let place = |i: usize| sphere.grid.vertex(i / 2);
        let n = 2 * sphere.grid.vertex_count();
        let ordering = Ordering::NestedDissection((0..n).map(place).map(|p| [p.x, p.y, 0.0]).collect());
        let energy = BorderedEnergy::new(n, list.iter().map(Vec::as_slice), &ordering)?;
        Ok(Self { sphere, faces, weights, base, energy, smooth, pull, forms: CellForms::new() })
    }

    /// The vertices in the chart: the regular grid.
    fn rest(&self) -> Vec<Vec2> {
        (0..self.sphere.grid.vertex_count()).map(|i| self.sphere.vertex(i)).collect()
    }

    /// The sheet of least energy that has no fold, in the unit of the chart; lines start as they lie on `start`. Where folds
    /// are refused, it may have some.
    pub(super) fn solve(
        &mut self,
        lines: &[GridLine],
        start: Option<GridMesh>,
        folding: Folding,
        run: &Run,
    ) -> Result<(GridMesh, SolveReport), EnergyError> {
        let mut sound = start.unwrap_or_else(|| self.mesh(self.rest()));
        if sound.folded_cells() > 0 {
            sound = self.mesh(self.rest());
        }
        let mut lines = lines.to_vec();
        let mut cells = self.conformality(&lines);
        let mut report = SolveReport { iterations: 0, folded: false };
        for _ in 0..FOLD_ROUNDS {
            let found = self.straightened(&lines, &cells, &sound, self.weights.rounds, &mut report.iterations, run)?;
            let folded: Vec<usize> = (0..cells.len()).filter(|&cell| folds(&found.quad(cell))).collect();
            if folded.is_empty() {
                return Ok((found, report));
            }
            report.folded = true;
            if folding == Folding::Refused {
                return Ok((found, report));
            }
            sound = drawn_back(&sound, &found);
            let touched = self.around(&folded);
            cells.iter_mut().zip(&touched).filter(|(_, touched)| **touched).for_each(|(w, _)| *w *= STIFFER);
            for line in &mut lines {
                line.let_go(&touched);
            }
        }
        Ok((sound, report))
    }

    /// The sheet after a small change of the lines, from the one before it; `None` where it would fold.
    pub(super) fn follow(
        &mut self,
        lines: &[GridLine],
        before: &GridMesh,
        run: &Run,
    ) -> Result<Option<GridMesh>, EnergyError> {
        let cells = self.conformality(lines);
        let mesh = self.straightened(lines, &cells, before, FOLLOWING, &mut 0, run)?;
        Ok((mesh.folded_cells() == 0).then_some(mesh))
    }

    /// `w_c w²` of each cell.
    fn conformality(&self, lines: &[GridLine]) -> Vec<f64> {
        let weights = self.base.with_ends(&self.sphere, lines);
        let shown = |(w, inside): (&f64, &bool)| self.weights.conformality * if *inside { w * w } else { OUTSIDE };
        weights.0.iter().zip(&self.sphere.inside).map(shown).collect()
    }

    /// Rounds from `start` until one moves no vertex by more than [`STILL`].
    fn straightened(
        &mut self,
        lines: &[GridLine],
        cells: &[f64],
        start: &GridMesh,
        rounds: usize,
        iterations: &mut usize,
        run: &Run,
    ) -> Result<GridMesh, EnergyError> {
        let still = STILL * self.sphere.cell();
        let free = lines.iter().any(|line| line.normal.is_none());
        let (mut mesh, mut before) = (start.clone(), f64::INFINITY);
        for k in 0..rounds.max(1) {
            run.step(k as f64 / rounds.max(1) as f64)?;
            let mut next = self.round(lines, cells, &mesh, run)?;
            *iterations += 1;
            let moved = mesh.vertices.iter().zip(&next.vertices).map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
            if !free || !(moved > still) {
                return Ok(next);
            }
            if moved > UNSETTLED * before {
                next.vertices.iter_mut().zip(&mesh.vertices).for_each(|(b, a)| *b = nalgebra::center(a, b));
            }
            (mesh, before) = (next, moved);
        }
        Ok(mesh)
    }

    /// The minimizer of the energy linearized about `mesh`.
    fn round(
        &mut self,
        lines: &[GridLine],
        cells: &[f64],
        mesh: &GridMesh,
        run: &Run,
    ) -> Result<GridMesh, EnergyError> {
        let offsets: usize = lines.iter().map(GridLine::offsets).sum();
        self.energy.clear(offsets + FACE_UNKNOWNS * self.faces.len());
        self.add_cells(cells);
        self.add_lines(lines, mesh);
        self.add_faces(offsets);
        self.add_pull();
        let rest = self.rest();
        let pairs = |x: &[f64]| x.chunks_exact(2).map(|u| Vec2::new(u[0], u[1])).collect::<Vec<_>>();
        let mut found = pairs(self.energy.minimize(run)?);
        if lines.iter().all(|line| line.normal.is_none()) {
            let aside: Vec<f64> = rest.iter().flat_map(|s| [-s.y, s.x]).collect();
            let answer = pairs(&self.energy.response(&aside));
            let turn = |a: &[Vec2]| a.iter().zip(&rest).map(|(a, s)| s.perp(a)).sum::<f64>();
            let share = turn(&found) / turn(&answer);
            found.iter_mut().zip(answer).for_each(|(u, a)| *u -= share * a);
        }
        let dot = |a: &[Vec2]| a.iter().zip(&rest).map(|(a, s)| a.dot(s)).sum::<f64>();
        let scale = dot(&rest) / dot(&found);
        Ok(self.mesh(found.into_iter().map(|u| scale * u).collect()))
    }

    fn mesh(&self, vertices: Vec<Vec2>) -> GridMesh {
        let grid = &self.sphere.grid;
        GridMesh { cols: grid.cols, rows: grid.rows, vertices: vertices.into_iter().map(Point2::from).collect() }
    }

    /// These cells and those around them.
    fn around(&self, folded: &[usize]) -> Vec<bool> {
        let (cols, rows) = (self.sphere.grid.cols, self.sphere.grid.rows);
        let mut touched = vec![false; cols * rows];
        for cell in folded {
            let (i, j) = (cell % cols, cell / cols);
            for row in j.saturating_sub(1)..(j + 2).min(rows) {
                touched[row * cols + i.saturating_sub(1)..row * cols + (i + 2).min(cols)].fill(true);
            }
        }
        touched
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
        for element in self.smooth..self.pull {
            self.energy.add(element, smooth, &[1.0, -2.0, 1.0], 0.0);
        }
    }

    fn add_lines(&mut self, lines: &[GridLine], mesh: &GridMesh) {
        let mut first = 0;
        for line in lines {
            let offset = first;
            first += line.offsets();
            let Some(lie) = line.lie(mesh) else { continue };
            for (k, vertex) in line.vertices.iter().enumerate() {
                let w = self.weights.straightness * line.weights[k];
                let mut a = [0.0; 8];
                place(&mut a, vertex, lie.normal.x, lie.normal.y);
                let s = lie.along[k];
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
                    place(&mut a, vertex, x, y);
                    let shared = [0, 1, 2, 3].map(|k| (at + k, unknowns[k]));
                    self.energy.add_shared(vertex.cell, w, &a, &shared, 0.0);
                }
            }
        }
    }

    fn add_pull(&mut self) {
        self.energy.add_everywhere(IDLE, 0.0);
        for i in 0..self.sphere.grid.vertex_count() {
            let s = self.sphere.vertex(i);
            self.energy.add(self.pull + 2 * i, PULL, &[1.0], s.x);
            self.energy.add(self.pull + 2 * i + 1, PULL, &[1.0], s.y);
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
fn place(a: &mut [f64], vertex: &CellPoint, x: f64, y: f64) {
    for (k, w) in Quad::weights(vertex.s, vertex.t).into_iter().enumerate() {
        (a[2 * k], a[2 * k + 1]) = (w * x, w * y);
    }
}

fn folds(quad: &Quad) -> bool {
    !(quad.least_jacobian() > 0.0)
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

/// The sheet farthest on the straight way from a sheet without folds to another that has none either.
pub(crate) fn drawn_back(sound: &GridMesh, found: &GridMesh) -> GridMesh {
    let mut mesh = sound.clone();
    for k in 1..=BACKTRACKS {
        let t = 0.5_f64.powi(k);
        for (i, v) in mesh.vertices.iter_mut().enumerate() {
            *v = sound.vertices[i] + t * (found.vertices[i] - sound.vertices[i]);
        }
        if mesh.folded_cells() == 0 {
            return mesh;
        }
    }
    sound.clone()
}

/// The unknowns of every element, each list ascending: cells, second differences, pulls; with the first of the two latter.
fn element_list(grid: &Grid) -> (Vec<Vec<usize>>, usize, usize) {
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
    let pull = list.len();
    list.extend((0..2 * grid.vertex_count()).map(|i| vec![i]));
    (list, smooth, pull)
}
