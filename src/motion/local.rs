//! Local motion: how far each part of the picture moves beside the homography, on a regular grid of vertices.
//!
//! Parallax, rolling shutter and bending lenses leave residuals `dᵢ = qᵢ − H pᵢ` that vary over the frame. The displacements
//! `v` of the grid's vertices minimize
//!
//! ```text
//! Σᵢ ωᵢ ψᵢ ‖Σₖ bₖ(qᵢ) vₖ − dᵢ‖²  +  α Σ_(j,k)∈edges ‖vⱼ − vₖ‖²  +  β Σₖ ‖vₖ‖²
//! ```
//!
//! `bₖ` are the bilinear weights of `qᵢ` in its cell, `ψᵢ = 1/(1+(rᵢ/c)²)²` keeps single wrong tracks out (two passes, from
//! the residual of the field itself), `α` spreads what is known to the neighbors, and `β` lets parts without points come to
//! rest on the homography. x and y share one banded matrix. MeshFlow takes medians instead; least squares uses where in its
//! cell a point lies and needs no second filter.
//!
//! # Reference
//! Liu, Tan, Yuan, Sun, Zeng, *MeshFlow: minimum latency online video stabilization*, ECCV 2016 (motion per vertex).

use crate::math::{Homography, Point2, Vec2};

use super::planar_fit::Pair;

/// Steps of the stored fixed point per px: 1/64 px is below what tracks resolve, and reaches ±512 px.
const STEPS_PER_PX: f64 = 64.0;
/// α: a vertex follows its own points rather than its neighbors once it sees more than about four.
const SMOOTH: f64 = 1.0;
/// β: without points the field falls to half over about three cells.
const REST: f64 = 0.06;

/// Displacements of the vertices of a regular grid over the frame, beside the homography; px in this frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LocalMotion {
    cols: u16,
    rows: u16,
    steps: Vec<[i16; 2]>,
}

impl LocalMotion {
    /// Cells across and down.
    pub fn cells(&self) -> (usize, usize) {
        (usize::from(self.cols), usize::from(self.rows))
    }

    /// Displacement of vertex `col, row`, `0 ≤ col ≤ cols`, px.
    pub fn vertex(&self, col: usize, row: usize) -> Vec2 {
        let [x, y] = self.steps[row * (usize::from(self.cols) + 1) + col];
        Vec2::new(f64::from(x), f64::from(y)) / STEPS_PER_PX
    }

    /// Root mean square displacement of the vertices, px.
    pub fn rms_px(&self) -> f64 {
        let square = |s: &[i16; 2]| f64::from(s[0]).powi(2) + f64::from(s[1]).powi(2);
        (self.steps.iter().map(square).sum::<f64>() / self.steps.len().max(1) as f64).sqrt() / STEPS_PER_PX
    }
}

/// Fits [`LocalMotion`]s on one grid; keeps its scratch.
#[derive(Clone, Debug)]
pub struct LocalMotionSolver {
    cols: usize,
    rows: usize,
    cell: Vec2,
    band: Vec<f64>,
    rhs: Vec<Vec2>,
}

/// A point's four vertices with their bilinear weights, and its residual.
struct Datum {
    vertices: [usize; 4],
    weights: [f64; 4],
    residual: Vec2,
}

impl LocalMotionSolver {
    /// A grid of `cols × rows` cells, each 1 to 64, over a frame of `width × height` px.
    pub fn new(cols: usize, rows: usize, width: u32, height: u32) -> Self {
        let (cols, rows) = (cols.clamp(1, 64), rows.clamp(1, 64));
        let cell = Vec2::new(f64::from(width.max(1)) / cols as f64, f64::from(height.max(1)) / rows as f64);
        Self { cols, rows, cell, band: Vec::new(), rhs: Vec::new() }
    }

    /// The local motion beside `homography` that the background `pairs` show; `tolerance_px` is the residual at which a
    /// single point counts a quarter.
    pub fn fit(&mut self, homography: &Homography, pairs: &[Pair], tolerance_px: f64) -> LocalMotion {
        let datum = |pair: &Pair| {
            let (vertices, weights) = self.bilinear(pair.this);
            Some(Datum { vertices, weights, residual: pair.this - homography.apply(pair.previous)? })
        };
        let data: Vec<Datum> = pairs.iter().filter_map(datum).collect();
        let votes = self.votes(&data);
        let mut field = vec![Vec2::zeros(); (self.cols + 1) * (self.rows + 1)];
        // First pass generous, against the resting field; second against the first one's.
        for c in [4.0 * tolerance_px, tolerance_px] {
            let weigh = |(d, vote): (&Datum, &f64)| {
                let predicted: Vec2 = (0..4).map(|k| field[d.vertices[k]] * d.weights[k]).sum();
                let q = (d.residual - predicted).norm_squared() / (c * c);
                vote / ((1.0 + q) * (1.0 + q))
            };
            let weights: Vec<f64> = data.iter().zip(&votes).map(weigh).collect();
            self.solve(&data, &weights);
            field.copy_from_slice(&self.rhs);
        }
        let fixed = |v: f64| (v * STEPS_PER_PX).round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16;
        let steps = field.iter().map(|v| [fixed(v.x), fixed(v.y)]).collect();
        LocalMotion { cols: self.cols as u16, rows: self.rows as u16, steps }
    }

