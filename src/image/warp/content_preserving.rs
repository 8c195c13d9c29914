//! Content-preserving warp: a grid follows scattered points while its cells keep their shape where it would show.
//!
//! A homography `H` (the pre-warp) carries the grid to `V̂`; the unknowns are the vertices `V`. With `P̂ₖ` the source
//! points, `Pₖ` their targets, `βₖ` the bilinear coordinates of `H P̂ₖ` in its pre-warped cell, all in units of a cell
//! (`√(cell area)` of the source grid):
//!
//! ```text
//! E  = E_d + α E_s + E_p
//! E_d = Σₖ λₖ |βₖ · V_{c(k)} − Pₖ|²
//! E_s = Σ_cells w_s Σ_8 triangles |V₁ − (V₂ + u (V₃ − V₂) + v R₉₀ (V₃ − V₂))|²,      R₉₀ = [0 1; −1 0]
//! E_p = ε Σᵢ |Vᵢ − V̂ᵢ|²
//! ```
//!
//! The eight triangles of a cell have their right angle (before the pre-warp) at `V₂`, any of the four corners, and `V₁`,
//! `V₃` at its two neighbors, either way round; `(u, v)` are the coordinates of `V̂₁` in the frame of `V̂₂V̂₃`.
//!
//! **Over ℂ.** A similarity is `z ↦ az + b`, so with `c = u − iv` a triangle costs `|z₁ − z₂ − c (z₃ − z₂)|²`: linear in
//! complex unknowns, one per vertex. The Hermitian system has half the unknowns of the real one. The two triangles at a
//! corner `k` with edges `a = V̂_m − V̂_k`, `b = V̂_n − V̂_k` ask the same, `b (z_m − z_k) = a (z_n − z_k)`, one scaled by
//! `1/|b|`, the other by `1/|a|`: together one row of weight `1/|a|² + 1/|b|²`.
//!
//! **Unknowns** are the displacements `d = V − V̂`. They vanish in `E_s` and `E_p` by construction, so that without points,
//! or with points that `H` explains, the mesh is the pre-warp to the last bit of rounding.
//!
//! **Weights.** The paper sets `λₖ = lₖ` (a temporal fade) and `α` = 20 for the few hundred points of its tracker. Both
//! energies scale alike with resolution and with the number of cells, but not with the number of points, hence
//! `λₖ = lₖ N₀ / max(Σl, N_min)` with `N₀` the paper's number. `E_p` is ours: it lets cells far from all points return to
//! the pre-warp instead of extrapolating, and keeps the system regular.
//!
//! **Folds.** Least squares does not forbid them. A mesh with a fold is solved again with `α` four times larger until it
//! has none; in the limit one similarity remains. Where even that folds (all targets on one spot), the pre-warp is returned.
//!
//! # Reference
//! F. Liu, M. Gleicher, H. Jin, A. Agarwala, *Content-preserving warps for 3D video stabilization*, ACM Trans. Graph.
//! (SIGGRAPH) 28 (2009), section 4.

use super::WarpError;
use super::cell_saliency::BASE;
use crate::grid::{Grid, GridMesh};
use plumbline_num::energy::{Complex, Ordering, QuadraticEnergy};
use plumbline_num::math::{Homography, Point2};
use plumbline_num::options::OptionError;
use plumbline_num::run::Run;

/// `N₀`: the number of points for which the paper's `α` = 20 is meant. Larger weights points more against shape.
const REFERENCE_POINTS: f64 = 400.0;

/// `N_min`: total weight of points below which each keeps its share of it instead of `N₀`. Without it, three points (or
/// all points in the first frame of their fade) would bend the frame as much as four hundred.
const MIN_POINTS: f64 = 50.0;

/// Increases of `α` before the solver gives up: at 4¹² times its weight, rounding exceeds `E_d`.
const MAX_FOLD_ITERATIONS: i32 = 12;

/// Where a point of the source should go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointPair {
    /// Place in the source frame, px. Points outside the frame are left out.
    pub src: Point2,
    /// Place wanted in the output, px.
    pub dst: Point2,
    /// `lₖ` ≥ 0, dimensionless; 1 for a point that counts fully.
    pub weight: f64,
}

