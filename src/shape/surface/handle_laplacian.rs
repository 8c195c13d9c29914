//! The global step of the methods: a Laplacian system with hard and soft positional constraints.
//!
//! ```text
//! minimize  q Σ_ij w_ij |xᵢ − xⱼ|² − 2 b · x + Σ_k μ_k |x_k − t_k|²    over the free vertices, the others fixed
//! A x_f = b_f − A_fh x_h + μ t,          A = q L_ff + diag(μ)
//! ```
//!
//! All three coordinates share the factor, which depends on the mesh and on the set of constraints. A solve costs two
//! triangular substitutions.

use super::SurfaceError;
use super::components::Unknowns;
use super::lanes::{LANES, Lanes};
use crate::mesh::operators::{EdgeWeights, factored_laplacian};
use plumbline_num::energy::{ConstrainedLaplacian, FIXED, FactoredLaplacian};
use plumbline_num::run::Run;
use plumbline_num::sparse::Ordering;

/// The factored system.
#[derive(Debug)]
pub(super) struct HandleLaplacian {
    system: FactoredLaplacian,
    /// `(unknown, index of the handle, μ)`.
    soft: Vec<(u32, usize, f64)>,
}

impl HandleLaplacian {
    /// Factors `q L` with these weights; `q > 0`.
    ///
    /// # Errors
    /// [`SurfaceError::IllConditioned`], [`SurfaceError::Solve`] of what is out of proportion to a surface, [`SurfaceError::Interrupted`].
    pub(super) fn new(weights: &EdgeWeights, q: f64, unknowns: &Unknowns, run: &Run) -> Result<Self, SurfaceError> {
        let vertex = |k: usize| unknowns.handles.vertices()[k] as usize;
        let soft_terms = unknowns.soft.iter().map(|&(k, weight)| (vertex(k), vertex(k), weight));
        let terms = weights.iter().map(|(i, j, w)| (i, j, q * w)).chain(soft_terms);
        let laplacian = ConstrainedLaplacian::new(weights.vertex_count(), terms, |v| unknowns.unknown[v] == FIXED)?;
        let system = factored_laplacian(laplacian, &Ordering::Amd, run)
            .map_err(|error| SurfaceError::of_factor(error, 1, |vertex| vertex))?;
        let soft = unknowns.soft.iter().map(|&(k, weight)| (unknowns.unknown[vertex(k)], k, weight)).collect();
        Ok(Self { system, soft })
    }

    /// Keeps the factor in single precision: solves are those of a preconditioner from here on.
    pub(super) fn round(&mut self) {
        self.system.round();
    }

    /// Contribution of the constraints to the right-hand side: `−A_fh x_h + μ t`, one entry per unknown. `x` has the fixed vertices
    /// at their targets, `targets` the targets of all handles.
    pub(super) fn pull(&self, x: &[Lanes], targets: &[Lanes]) -> Vec<Lanes> {
        let mut pull = vec![Lanes::ZERO; self.system.free().len()];
        for &(unknown, vertex, w) in self.system.coupling() {
            pull[unknown as usize] += Lanes::splat(w) * x[vertex as usize];
        }
        for &(unknown, k, weight) in &self.soft {
            pull[unknown as usize] += Lanes::splat(weight) * targets[k];
        }
        pull
    }

    /// `μ |x − t|²` summed.
    pub(super) fn soft_energy(&self, x: &[Lanes], targets: &[Lanes]) -> f64 {
        let of = |&(unknown, k, weight): &(u32, usize, f64)| {
            let d = x[self.free()[unknown as usize] as usize] - targets[k];
            weight * d.dot(d)
        };
        self.soft.iter().map(of).sum()
    }

    /// Vertices of the unknowns, ascending.
    pub(super) fn free(&self) -> &[u32] {
        self.system.free()
    }

    /// Adds `μ (x − t)` to the entries of the unknowns with soft constraints.
    pub(super) fn add_soft(&self, x: &[Lanes], targets: &[Lanes], g: &mut [Lanes]) {
        for &(unknown, k, weight) in &self.soft {
            g[unknown as usize] += Lanes::splat(weight) * (x[self.free()[unknown as usize] as usize] - targets[k]);
        }
    }

    /// Adds `μ d` to the entries of the unknowns with soft constraints.
    pub(super) fn add_soft_product(&self, d: &[Lanes], y: &mut [Lanes]) {
        for &(unknown, _, weight) in &self.soft {
            y[unknown as usize] += Lanes::splat(weight) * d[unknown as usize];
        }
    }

    /// Replaces a vector with one entry per unknown by `A⁻¹` times it.
    pub(super) fn solve_unknowns(&mut self, v: &mut [Lanes]) {
        self.system.solve::<LANES>(bytemuck::cast_slice_mut(v));
    }

    /// Sets the free vertices of `x` to the minimizer for the right-hand sides `b` per vertex and `pull` of the constraints.
    pub(super) fn solve(&mut self, b: &[Lanes], pull: &[Lanes], x: &mut [Lanes]) {
        let mut solution: Vec<Lanes> =
            self.system.free().iter().zip(pull).map(|(&v, &pull)| b[v as usize] + pull).collect();
        self.solve_unknowns(&mut solution);
        for (solution, &v) in solution.into_iter().zip(self.system.free()) {
            x[v as usize] = solution;
        }
    }
}
