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
//! with the small pull `ε`, multiplied by a number: the energy without the pull is homogeneous. That also decides rotation
//! and place where no line does.
//!
//! **Alternation.** Half steps of `straight.rs` until no vertex moves: a handful of rounds. They are done on cells twice as large
//! first, at an eighth of the cost. With a few lines one or two are left on the grid itself; with seventy they are not saved.
//!
//! **Folds.** Least squares does not forbid them. Cells that fold get four times the conformality and the sheet is solved
//! again; a sheet that keeps folding goes back along the line to the last one that does not, at worst the chart.
//!
//! # Reference
//! Carroll et al. 2009, sections 4.1 to 4.4.

use super::sphere_grid::SphereGrid;
use super::straight::{Constraint, GridLine, HalfStep};
use super::weights::{CellWeights, FaceTarget};
use crate::energy::{EnergyError, Ordering, QuadraticEnergy};
use crate::math::{Point2, Vec2};
use crate::mesh::{CellPoint, Grid, GridMesh, Quad};

/// `ε`: far below what conformality weighs and far above rounding. The sheet is scaled afterwards, so its size does not count.
const PULL: f64 = 1e-6;
/// Keeps unknowns of a half step that the other one does not use.
const IDLE: f64 = 1e-9;
/// Conformality of cells that the picture does not show, relative to those it does: they only carry on.
const OUTSIDE: f64 = 0.1;
/// Unknowns of a line: c; a (2); d (2).
const LINE_UNKNOWNS: usize = 5;
/// Unknowns of a face: a, b; c (2).
const FACE_UNKNOWNS: usize = 4;
/// A round that moves no vertex by more, cells, ends the alternation. Lines are straight after every half step; what rounds
/// gain is shape, and that is a thousandth of the energy by then.
const STILL: f64 = 0.02;
/// Times the conformality of folding cells is raised before going back.
const FOLD_ROUNDS: usize = 8;
/// Halvings on the way back to a sheet without folds.
const BACKTRACKS: i32 = 30;

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
    /// Rounds of the alternation at most, ≥ 1.
    pub rounds: usize,
}

impl Default for EnergyWeights {
    fn default() -> Self {
        Self { conformality: 0.16, smooth_length: 0.15, straightness: 1e4, faces: 1e3, rounds: 20 }
    }
}

/// The sheet of one view: lines and faces are given, vertices are asked for.
pub(super) struct Sheet<'a> {
    sphere: &'a SphereGrid,
    lines: &'a [GridLine],
    faces: &'a [FaceTarget],
    weights: EnergyWeights,
    /// Conformality of each cell.
    cells: Vec<f64>,
    energy: QuadraticEnergy,
    elements: Elements,
}

/// First element of each sort; cells come first.
#[derive(Clone, Copy, Debug, Default)]
struct Elements {
    smooth: usize,
    lines: usize,
    faces: usize,
    pull: usize,
}

/// How the solve went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct SolveReport {
    /// Linear solves.
    pub(super) iterations: usize,
    /// Cells had to be held stiffer, or the sheet drawn back, to keep it from folding.
    pub(super) folded: bool,
}

impl<'a> Sheet<'a> {
    pub(super) fn new(
        sphere: &'a SphereGrid,
        lines: &'a [GridLine],
        faces: &'a [FaceTarget],
        weights: EnergyWeights,
        cell_weights: &CellWeights,
    ) -> Result<Self, EnergyError> {
        let shown = |(w, inside): (&f64, &bool)| weights.conformality * if *inside { w * w } else { OUTSIDE };
        let cells = cell_weights.0.iter().zip(&sphere.inside).map(shown).collect();
        let (list, elements) = element_list(sphere, lines, faces);
        let unknowns = 2 * sphere.grid.vertex_count() + LINE_UNKNOWNS * lines.len() + FACE_UNKNOWNS * faces.len();
        let energy = QuadraticEnergy::new(unknowns, list.iter().map(Vec::as_slice), &Ordering::Amd)?;
        Ok(Self { sphere, lines, faces, weights, cells, energy, elements })
    }

    /// The vertices in the chart: the regular grid.
    fn rest(&self) -> Vec<Vec2> {
        (0..self.sphere.grid.vertex_count()).map(|i| self.sphere.vertex(i)).collect()
    }

