//! Incomplete Cholesky factorization without fill: `A ≈ L Lᵀ` with the pattern of `A`.
//!
//! Where a pivot is not positive, which can happen though `A` is positive definite, the diagonal is raised by a growing
//! fraction `α` and the factorization is started anew (Manteuffel).
//!
//! # Reference
//! J. A. Meijerink, H. A. van der Vorst, Math. Comp. 31 (1977); T. A. Manteuffel, *An incomplete factorization technique for
//! positive definite linear systems*, Math. Comp. 34 (1980).

use std::sync::Arc;

use super::Preconditioner;
use crate::sparse::{Pattern, SparseError, SparseMatrix};

/// First fraction by which the diagonal is raised where a pivot fails; it doubles with each failure. Ten times as much costs iterations of
/// the solver on matrices that need little, a tenth costs three more attempts on those that need much.
const FIRST_SHIFT: f64 = 1e-3;
/// Largest fraction tried: a matrix that needs more is not positive definite, nor near it.
const MAX_SHIFT: f64 = 100.0;

/// `L` with the pattern of `A`.
#[derive(Clone, Debug)]
pub struct IncompleteCholesky {
    pattern: Arc<Pattern>,
    values: Vec<f64>,
    shift: f64,
}

impl IncompleteCholesky {
    /// Factors, with the smallest shift that works.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where no shift does: the diagonal is not positive.
    pub fn new(a: &SparseMatrix) -> Result<Self, SparseError> {
        let mut this = Self { pattern: Arc::clone(a.pattern()), values: Vec::new(), shift: 0.0 };
        loop {
            match this.try_factor(a) {
                Ok(()) => return Ok(this),
                Err(unknown) if this.shift > MAX_SHIFT => return Err(SparseError::Pivot { unknown }),
                Err(_) => this.shift = (2.0 * this.shift).max(FIRST_SHIFT),
            }
        }
    }

    /// Fraction by which the diagonal had to be raised.
    pub fn shift(&self) -> f64 {
        self.shift
    }

    /// Right-looking: each column, once final, is subtracted from those it meets, where the pattern has the entry.
    fn try_factor(&mut self, a: &SparseMatrix) -> Result<(), usize> {
        self.values.clear();
        self.values.extend_from_slice(a.values());
        let (pattern, l) = (&self.pattern, &mut self.values);
        let n = pattern.n();
        for j in 0..n {
            l[pattern.column(j).start] *= 1.0 + self.shift;
        }
        for k in 0..n {
            let column = pattern.column(k);
            let pivot = l[column.start];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err(k);
            }
            let pivot = pivot.sqrt();
            l[column.start] = pivot;
            l[column.start + 1..column.end].iter_mut().for_each(|v| *v /= pivot);
            for s in column.start + 1..column.end {
                let (j, ljk) = (pattern.rows()[s] as usize, l[s]);
                let (target, mut at) = (pattern.column(j), pattern.column(j).start);
                for t in s..column.end {
                    let row = pattern.rows()[t];
                    while at < target.end && pattern.rows()[at] < row {
                        at += 1;
                    }
                    if at < target.end && pattern.rows()[at] == row {
                        l[at] -= ljk * l[t];
                    }
                }
            }
        }
        Ok(())
    }
}

impl Preconditioner for IncompleteCholesky {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        let (pattern, l) = (&self.pattern, &self.values);
        z.copy_from_slice(r);
        for j in 0..pattern.n() {
            let column = pattern.column(j);
            z[j] /= l[column.start];
            let zj = z[j];
            for s in column.start + 1..column.end {
                z[pattern.rows()[s] as usize] -= l[s] * zj;
            }
        }
        for j in (0..pattern.n()).rev() {
            let column = pattern.column(j);
            let below = column.start + 1..column.end;
            let known: f64 = below.map(|s| l[s] * z[pattern.rows()[s] as usize]).sum();
            z[j] = (z[j] - known) / l[column.start];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_fill_to_drop_it_is_the_complete_factor() {
        // A chain: elimination in order fills nothing.
        let mut triplets = vec![(0, 0, 2.0)];
        (1..30).for_each(|i| triplets.extend([(i, i, 2.1), (i, i - 1, -1.0)]));
        let a = SparseMatrix::from_triplets(30, &triplets).expect("in range");
        let x: Vec<f64> = (0..30).map(|i| f64::from(i).cos()).collect();
        let (mut b, mut z) = (vec![0.0; 30], vec![0.0; 30]);
        a.multiply(&x, &mut b);
        let mut factor = IncompleteCholesky::new(&a).expect("definite");
        factor.apply(&b, &mut z);
        assert!(factor.shift() == 0.0 && z.iter().zip(&x).all(|(z, x)| (z - x).abs() < 1e-12));
    }

    #[test]
    fn a_breakdown_raises_the_diagonal_and_an_indefinite_matrix_is_refused() {
        // Kershaw's matrix: positive definite, yet the third pivot of its incomplete factor is negative.
        let entries = [(1, 0, -2.0), (2, 1, -2.0), (3, 2, -2.0), (3, 0, 2.0)];
        let mut triplets: Vec<_> = (0..4).map(|i| (i, i, 3.0)).collect();
        triplets.extend(entries);
        let a = SparseMatrix::from_triplets(4, &triplets).expect("in range");
        let factor = IncompleteCholesky::new(&a).expect("shifted");
        assert!(factor.shift() > 0.0 && factor.shift() < 1.0, "{}", factor.shift());
        let negative = SparseMatrix::from_triplets(1, &[(0, 0, -1.0)]).expect("in range");
        assert_eq!(IncompleteCholesky::new(&negative).expect_err("negative"), SparseError::Pivot { unknown: 0 });
    }
}