/// Weights of the energies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContentPreservingOptions {
    /// `α` > 0: stiffness of cells against the pull of points. The paper's 20 keeps shapes; 1 follows points with visible
    /// swimming, 1000 leaves hardly more than a similarity.
    pub alpha: f64,
    /// Weight of the pre-warp relative to all points together, in (0, 1]: `ε = proximity·N₀ / vertices`. At 0.005 a
    /// frame evenly covered by points deviates from them by half a percent of the pre-warp's residual; at 0.1 the mesh
    /// hardly leaves the pre-warp, at 10⁻⁶ cells without points extrapolate freely.
    pub proximity: f64,
}

impl Default for ContentPreservingOptions {
    fn default() -> Self {
        Self { alpha: 20.0, proximity: 0.005 }
    }
}

/// How a warp came about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarpReport {
    /// Points that took part: inside the frame, weight above 0.
    pub points: usize,
    /// Points left out because their source lies outside the frame.
    pub outside: usize,
    /// `α` of the returned mesh.
    pub alpha: f64,
    /// Times `α` was raised to remove folds.
    pub raised: i32,
    /// True where folds would not go and the mesh is the pre-warp itself.
    pub reverted: bool,
    /// Weighted root mean square distance of points from their targets under the pre-warp alone, px.
    pub prewarp_rms_px: f64,
    /// The same under the returned mesh, px.
    pub rms_px: f64,
}

/// A point in its cell, ready for the energy. Lengths in cells.
#[derive(Clone, Copy, Debug)]
struct DataTerm {
    cell: u32,
    beta: [f64; 4],
    /// Target minus pre-warped source.
    residual: Complex,
    weight: f64,
}

/// The solver of one clip: the pattern is analyzed once, each frame refills values. Nothing is allocated per frame beyond
/// the first, unless a frame has more points than any before.
#[derive(Debug)]
pub struct ContentPreserving {
    grid: Grid,
    options: ContentPreservingOptions,
    /// Length of a cell, `√(cell width · cell height)`, px.
    cell_px: f64,
    energy: QuadraticEnergy<Complex>,
    prewarped: GridMesh,
    data: Vec<DataTerm>,
}

impl ContentPreserving {
    /// A solver for frames of `width × height` px under a grid of `cols × rows` cells.
    ///
    /// # Errors
    /// [`WarpError::Input`] for another grid, [`WarpError::Option`] for values out of range.
    pub fn new(
        cols: usize,
        rows: usize,
        width: f64,
        height: f64,
        options: ContentPreservingOptions,
    ) -> Result<Self, WarpError> {
        let positive = |v: f64| v > 0.0 && v.is_finite();
        if !((1..=1024).contains(&cols) && (1..=1024).contains(&rows) && positive(width) && positive(height)) {
            let grid = format!("a grid of {cols}×{rows} cells over {width}×{height} px");
            return Err(WarpError::Input(format!("{grid} is invalid (1 to 1024 cells each way, size above 0)")));
        }
        check_alpha(options.alpha)?;
        let proximity = options.proximity;
        OptionError::check(proximity > 0.0 && proximity <= 1.0, "proximity", proximity, "above 0, at most 1")?;
        let grid = Grid { cols, rows, width, height };
        let cells: Vec<[usize; 4]> = (0..grid.cell_count()).map(|c| grid.corners(c)).collect();
        let positions = (0..grid.vertex_count()).map(|i| grid.vertex(i)).map(|p| [p.x, p.y, 0.0]).collect();
        let ordering = Ordering::NestedDissection(positions);
        let energy = QuadraticEnergy::new(grid.vertex_count(), cells.iter().map(|c| &c[..]), &ordering)?;
        let (cell_width, cell_height) = grid.cell_size();
        let cell_px = (cell_width * cell_height).sqrt();
        Ok(Self { grid, options, cell_px, energy, prewarped: grid.to_mesh(), data: Vec::new() })
    }

    /// Sets `α` for the frames to come.
    ///
    /// # Errors
    /// [`WarpError::Option`] for a value that is not above 0.
    pub fn set_alpha(&mut self, alpha: f64) -> Result<(), WarpError> {
        check_alpha(alpha)?;
        self.options.alpha = alpha;
        Ok(())
    }

    /// The grid over the source frame.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The mesh, `out_from_src`, of one frame.
    ///
    /// `pre_warp` maps source to output, near to where the points go; `saliency` is [`super::cell_saliency`] of the frame,
    /// or empty for 0.5 everywhere.
    ///
    /// # Errors
    /// [`WarpError::Input`] for input that cannot be used.
    pub fn solve(
        &mut self,
        pre_warp: &Homography,
        points: &[PointPair],
        saliency: &[f64],
    ) -> Result<(GridMesh, WarpReport), WarpError> {
        let mut mesh = self.grid.to_mesh();
        let report = self.solve_into(pre_warp, points, saliency, &mut mesh)?;
        Ok((mesh, report))
    }