    /// ωᵢ: crowded cells weigh as much as four points together.
    fn votes(&self, data: &[Datum]) -> Vec<f64> {
        let mut count = vec![0.0f64; (self.cols + 1) * (self.rows + 1)];
        for d in data {
            count[d.vertices[0]] += 1.0;
        }
        data.iter().map(|d| (4.0 / count[d.vertices[0]]).min(1.0)).collect()
    }

    fn bilinear(&self, p: Point2) -> ([usize; 4], [f64; 4]) {
        let at = |v: f64, size: f64, n: usize| {
            let u = (v / size).clamp(0.0, n as f64);
            let k = (u as usize).min(n - 1);
            (k, u - k as f64)
        };
        let ((col, u), (row, v)) = (at(p.x, self.cell.x, self.cols), at(p.y, self.cell.y, self.rows));
        let first = self.index(col, row);
        let (right, below) = (self.index(col + 1, row), self.index(col, row + 1));
        let vertices = [first, right, below, right + below - first];
        (vertices, [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v])
    }

    /// Vertices are numbered row by row, as they are stored.
    fn index(&self, col: usize, row: usize) -> usize {
        row * (self.cols + 1) + col
    }

    /// Half-bandwidth of the normal matrix: the vertex diagonally below.
    fn reach(&self) -> usize {
        self.cols + 2
    }

    /// Minimizes for given weights; the field is left in `rhs`.
    fn solve(&mut self, data: &[Datum], weights: &[f64]) {
        let (n, reach) = ((self.cols + 1) * (self.rows + 1), self.reach());
        self.band.clear();
        self.band.resize(n * (reach + 1), 0.0);
        self.rhs.clear();
        self.rhs.resize(n, Vec2::zeros());
        for (d, w) in data.iter().zip(weights) {
            for a in 0..4 {
                self.rhs[d.vertices[a]] += d.residual * (w * d.weights[a]);
                for b in 0..=a {
                    self.add(d.vertices[a], d.vertices[b], w * d.weights[a] * d.weights[b]);
                }
            }
        }
        for row in 0..=self.rows {
            for col in 0..=self.cols {
                let here = self.index(col, row);
                self.add(here, here, REST);
                let right = (col < self.cols).then(|| here + 1);
                let below = (row < self.rows).then(|| here + self.cols + 1);
                for other in right.into_iter().chain(below) {
                    self.add(here, here, SMOOTH);
                    self.add(other, other, SMOOTH);
                    self.add(other, here, -SMOOTH);
                }
            }
        }
        factor_and_solve(&mut self.band, &mut self.rhs, reach);
    }

    /// Adds to entry `i ≥ j` of the lower band, stored row by row with the diagonal last.
    fn add(&mut self, i: usize, j: usize, value: f64) {
        let reach = self.reach();
        self.band[i * (reach + 1) + reach + j - i] += value;
    }
}

/// Cholesky factorization in place of a banded positive definite matrix, and the solution in place of `rhs`.
///
/// A dozen lines instead of a general sparse solver: 170 unknowns with a band of 18 cost 60 000 multiplications, less than the
/// analysis of a general one. Definite because of `REST`.
fn factor_and_solve(band: &mut [f64], rhs: &mut [Vec2], reach: usize) {
    let width = reach + 1;
    let at = |i: usize, j: usize| i * width + reach + j - i;
    for i in 0..rhs.len() {
        let first = i.saturating_sub(reach);
        for j in first..=i {
            let from = first.max(j.saturating_sub(reach));
            let sum: f64 = (from..j).map(|k| band[at(i, k)] * band[at(j, k)]).sum();
            let value = band[at(i, j)] - sum;
            band[at(i, j)] = if i == j { value.sqrt() } else { value / band[at(j, j)] };
        }
        let known: Vec2 = (first..i).map(|k| rhs[k] * band[at(i, k)]).sum();
        rhs[i] = (rhs[i] - known) / band[at(i, i)];
    }
    for i in (0..rhs.len()).rev() {
        let last = (i + reach).min(rhs.len() - 1);
        let known: Vec2 = (i + 1..=last).map(|k| rhs[k] * band[at(k, i)]).sum();
        rhs[i] = (rhs[i] - known) / band[at(i, i)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_banded_solver_solves() {
        let (n, reach) = (7, 2);
        let entry = |i: usize, j: usize| if i == j { 4.0 + i as f64 } else { -1.0 / (i - j) as f64 };
        let mut band = vec![0.0; n * (reach + 1)];
        let mut dense = nalgebra::DMatrix::<f64>::zeros(n, n);
        for i in 0..n {
            for j in i.saturating_sub(reach)..=i {
                band[i * (reach + 1) + reach + j - i] = entry(i, j);
                dense[(i, j)] = entry(i, j);
                dense[(j, i)] = entry(i, j);
            }
        }
        let truth: Vec<Vec2> = (0..n).map(|i| Vec2::new(i as f64 - 3.0, (i * i) as f64)).collect();
        let mut rhs: Vec<Vec2> = (0..n).map(|i| (0..n).map(|j| truth[j] * dense[(i, j)]).sum()).collect();
        factor_and_solve(&mut band, &mut rhs, reach);
        for (found, truth) in rhs.iter().zip(&truth) {
            assert!((found - truth).norm() < 1e-12, "{found} against {truth}");
        }
    }
}
