//! Weighted linear least squares by its normal equations.
//!
//! ```text
//! minimize ‖W^½ (A x − b)‖²     ⇔     (Aᵀ W A) x = Aᵀ W b
//! ```
//!
//! The factor of `Aᵀ W A` serves any number of right-hand sides. Its condition number is the square of that of `W^½ A`:
//! beyond 10⁸ take QR ([`super::Method::Qr`]).

use std::sync::Arc;

use super::{Cholesky, GeneralMatrix, Ordering, Pattern, SparseError, SparseMatrix};
use crate::run::Run;

/// `Aᵀ W A`, factored.
#[derive(Debug)]
pub struct NormalEquations {
    /// Columns are the rows of `A`.
    transposed: GeneralMatrix,
    weights: Vec<f64>,
    normal: SparseMatrix,
    cholesky: Cholesky,
}

impl GeneralMatrix {
    /// Factors `Aᵀ W A`; weights of the rows are 1 where none are given.
    ///
    /// # Errors
    /// [`SparseError::Weight`], [`SparseError::Columns`] for bad weights; [`SparseError::Singular`] names the unknowns that no
    /// equation determines; as [`Cholesky::analyze`]; [`SparseError::Interrupted`].
    pub fn factor_ata(
        &self,
        weights: Option<&[f64]>,
        ordering: &Ordering,
        run: &Run,
    ) -> Result<NormalEquations, SparseError> {
        let transposed = self.transposed();
        let mut entries = Vec::new();
        for row in 0..self.rows() {
            let columns: Vec<usize> = transposed.column(row).map(|(j, _)| j).collect();
            entries.extend(columns.iter().enumerate().flat_map(|(k, &i)| columns[..k].iter().map(move |&j| (i, j))));
        }
        let pattern = Arc::new(Pattern::new(self.columns(), entries)?);
        let mut this = NormalEquations {
            weights: vec![1.0; self.rows()],
            normal: SparseMatrix::zeros(Arc::clone(&pattern)),
            cholesky: Cholesky::analyze(&pattern, ordering)?,
            transposed,
        };
        match weights {
            Some(weights) => this.reweight(weights, run)?,
            None => this.refactor(run)?,
        }
        Ok(this)
    }
}

impl NormalEquations {
    /// Takes other weights, one for each row, and factors anew.
    ///
    /// # Errors
    /// As [`GeneralMatrix::factor_ata`]; for bad weights nothing has changed.
    pub fn reweight(&mut self, weights: &[f64], run: &Run) -> Result<(), SparseError> {
        if weights.len() != self.weights.len() {
            return Err(SparseError::Columns { given: weights.len(), expected: self.weights.len() });
        }
        if let Some(row) = weights.iter().position(|&w| !(w >= 0.0 && w.is_finite())) {
            return Err(SparseError::Weight { row, weight: weights[row] });
        }
        self.weights.copy_from_slice(weights);
        self.refactor(run)
    }

    fn refactor(&mut self, run: &Run) -> Result<(), SparseError> {
        self.normal.values_mut().fill(0.0);
        let pattern = Arc::clone(self.normal.pattern());
        for (row, &w) in self.weights.iter().enumerate() {
            for (j, a) in self.transposed.column(row) {
                for (i, b) in self.transposed.column(row).filter(|&(i, _)| i >= j) {
                    let slot = pattern.slot(i, j).expect("the pattern holds all pairs of a row");
                    self.normal.values_mut()[slot] += w * a * b;
                }
            }
        }
        self.cholesky.factor(&self.normal, run)
    }

    /// The least-squares solutions for columns of `m` values one after another: `n` values for each.
    ///
    /// # Errors
    /// [`SparseError::Columns`].
    pub fn solve_ata(&mut self, b: &[f64]) -> Result<Vec<f64>, SparseError> {
        let (m, n) = (self.weights.len(), self.normal.n());
        if m == 0 || !b.len().is_multiple_of(m) {
            return Err(SparseError::Columns { given: b.len(), expected: m });
        }
        let mut x = vec![0.0; b.len() / m * n];
        for (b, x) in b.chunks_exact(m).zip(x.chunks_exact_mut(n.max(1))) {
            for (row, (&b, &w)) in b.iter().zip(&self.weights).enumerate() {
                self.transposed.column(row).for_each(|(j, a)| x[j] += a * w * b);
            }
        }
        self.cholesky.solve_in_place(&mut x);
        Ok(x)
    }

    /// `Aᵀ W A`.
    pub fn normal_matrix(&self) -> &SparseMatrix {
        &self.normal
    }

    /// Its factor.
    pub fn cholesky(&self) -> &Cholesky {
        &self.cholesky
    }
}