    /// [`Self::solve`] into a mesh that is reused from frame to frame.
    ///
    /// # Errors
    /// As [`Self::solve`]; the mesh is then unspecified.
    pub fn solve_into(
        &mut self,
        pre_warp: &Homography,
        points: &[PointPair],
        saliency: &[f64],
        mesh: &mut GridMesh,
    ) -> Result<WarpReport, WarpError> {
        self.check_saliency(saliency)?;
        self.prewarp(pre_warp)?;
        let outside = self.place_points(pre_warp, points)?;
        mesh.copy_from(&self.prewarped);
        let rms_px = self.rms_px(|_| Complex::new(0.0, 0.0));
        let mut report = WarpReport {
            points: self.data.len(),
            outside,
            alpha: self.options.alpha,
            raised: 0,
            reverted: false,
            prewarp_rms_px: rms_px,
            rms_px,
        };
        if !self.data.is_empty() {
            self.deform(saliency, mesh, &mut report)?;
        }
        Ok(report)
    }

    /// Solves with growing `α` until no cell folds.
    fn deform(&mut self, saliency: &[f64], mesh: &mut GridMesh, report: &mut WarpReport) -> Result<(), WarpError> {
        for raised in 0..=MAX_FOLD_ITERATIONS {
            let alpha = self.options.alpha * 4_f64.powi(raised);
            self.assemble(alpha, saliency);
            let cell_px = self.cell_px;
            let displacement = self.energy.minimize(&Run::default())?;
            for ((v, v_hat), d) in mesh.vertices.iter_mut().zip(&self.prewarped.vertices).zip(displacement) {
                *v = Point2::new(v_hat.x + d.re * cell_px, v_hat.y + d.im * cell_px);
            }
            if mesh.folded_cells() == 0 {
                (report.alpha, report.raised) = (alpha, raised);
                report.rms_px = self.rms_px(|i| self.energy.solution()[i]);
                return Ok(());
            }
        }
        mesh.copy_from(&self.prewarped);
        report.raised = MAX_FOLD_ITERATIONS;
        report.reverted = true;
        Ok(())
    }

    /// Carries the grid to `V̂`.
    fn prewarp(&mut self, pre_warp: &Homography) -> Result<(), WarpError> {
        let nowhere = Point2::new(f64::NAN, f64::NAN);
        for i in 0..self.grid.vertex_count() {
            self.prewarped.vertices[i] = pre_warp.apply(self.grid.vertex(i)).unwrap_or(nowhere);
        }
        let one_to_one = |cell: usize| self.prewarped.quad(cell).min_jacobian() > 0.0;
        match (0..self.grid.cell_count()).find(|&cell| !one_to_one(cell)) {
            None => Ok(()),
            Some(cell) => Err(WarpError::Input(format!(
                "the pre-warp does not map the image one to one: cell {cell} folds or reaches infinity"
            ))),
        }
    }

    /// Finds each point's cell and bilinear coordinates; returns how many lie outside the frame.
    fn place_points(&mut self, pre_warp: &Homography, points: &[PointPair]) -> Result<usize, WarpError> {
        self.data.clear();
        let mut outside = 0;
        for (index, point) in points.iter().enumerate() {
            let PointPair { src, dst, weight } = *point;
            let finite = [src.x, src.y, dst.x, dst.y, weight].iter().all(|v| v.is_finite());
            if !(finite && weight >= 0.0) {
                let [src, dst] = [src, dst].map(|p| format!("({}, {})", p.x, p.y));
                let point = format!("point {index} is not usable: source {src}, target {dst}, weight {weight}");
                return Err(WarpError::Input(format!("{point} (finite, weight 0 or more)")));
            }
            match (self.grid.locate(src), pre_warp.apply(src)) {
                (Some(at), Some(h_src)) if weight > 0.0 => {
                    // H bends lines of constant s slightly: the place in the source cell is only a guess.
                    let quad = self.prewarped.quad(at.cell);
                    let (s, t) = quad.inverse(h_src, (at.s, at.t)).unwrap_or((at.s, at.t));
                    let off = (dst - h_src) / self.cell_px;
                    let beta = crate::grid::Quad::weights(s, t);
                    self.data.push(DataTerm {
                        cell: at.cell as u32,
                        beta,
                        residual: Complex::new(off.x, off.y),
                        weight,
                    });
                }
                (Some(_), Some(_)) => {}
                _ => outside += 1,
            }
        }
        Ok(outside)
    }