    /// The sheet of least energy that has no fold, in the unit of the chart; lines start as they lie on `coarse`, a sheet of
    /// cells twice as large over the same rectangle.
    pub(super) fn solve(&mut self, coarse: Option<&GridMesh>) -> Result<(GridMesh, SolveReport), EnergyError> {
        let mut sound = coarse.map_or_else(|| self.mesh(self.rest()), halved);
        if sound.folded_cells() > 0 {
            sound = self.mesh(self.rest());
        }
        let mut report = SolveReport { iterations: 0, folded: false };
        for _ in 0..FOLD_ROUNDS {
            let found = self.alternate(&sound, &mut report.iterations)?;
            let folded: Vec<usize> = (0..self.cells.len()).filter(|&cell| folds(&found.quad(cell))).collect();
            if folded.is_empty() {
                return Ok((found, report));
            }
            report.folded = true;
            sound = drawn_back(&sound, &found);
            self.stiffen(&folded);
        }
        Ok((sound, report))
    }

    /// Half steps from `start` until a round moves no vertex by more than [`STILL`].
    fn alternate(&mut self, start: &GridMesh, iterations: &mut usize) -> Result<GridMesh, EnergyError> {
        let still = STILL * self.sphere.cell();
        let free = self.lines.iter().any(|line| line.normal.is_none());
        let mut mesh = start.clone();
        for _ in 0..self.weights.rounds.max(1) {
            let mut moved = 0.0_f64;
            for step in [HalfStep::Slide, HalfStep::Turn] {
                let next = self.half_step(&mesh, step)?;
                *iterations += 1;
                moved = mesh.vertices.iter().zip(&next.vertices).map(|(a, b)| (b - a).norm()).fold(moved, f64::max);
                mesh = next;
                if !free {
                    return Ok(mesh);
                }
            }
            if !(moved > still) {
                break;
            }
        }
        Ok(mesh)
    }

    fn half_step(&mut self, mesh: &GridMesh, step: HalfStep) -> Result<GridMesh, EnergyError> {
        self.energy.clear();
        self.add_conformality();
        self.add_smoothness();
        self.add_lines(mesh, step);
        self.add_faces();
        self.add_pull();
        self.energy.minimize()?;
        let rest = self.rest();
        let found: Vec<Vec2> =
            self.energy.solution().chunks_exact(2).take(rest.len()).map(|u| Vec2::new(u[0], u[1])).collect();
        let dot = |a: &[Vec2]| a.iter().zip(&rest).map(|(a, s)| a.dot(s)).sum::<f64>();
        let scale = dot(&rest) / dot(&found);
        Ok(self.mesh(found.into_iter().map(|u| scale * u).collect()))
    }

    fn mesh(&self, vertices: Vec<Vec2>) -> GridMesh {
        let grid = &self.sphere.grid;
        GridMesh { cols: grid.cols, rows: grid.rows, vertices: vertices.into_iter().map(Point2::from).collect() }
    }

    /// Four times the conformality in these cells and those around them.
    fn stiffen(&mut self, folded: &[usize]) {
        let (cols, rows) = (self.sphere.grid.cols, self.sphere.grid.rows);
        let mut touched = vec![false; self.cells.len()];
        for cell in folded {
            let (i, j) = (cell % cols, cell / cols);
            for row in j.saturating_sub(1)..(j + 2).min(rows) {
                touched[row * cols + i.saturating_sub(1)..row * cols + (i + 2).min(cols)].fill(true);
            }
        }
        self.cells.iter_mut().zip(touched).filter(|(_, touched)| *touched).for_each(|(w, _)| *w *= 4.0);
    }

    fn add_conformality(&mut self) {
        // Corners a b / c d; at each, its neighbor along u and along v, and the signs of the steps there.
        const CORNERS: [(usize, usize, usize, f64, f64); 4] =
            [(0, 1, 2, 1.0, 1.0), (1, 0, 3, -1.0, 1.0), (2, 3, 0, 1.0, -1.0), (3, 2, 1, -1.0, -1.0)];
        for (cell, w) in self.cells.iter().enumerate() {
            for (corner, along, down, su, sv) in CORNERS {
                let (mut x, mut y) = ([0.0; 8], [0.0; 8]);
                for (vertex, u, v) in [(along, su, 0.0), (down, 0.0, sv), (corner, -su, -sv)] {
                    // e_v − R e_u with R (x, y) = (−y, x).
                    (x[2 * vertex], x[2 * vertex + 1]) = (v, u);
                    (y[2 * vertex + 1], y[2 * vertex]) = (v, -u);
                }
                self.energy.add(cell, 0.25 * w, &x, 0.0);
                self.energy.add(cell, 0.25 * w, &y, 0.0);
            }
        }
    }

