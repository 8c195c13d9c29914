//! The global step of every method here: a Laplacian with some vertices held.
//!
//! ```text
//! minimize  q Σ_ij w_ij |xᵢ − xⱼ|² − 2 b · x + Σ_k μ_k |x_k − t_k|²    over the free vertices, the others given
//! A x_f = b_f − A_fh x_h + μ t,          A = q L_ff + diag(μ)
//! ```
//!
//! All three coordinates share the factor. It depends on the mesh and on which vertices are held; a solve costs two
//! triangular substitutions.

use super::held::{FIXED, Held};
use super::lanes::Lanes;
use crate::mesh::operators::EdgeWeights;
use plumbline_num::run::Run;
use plumbline_num::sparse::{Cholesky, CompactFactor, Ordering, Pattern, SparseError, SparseMatrix};

/// The factored system.
#[derive(Debug)]
pub(super) struct HeldLaplacian {
    free: Vec<u32>,
    /// `(unknown, vertex, q w)` of edges between a free and a fixed vertex.
    borders: Vec<(u32, u32, f64)>,
    /// `(unknown, number of the handle, μ)`.
    soft: Vec<(u32, usize, f64)>,
    /// None where nothing is free.
    factor: Option<CompactFactor>,
    points: Vec<[f64; 3]>,
}

impl HeldLaplacian {
    /// Factors `q L` of these weights; `q > 0`.
    ///
    /// # Errors
    /// As [`Cholesky::analyze`] and [`Cholesky::factor`].
    pub(super) fn new(weights: &EdgeWeights, q: f64, held: &Held, run: &Run) -> Result<Self, SparseError> {
        let n = held.free.len();
        let unknowns = |i: usize, j: usize| (held.unknown[i], held.unknown[j]);
        let inner = weights.iter().filter_map(|(i, j, w)| match unknowns(i, j) {
            (FIXED, _) | (_, FIXED) => None,
            (i, j) => Some((i as usize, j as usize, w)),
        });
        let pattern = std::sync::Arc::new(Pattern::new(n, inner.map(|(i, j, _)| (i, j)))?);
        let mut matrix = SparseMatrix::zeros(std::sync::Arc::clone(&pattern));
        let diagonal = pattern.column_starts();
        let mut next: Vec<u32> = diagonal[..n].iter().map(|s| s + 1).collect();
        let mut borders = Vec::new();
        let values = matrix.values_mut();
        for (i, j, w) in weights.iter() {
            let w = q * w;
            let (a, b) = unknowns(i, j);
            for (unknown, other, vertex) in [(a, b, j), (b, a, i)] {
                if unknown != FIXED {
                    values[diagonal[unknown as usize] as usize] += w;
                    if other == FIXED {
                        borders.push((unknown, vertex as u32, w));
                    }
                }
            }
            // Edges ascend as the slots below the diagonal do: free vertices are numbered in ascending order.
            if a != FIXED && b != FIXED {
                values[next[a as usize] as usize] = -w;
                next[a as usize] += 1;
            }
        }
        let soft = |&(k, weight): &(usize, f64)| (held.unknown[held.handles.vertices()[k] as usize], k, weight);
        let soft: Vec<(u32, usize, f64)> = held.soft.iter().map(soft).collect();
        for &(unknown, _, weight) in &soft {
            values[diagonal[unknown as usize] as usize] += weight;
        }
        let factor = factored(&matrix, run)?;
        Ok(Self { free: held.free.clone(), borders, soft, factor, points: vec![[0.0; 3]; n] })
    }

    /// What the held vertices add to the right-hand side: `−A_fh x_h + μ t`, one entry per unknown. `x` holds the fixed
    /// vertices where they are wanted, `targets` the positions of all handles.
    pub(super) fn pull(&self, x: &[Lanes], targets: &[Lanes]) -> Vec<Lanes> {
        let mut pull = vec![Lanes::ZERO; self.free.len()];
        for &(unknown, vertex, w) in &self.borders {
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
            let d = x[self.free[unknown as usize] as usize] - targets[k];
            weight * d.dot(d)
        };
        self.soft.iter().map(of).sum()
    }

    /// Unknowns that are vertices, ascending.
    pub(super) fn free(&self) -> &[u32] {
        &self.free
    }

    /// Adds `μ (x − t)` to the entries of the softly held unknowns.
    pub(super) fn add_soft(&self, x: &[Lanes], targets: &[Lanes], g: &mut [Lanes]) {
        for &(unknown, k, weight) in &self.soft {
            g[unknown as usize] += Lanes::splat(weight) * (x[self.free[unknown as usize] as usize] - targets[k]);
        }
    }

    /// Adds `μ d` to the entries of the softly held unknowns.
    pub(super) fn add_soft_product(&self, d: &[Lanes], y: &mut [Lanes]) {
        for &(unknown, _, weight) in &self.soft {
            y[unknown as usize] += Lanes::splat(weight) * d[unknown as usize];
        }
    }

    /// Replaces a vector with one entry per unknown by `A⁻¹` times it.
    pub(super) fn solve_unknowns(&mut self, v: &mut [Lanes]) {
        for (point, v) in self.points.iter_mut().zip(v.iter()) {
            *point = v.xyz();
        }
        if let Some(factor) = &mut self.factor {
            factor.solve_3(&mut self.points);
        }
        for (v, &point) in v.iter_mut().zip(&self.points) {
            *v = Lanes::point(point);
        }
    }

    /// Moves the free vertices of `x` to the minimizer for the pull `b` of the vertices and that of the handles.
    pub(super) fn solve(&mut self, b: &[Lanes], pull: &[Lanes], x: &mut [Lanes]) {
        for ((point, &v), pull) in self.points.iter_mut().zip(&self.free).zip(pull) {
            *point = (b[v as usize] + *pull).xyz();
        }
        if let Some(factor) = &mut self.factor {
            factor.solve_3(&mut self.points);
        }
        for (&point, &v) in self.points.iter().zip(&self.free) {
            x[v as usize] = Lanes::point(point);
        }
    }
}

/// The factor of a matrix, for many solves; none for a system without unknowns.
pub(super) fn factored(matrix: &SparseMatrix, run: &Run) -> Result<Option<CompactFactor>, SparseError> {
    if matrix.n() == 0 {
        return Ok(None);
    }
    let mut cholesky = Cholesky::analyze(matrix.pattern(), &Ordering::Amd)?;
    cholesky.factor(matrix, run)?;
    Ok(Some(CompactFactor::new(&cholesky)))
}