    fn check_saliency(&self, saliency: &[f64]) -> Result<(), WarpError> {
        let cells = self.grid.cell_count();
        let bad = |value: f64| !(value > 0.0 && value.is_finite());
        let (cell, value) = match saliency.iter().position(|&value| bad(value)) {
            Some(cell) => (cell, saliency[cell]),
            None if saliency.is_empty() || saliency.len() == cells => return Ok(()),
            None => (saliency.len().min(cells), f64::NAN),
        };
        let expected = format!("expected {cells} finite numbers above 0, or none");
        Err(WarpError::Input(format!("saliency of cell {cell} is {value} ({expected})")))
    }

    fn assemble(&mut self, alpha: f64, saliency: &[f64]) {
        self.energy.clear();
        self.add_similarity(alpha, saliency);
        self.add_data();
        let epsilon = self.options.proximity * REFERENCE_POINTS / self.grid.vertex_count() as f64;
        self.energy.add_everywhere(epsilon, Complex::new(0.0, 0.0));
    }

    /// `α E_s`: per corner the row `b z_m − a z_n + (a − b) z_k`, whose two triangles weigh `1/|a|² + 1/|b|²`.
    fn add_similarity(&mut self, alpha: f64, saliency: &[f64]) {
        let to_cells = 1.0 / self.cell_px;
        for cell in 0..self.grid.cell_count() {
            let w_s = alpha * saliency.get(cell).copied().unwrap_or(BASE);
            let z = self.prewarped.quad(cell).0.map(|p| Complex::new(p.x * to_cells, p.y * to_cells));
            let mut form = [Complex::new(0.0, 0.0); 10];
            for [k, m, n] in RIGHT_ANGLES {
                let (a, b) = (z[m] - z[k], z[n] - z[k]);
                let mut row = [Complex::new(0.0, 0.0); 4];
                (row[m], row[n], row[k]) = (b, -a, a - b);
                add_row(&mut form, w_s * (1.0 / a.norm_sqr() + 1.0 / b.norm_sqr()), &row);
            }
            self.energy.add_form(cell, &form);
        }
    }

    /// `E_d` on displacements: `λₖ |βₖ · d − (Pₖ − H P̂ₖ)|²`.
    fn add_data(&mut self) {
        let sum: f64 = self.data.iter().map(|term| term.weight).sum();
        let scale = REFERENCE_POINTS / sum.max(MIN_POINTS);
        for term in &self.data {
            let beta = term.beta.map(|b| Complex::new(b, 0.0));
            self.energy.add(term.cell as usize, term.weight * scale, &beta, term.residual);
        }
    }

    /// Weighted root mean square distance of the points from their targets under displacements of vertices, px.
    fn rms_px(&self, displacement: impl Fn(usize) -> Complex) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        for term in &self.data {
            let corners = self.grid.corners(term.cell as usize);
            let moved = corners.iter().zip(term.beta).fold(-term.residual, |sum, (&i, b)| sum + displacement(i) * b);
            sum += term.weight * moved.norm_sqr();
            weights += term.weight;
        }
        if weights > 0.0 { (sum / weights).sqrt() * self.cell_px } else { 0.0 }
    }
}

fn check_alpha(alpha: f64) -> Result<(), OptionError> {
    OptionError::check(alpha > 0.0 && alpha.is_finite(), "alpha", alpha, "above 0")
}

/// Corner of the right angle, and its two neighbors, for a cell's corners in the order of [`Grid::corners`].
const RIGHT_ANGLES: [[usize; 3]; 4] = [[0, 1, 2], [1, 3, 0], [2, 0, 3], [3, 2, 1]];

/// Adds `w āᵢ aⱼ` to the lower triangle, row by row.
fn add_row(form: &mut [Complex; 10], w: f64, a: &[Complex; 4]) {
    let mut slot = 0;
    for i in 0..4 {
        let left = a[i].conj() * w;
        for &right in &a[..=i] {
            form[slot] += left * right;
            slot += 1;
        }
    }
}
