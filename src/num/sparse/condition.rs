//! How far a solution can be trusted: condition number, backward error, refinement.
//!
//! `κ₁(A) = ‖A‖₁ ‖A⁻¹‖₁` bounds how much relative errors of `A` and `b` grow in `x`: with κ = 10ᵏ about `16 − k` digits of `x`
//! are right. `‖A⁻¹‖₁` is the maximum of the convex function `‖A⁻¹ x‖₁` over the unit ball of the 1-norm; climbing from
//! vertex to vertex along subgradients finds it, or nearly, in a few solves with `A` and `Aᵀ`.
//!
//! # Reference
//! W. W. Hager, *Condition estimates*, SIAM J. Sci. Stat. Comput. 5 (1984); N. J. Higham, *FORTRAN codes for estimating the
//! one-norm of a real or complex matrix*, ACM TOMS 14 (1988), algorithm 4.1; for refinement N. J. Higham, *Accuracy and
//! Stability of Numerical Algorithms*, 2nd ed. 2002, chapter 12.

use super::{Factor, GeneralMatrix, SparseError};

/// Climbing ends after so many steps at the latest; it nearly always ends after two or three.
const STEPS: usize = 5;

/// A lower bound of `‖A⁻¹‖₁`, seldom off by more than a factor of 3, from solves with `A` and with `Aᵀ`.
pub fn inverse_norm_1(
    n: usize,
    mut solve: impl FnMut(&[f64]) -> Vec<f64>,
    mut solve_transposed: impl FnMut(&[f64]) -> Vec<f64>,
) -> f64 {
    if n == 0 {
        return 0.0;
    }
    let norm_1 = |v: &[f64]| v.iter().map(|v| v.abs()).sum::<f64>();
    let mut x = vec![1.0 / n as f64; n];
    let (mut best, mut last) = (0.0, None);
    for _ in 0..STEPS {
        let y = solve(&x);
        let here = norm_1(&y);
        if !here.is_finite() {
            return f64::INFINITY;
        }
        if here <= best {
            break;
        }
        best = here;
        let sign: Vec<f64> = y.iter().map(|&v| if v >= 0.0 { 1.0 } else { -1.0 }).collect();
        let slope = solve_transposed(&sign);
        let steepest = (0..n).max_by(|&i, &j| slope[i].abs().total_cmp(&slope[j].abs())).unwrap_or(0);
        let along: f64 = slope.iter().zip(&x).map(|(z, x)| z * x).sum();
        if slope[steepest].abs() <= along || last == Some(steepest) {
            break;
        }
        last = Some(steepest);
        x.fill(0.0);
        x[steepest] = 1.0;
    }
    // A vector with alternating, growing entries finds what cancels in the sum.
    let wave = |i: usize| (1.0 + i as f64 / (n.max(2) - 1) as f64) * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let y = solve(&(0..n).map(wave).collect::<Vec<_>>());
    best.max(2.0 * norm_1(&y) / (3.0 * n as f64))
}

/// How a refinement went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Corrections applied.
    pub steps: usize,
    /// `max |b − A x|ᵢ / (|A| |x| + |b|)ᵢ` at the end: the relative change of the data for which `x` is the exact solution.
    pub backward_error: f64,
}

impl Factor {
    /// An estimate of `κ₁(A)`; `None` for QR, and unless `a` is square.
    pub fn condition(&mut self, a: &GeneralMatrix) -> Option<f64> {
        let n = a.columns();
        if a.rows() != n || self.solve_transposed(&vec![0.0; n]).is_none() {
            return None;
        }
        let this = std::cell::RefCell::new(self);
        let forwards = |b: &[f64]| this.borrow_mut().solve(b).unwrap_or_else(|_| vec![f64::NAN; n]);
        let backwards = |b: &[f64]| this.borrow_mut().solve_transposed(b).unwrap_or_else(|| vec![f64::NAN; n]);
        Some(a.norm_1() * inverse_norm_1(n, forwards, backwards))
    }

    /// Improves a solution of a square system: solves for what is still missing, until that no longer shrinks.
    ///
    /// # Errors
    /// [`SparseError::NotSquare`], [`SparseError::Columns`].
    pub fn refine(&mut self, a: &GeneralMatrix, b: &[f64], x: &mut [f64]) -> Result<Refinement, SparseError> {
        let n = a.square()?;
        for given in [b.len(), x.len()] {
            if given != n {
                return Err(SparseError::Columns { given, expected: n });
            }
        }
        let mut report = Refinement { steps: 0, backward_error: backward_error(a, b, x) };
        while report.backward_error > f64::EPSILON && report.steps < 10 {
            let r: Vec<f64> = a.multiply(x).iter().zip(b).map(|(y, b)| b - y).collect();
            let correction = self.solve(&r)?;
            let better: Vec<f64> = x.iter().zip(&correction).map(|(x, d)| x + d).collect();
            let error = backward_error(a, b, &better);
            // Less than halved: the rest is rounding.
            if !(error < 0.5 * report.backward_error) {
                break;
            }
            x.copy_from_slice(&better);
            report = Refinement { steps: report.steps + 1, backward_error: error };
        }
        Ok(report)
    }
}

/// The componentwise backward error of `x` as a solution of `A x = b`; 0 for an exact one.
pub fn backward_error(a: &GeneralMatrix, b: &[f64], x: &[f64]) -> f64 {
    let (mut r, mut scale) = (b.to_vec(), b.iter().map(|b| b.abs()).collect::<Vec<_>>());
    for (i, j, v) in a.entries() {
        r[i] -= v * x[j];
        scale[i] += v.abs() * x[j].abs();
    }
    let ratio = |(r, s): (&f64, &f64)| if *r == 0.0 { 0.0 } else { r.abs() / s };
    r.iter().zip(&scale).map(ratio).fold(0.0, |a, b| if b.is_nan() { f64::INFINITY } else { f64::max(a, b) })
}
