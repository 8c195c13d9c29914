//! Gauss–Seidel relaxation: each unknown in order takes the value that satisfies its own equation.
//!
//! ```text
//! xᵢ ← (bᵢ − Σ_{j≠i} aᵢⱼ xⱼ) / aᵢᵢ
//! ```
//!
//! Converges for every symmetric positive definite matrix; quickly only where errors are local, hence as a smoother, and for
//! a few sweeps after a small change. A symmetric sweep (forwards, then backwards) is also a preconditioner.

use super::{IterativeReport, Preconditioner, Stop, relative};
use crate::math::norm;
use crate::run::{Run, Stopped};
use crate::sparse::{GeneralMatrix, SparseError, SparseMatrix};

/// A symmetric matrix by rows, ready for relaxation.
///
/// ```
/// use plumbline_num::run::Run;
/// use plumbline_num::sparse::{GaussSeidel, SparseMatrix, Stop};
///
/// let a = SparseMatrix::from_triplets(2, &[(0, 0, 4.0), (1, 1, 3.0), (1, 0, 1.0)])?;
/// let mut x = [0.0; 2];
/// let report = GaussSeidel::new(&a)?.solve(&[6.0, 7.0], &mut x, &Stop::default(), &Run::default())?;
/// assert!(report.converged && (x[0] - 1.0).abs() < 1e-9 && (x[1] - 2.0).abs() < 1e-9);
/// # Ok::<(), plumbline_num::sparse::SparseError>(())
/// ```
#[derive(Clone, Debug)]
pub struct GaussSeidel {
    rows: GeneralMatrix,
    inverse_diagonal: Vec<f64>,
}

impl GaussSeidel {
    /// Takes the matrix.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where its diagonal is not positive.
    pub fn new(a: &SparseMatrix) -> Result<Self, SparseError> {
        let inverse_diagonal = super::Jacobi::new(a)?.inverse;
        Ok(Self { rows: GeneralMatrix::from(a), inverse_diagonal })
    }

    /// One pass over all unknowns in ascending order, or descending.
    pub fn sweep(&self, b: &[f64], x: &mut [f64], backwards: bool) {
        let n = self.inverse_diagonal.len();
        assert!(b.len() == n && x.len() == n, "vectors of a system of {n} unknowns");
        for k in 0..n {
            let i = if backwards { n - 1 - k } else { k };
            let residual = b[i] - self.rows.column(i).map(|(j, a)| a * x[j]).sum::<f64>();
            x[i] += residual * self.inverse_diagonal[i];
        }
    }

    /// Forward sweeps from `x` until the residual is small enough.
    ///
    /// # Errors
    /// [`Stopped`], and `x` is the last approximation.
    pub fn solve(&self, b: &[f64], x: &mut [f64], stop: &Stop, run: &Run) -> Result<IterativeReport, Stopped> {
        let residual = |x: &[f64]| self.rows.multiply(x).iter().zip(b).map(|(y, b)| b - y).collect::<Vec<_>>();
        let target = stop.tolerance * norm(b);
        let mut iterations = 0;
        let mut r = residual(x);
        while norm(&r) > target && iterations < stop.max_iterations {
            run.check()?;
            self.sweep(b, x, false);
            r = residual(x);
            iterations += 1;
        }
        Ok(IterativeReport { iterations, residual: relative(&r, b), converged: norm(&r) <= target })
    }
}

/// A symmetric sweep from zero.
impl Preconditioner for GaussSeidel {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.fill(0.0);
        self.sweep(r, z, false);
        self.sweep(r, z, true);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Plain, conjugate_gradients};
    use super::*;

    fn chain(n: usize) -> SparseMatrix {
        let mut triplets = vec![(0, 0, 1.0)];
        (1..n).for_each(|i| triplets.extend([(i, i, 1.0), (i - 1, i - 1, 1.0), (i, i - 1, -1.0)]));
        SparseMatrix::from_triplets(n, &triplets).expect("in range")
    }

    #[test]
    fn sweeps_converge_to_the_solution() {
        let gauss_seidel = GaussSeidel::new(&chain(6)).expect("positive");
        let mut x = vec![0.0; 6];
        let b = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let report = gauss_seidel
            .solve(&b, &mut x, &Stop { tolerance: 1e-12, max_iterations: 2000 }, &Run::default())
            .expect("a run that never stops");
        assert!(report.converged && x.iter().all(|x| (x - 1.0).abs() < 1e-10), "{report:?} {x:?}");
    }

    #[test]
    fn a_sweep_lowers_the_energy_and_leaves_the_solution_alone() {
        let a = chain(9);
        let gauss_seidel = GaussSeidel::new(&a).expect("positive");
        let energy = |x: &[f64]| {
            let mut y = vec![0.0; 9];
            a.multiply(x, &mut y);
            x.iter().zip(&y).map(|(x, y)| x * y).sum::<f64>() / 2.0 - x[0]
        };
        let mut x: Vec<f64> = (0..9).map(|i| f64::from(i * i % 7)).collect();
        let b = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        for backwards in [false, true] {
            let before = energy(&x);
            gauss_seidel.sweep(&b, &mut x, backwards);
            assert!(energy(&x) < before);
        }
        let mut solution = vec![1.0; 9];
        gauss_seidel.sweep(&b, &mut solution, false);
        assert_eq!(solution, [1.0; 9]);
    }

    #[test]
    fn a_symmetric_sweep_speeds_conjugate_gradients_up() {
        let a = chain(200);
        let b: Vec<f64> = (0..200).map(|i| f64::from(i).sin()).collect();
        let run = |mut p: Box<dyn Preconditioner>| {
            let stop = Stop { tolerance: 1e-8, max_iterations: 1000 };
            conjugate_gradients(&a, &b, &mut vec![0.0; 200], &mut *p, &stop, &Run::default())
                .expect("definite")
                .iterations
        };
        let (plain, swept) = (run(Box::new(Plain)), run(Box::new(GaussSeidel::new(&a).expect("positive"))));
        assert!(10 * swept < 7 * plain, "{plain} {swept}");
    }
}
