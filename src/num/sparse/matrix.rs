//! Symmetric (Hermitian) sparse matrices.

use std::sync::Arc;

use super::{Component, Pattern, Scalar, SparseError};
use crate::math::Lists;

/// A symmetric (for complex entries: Hermitian) matrix, lower triangle over a shared [`Pattern`].
#[derive(Clone, Debug)]
pub struct SparseMatrix<T = f64> {
    pattern: Arc<Pattern>,
    values: Vec<T>,
}

impl<T: Scalar> SparseMatrix<T> {
    /// The zero matrix over a pattern, to be filled.
    pub fn zeros(pattern: Arc<Pattern>) -> Self {
        Self { values: vec![T::default(); pattern.nnz()], pattern }
    }

    /// The sum of the entries `(i, j, a)`. Each stands for itself *and* its mirror image `(j, i, ā)`; one off the
    /// diagonal is therefore given once, in either triangle.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`], [`SparseError::TooLarge`] as for [`Pattern::new`].
    pub fn from_triplets(n: usize, triplets: &[(usize, usize, T)]) -> Result<Self, SparseError> {
        let pattern = Pattern::new(n, triplets.iter().map(|&(i, j, _)| (i, j)))?;
        let mut a = Self::zeros(Arc::new(pattern));
        for &(i, j, v) in triplets {
            if let Some(s) = a.pattern.slot(i, j) {
                a.values[s] += if i >= j { v } else { v.conjugate() };
            }
        }
        Ok(a)
    }

    /// The entries that may be non-zero.
    pub fn pattern(&self) -> &Arc<Pattern> {
        &self.pattern
    }

    /// Number of rows.
    pub fn n(&self) -> usize {
        self.pattern.n()
    }

    /// Entries of the lower triangle, by slot of the pattern.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// The same, writable: refilling a matrix allocates nothing.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// `y = A x`; `x` and `y` have `n` entries.
    pub fn multiply(&self, x: &[T], y: &mut [T]) {
        assert!(x.len() == self.n() && y.len() == self.n(), "vectors of a system of {} unknowns", self.n());
        y.fill(T::default());
        for j in 0..self.n() {
            for s in self.pattern.column(j) {
                let (i, a) = (self.pattern.rows()[s] as usize, self.values[s]);
                y[i] += a * x[j];
                if i != j {
                    y[j] += a.conjugate() * x[i];
                }
            }
        }
    }

    /// `r = b − A x`.
    pub fn residual(&self, x: &[T], b: &[T], r: &mut [T]) {
        self.multiply(x, r);
        for (r, &b) in r.iter_mut().zip(b) {
            *r = b - *r;
        }
    }

    /// First entry that is not finite, as `(row, column)`.
    pub(super) fn first_non_finite(&self) -> Option<(usize, usize)> {
        if self.values.iter().all(|v| v.finite()) {
            return None;
        }
        self.pattern.entries().find(|&(_, _, s)| !self.values[s].finite()).map(|(i, j, _)| (i, j))
    }

    /// All unknowns that non-zero entries join to `unknown`.
    pub fn component_of(&self, unknown: usize) -> Component {
        let nonzero = self.pattern.entries().filter(|&(_, _, s)| self.values[s] != T::default());
        let pairs = nonzero.flat_map(|(i, j, _)| [(i as u32, j as u32), (j as u32, i as u32)]);
        let neighbors = Lists::new(self.n(), pairs);
        let (mut seen, mut stack) = (vec![false; self.n()], vec![unknown]);
        while let Some(v) = stack.pop() {
            if !std::mem::replace(&mut seen[v], true) {
                stack.extend(neighbors.of(v).iter().map(|&w| w as usize));
            }
        }
        Component { unknowns: (0..self.n()).filter(|&v| seen[v]).collect() }
    }
}