    fn add_smoothness(&mut self) {
        let w = self.weights.conformality * (self.weights.smooth_length / self.sphere.cell()).powi(2);
        for element in self.elements.smooth..self.elements.lines {
            self.energy.add(element, w, &[1.0, -2.0, 1.0], 0.0);
        }
        for cell in 0..self.cells.len() {
            // The mixed difference occurs twice in the Hessian.
            self.energy.add(cell, 2.0 * w, &[1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0], 0.0);
            self.energy.add(cell, 2.0 * w, &[0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0], 0.0);
        }
    }

    fn add_lines(&mut self, mesh: &GridMesh, step: HalfStep) {
        let mut element = self.elements.lines;
        for line in self.lines {
            let now: Vec<Point2> = line.vertices.iter().map(|p| mesh.at(*p)).collect();
            for (vertex, constraint) in line.vertices.iter().zip(line.constraints(&now, step)) {
                self.add_constraint(element, vertex, constraint);
                element += 1;
            }
        }
    }

    fn add_constraint(&mut self, element: usize, vertex: &CellPoint, constraint: Constraint) {
        let w = self.weights.straightness;
        let mut row = |x: f64, y: f64, unknowns: [f64; LINE_UNKNOWNS]| {
            let mut a = [0.0; 8 + LINE_UNKNOWNS];
            place(&mut a, vertex, x, y);
            a[8..].copy_from_slice(&unknowns);
            self.energy.add(element, w, &a, 0.0);
        };
        match constraint {
            Constraint::Slide(n) => row(n.x, n.y, [-1.0, 0.0, 0.0, 0.0, 0.0]),
            Constraint::Turn(s) => {
                row(1.0, 0.0, [0.0, -1.0, 0.0, -s, 0.0]);
                row(0.0, 1.0, [0.0, 0.0, -1.0, 0.0, -s]);
            }
        }
    }

    fn add_faces(&mut self) {
        let mut element = self.elements.faces;
        for face in self.faces {
            let w = self.weights.faces / face.points.len() as f64;
            for (vertex, t) in &face.points {
                for (x, y, unknowns) in [(1.0, 0.0, [-t.x, t.y, -1.0, 0.0]), (0.0, 1.0, [-t.y, -t.x, 0.0, -1.0])] {
                    let mut a = [0.0; 8 + FACE_UNKNOWNS];
                    place(&mut a, vertex, x, y);
                    a[8..].copy_from_slice(&unknowns);
                    self.energy.add(element, w, &a, 0.0);
                }
                element += 1;
            }
        }
    }

    fn add_pull(&mut self) {
        self.energy.add_everywhere(IDLE, 0.0);
        for i in 0..self.sphere.grid.vertex_count() {
            let s = self.sphere.vertex(i);
            self.energy.add(self.elements.pull + 2 * i, PULL, &[1.0], s.x);
            self.energy.add(self.elements.pull + 2 * i + 1, PULL, &[1.0], s.y);
        }
    }
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
fn halved(mesh: &GridMesh) -> GridMesh {
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
pub(in crate::photo) fn drawn_back(sound: &GridMesh, found: &GridMesh) -> GridMesh {
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

/// The unknowns of every element in the order of [`Elements`], each list ascending.
fn element_list(sphere: &SphereGrid, lines: &[GridLine], faces: &[FaceTarget]) -> (Vec<Vec<usize>>, Elements) {
    let grid = &sphere.grid;
    let corners = |cell: usize| grid.corners(cell).into_iter().flat_map(|i| [2 * i, 2 * i + 1]);
    let mut list: Vec<Vec<usize>> = (0..grid.cell_count()).map(|cell| corners(cell).collect()).collect();
    let mut elements = Elements { smooth: list.len(), ..Elements::default() };
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
    elements.lines = list.len();
    let mut extra = 2 * grid.vertex_count();
    for line in lines {
        list.extend(line.vertices.iter().map(|p| corners(p.cell).chain(extra..extra + LINE_UNKNOWNS).collect()));
        extra += LINE_UNKNOWNS;
    }
    elements.faces = list.len();
    for face in faces {
        list.extend(face.points.iter().map(|(p, _)| corners(p.cell).chain(extra..extra + FACE_UNKNOWNS).collect()));
        extra += FACE_UNKNOWNS;
    }
    elements.pull = list.len();
    list.extend((0..2 * grid.vertex_count()).map(|i| vec![i]));
    (list, elements)
}
