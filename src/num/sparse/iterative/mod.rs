//! Solving without factoring, or with a factor of something near.
//!
//! Conjugate gradients for `A x = b`, `A` symmetric positive definite: each step multiplies once by `A` and once by the
//! preconditioner `M⁻¹ ≈ A⁻¹`. With none, and condition number κ, it takes about `½ √κ ln(2/ε)` steps.
//!
//! # Reference
//! M. R. Hestenes, E. Stiefel, *Methods of conjugate gradients for solving linear systems*, 1952; Y. Saad, *Iterative Methods
//! for Sparse Linear Systems*, 2nd ed. 2003, algorithm 9.1.

mod gauss_seidel;
mod incomplete_cholesky;

pub use gauss_seidel::GaussSeidel;
pub use incomplete_cholesky::IncompleteCholesky;

use super::{Cholesky, CompactFactor, Component, SparseError, SparseMatrix};
use crate::math::{dot, norm};
use crate::run::Run;

/// A symmetric matrix `A`, by what it does to a vector.
pub trait SymmetricOperator {
    /// Number of unknowns.
    fn n(&self) -> usize;

    /// `y = A x`; `x` and `y` have `n` entries.
    fn multiply(&self, x: &[f64], y: &mut [f64]);

    /// All unknowns that non-zero entries join to `unknown`.
    fn component_of(&self, unknown: usize) -> Component;
}

impl SymmetricOperator for SparseMatrix {
    fn n(&self) -> usize {
        self.n()
    }

    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        self.multiply(x, y);
    }

    fn component_of(&self, unknown: usize) -> Component {
        self.component_of(unknown)
    }
}

/// Something that approximates `A⁻¹`, symmetric and positive definite.
pub trait Preconditioner {
    /// `z = M⁻¹ r`.
    fn apply(&mut self, r: &[f64], z: &mut [f64]);
}

/// No preconditioner: `M = I`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plain;

impl Preconditioner for Plain {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
    }
}

/// The diagonal alone: `M = diag A`. Removes differing scales of the unknowns.
#[derive(Clone, Debug)]
pub struct Jacobi {
    inverse: Vec<f64>,
}

impl Jacobi {
    /// The diagonal of a matrix.
    ///
    /// # Errors
    /// [`SparseError::Pivot`] where it is not positive.
    pub fn new(a: &SparseMatrix) -> Result<Self, SparseError> {
        let inverse = (0..a.n()).map(|j| 1.0 / a.values()[a.pattern().column(j).start]).collect::<Vec<_>>();
        match inverse.iter().position(|&d| !(d > 0.0 && d.is_finite())) {
            Some(unknown) => Err(SparseError::Pivot { unknown }),
            None => Ok(Self { inverse }),
        }
    }
}

impl Preconditioner for Jacobi {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.iter_mut().zip(r).zip(&self.inverse).for_each(|((z, r), d)| *z = r * d);
    }
}

/// A factor of a similar matrix.
impl Preconditioner for CompactFactor {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
        self.solve(z);
    }
}

/// A factor of a similar matrix.
impl Preconditioner for Cholesky {
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        z.copy_from_slice(r);
        self.solve_in_place(z);
    }
}

/// When an iterative solution is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stop {
    /// Maximum number of iterations.
    pub max_iterations: usize,
    /// Done where `‖b − A x‖ ≤ tolerance · ‖b‖`; dimensionless, > 0.
    pub tolerance: f64,
}

impl Default for Stop {
    fn default() -> Self {
        Self { max_iterations: 10_000, tolerance: 1e-10 }
    }
}

/// How an iterative solution went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IterativeReport {
    /// Number of iterations.
    pub iterations: usize,
    /// `‖b − A x‖ / ‖b‖` at the end, computed from `x` itself.
    pub residual: f64,
    /// True where the tolerance was met.
    pub converged: bool,
}

/// Solves `A x = b` from the initial guess `x` by preconditioned conjugate gradients.
///
/// # Errors
/// [`SparseError::NotPositiveDefinite`] where a direction has no or negative curvature; `x` is then the last
/// approximation, as it is with [`SparseError::Interrupted`].
pub fn conjugate_gradients(
    a: &(impl SymmetricOperator + ?Sized),
    b: &[f64],
    x: &mut [f64],
    preconditioner: &mut (impl Preconditioner + ?Sized),
    stop: &Stop,
    run: &Run,
) -> Result<IterativeReport, SparseError> {
    let n = a.n();
    assert!(b.len() == n && x.len() == n, "vectors of a system of {n} unknowns");
    let (mut r, mut z, mut q) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    residual(a, x, b, &mut r);
    let target = stop.tolerance * norm(b);
    preconditioner.apply(&r, &mut z);
    let mut p = z.clone();
    let mut rz = dot(&r, &z);
    let mut iterations = 0;
    while norm(&r) > target && iterations < stop.max_iterations {
        run.check()?;
        a.multiply(&p, &mut q);
        let curvature = dot(&p, &q);
        if !(curvature > 0.0) {
            let worst = (0..n).max_by(|&i, &j| p[i].abs().total_cmp(&p[j].abs())).unwrap_or(0);
            return Err(SparseError::NotPositiveDefinite { component: a.component_of(worst) });
        }
        let alpha = rz / curvature;
        x.iter_mut().zip(&p).for_each(|(x, p)| *x += alpha * p);
        r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
        preconditioner.apply(&r, &mut z);
        let next = dot(&r, &z);
        let beta = next / rz;
        rz = next;
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + beta * *p);
        iterations += 1;
    }
    let converged = norm(&r) <= target;
    residual(a, x, b, &mut r);
    Ok(IterativeReport { iterations, residual: relative(&r, b), converged })
}

/// `r = b − A x`.
fn residual(a: &(impl SymmetricOperator + ?Sized), x: &[f64], b: &[f64], r: &mut [f64]) {
    a.multiply(x, r);
    r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
}

/// `‖r‖ / ‖b‖`, and `‖r‖` itself where `b` is zero.
fn relative(r: &[f64], b: &[f64]) -> f64 {
    let scale = norm(b);
    if scale > 0.0 { norm(r) / scale } else { norm(r) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::{Ordering, SparseBuilder};

    /// Laplacian of a `side²` grid, constrained at one corner; unknowns in units that differ by up to 10³.
    fn fixed_grid(side: usize) -> SparseMatrix {
        let n = side * side;
        let unit = |i: usize| 10f64.powi((i % 4) as i32);
        let mut a = SparseBuilder::new(n, n);
        a.add_entry(0, 0, 1.0);
        for i in 0..n {
            for j in [(i % side > 0).then(|| i - 1), (i >= side).then(|| i - side)].into_iter().flatten() {
                for (p, q, s) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
                    a.add_entry(p, q, s * unit(p) * unit(q));
                }
            }
        }
        a.build().expect("inside").symmetric().expect("symmetric")
    }

    fn steps(a: &SparseMatrix, preconditioner: &mut impl Preconditioner) -> usize {
        let b: Vec<f64> = (0..a.n()).map(|i| (i as f64).sin()).collect();
        let mut x = vec![0.0; a.n()];
        let stop = Stop { tolerance: 1e-9, ..Stop::default() };
        let report =
            conjugate_gradients(a, &b, &mut x, preconditioner, &stop, &Run::default()).expect("positive definite");
        assert!(report.converged && report.residual < 1e-7, "{report:?}");
        let mut r = vec![0.0; a.n()];
        a.residual(&x, &b, &mut r);
        assert!((relative(&r, &b) - report.residual).abs() < 1e-15);
        report.iterations
    }

    #[test]
    fn the_nearer_the_preconditioner_the_fewer_the_steps() {
        let a = fixed_grid(30);
        let mut cholesky = Cholesky::analyze(a.pattern(), &Ordering::Amd).expect("valid");
        cholesky.factor(&a, &Run::default()).expect("constrained");
        let plain = steps(&a, &mut Plain);
        let jacobi = steps(&a, &mut Jacobi::new(&a).expect("positive"));
        let incomplete = steps(&a, &mut IncompleteCholesky::new(&a).expect("positive"));
        let exact = steps(&a, &mut CompactFactor::new(&cholesky));
        assert!(2 * jacobi < plain && 2 * incomplete < jacobi && exact <= 2, "{plain} {jacobi} {incomplete} {exact}");
        assert!(steps(&a, &mut cholesky) <= 2);
    }

    #[test]
    fn an_indefinite_matrix_is_found_out_and_a_solution_is_left_alone() {
        let a = SparseMatrix::from_triplets(2, &[(0, 0, 1.0), (1, 1, -1.0)]).expect("in range");
        let error = conjugate_gradients(&a, &[0.0, 1.0], &mut [0.0; 2], &mut Plain, &Stop::default(), &Run::default());
        assert!(matches!(error, Err(SparseError::NotPositiveDefinite { component }) if component.unknowns == [1]));
        assert!(matches!(Jacobi::new(&a), Err(SparseError::Pivot { unknown: 1 })));
        let mut x = [3.0, 0.0];
        let report = conjugate_gradients(&a, &[3.0, 0.0], &mut x, &mut Plain, &Stop::default(), &Run::default())
            .expect("solved");
        assert_eq!((report.iterations, report.residual, x), (0, 0.0, [3.0, 0.0]));
    }

    #[test]
    fn reaching_the_iteration_limit_is_reported() {
        let a = fixed_grid(10);
        let stop = Stop { max_iterations: 3, tolerance: 1e-12 };
        let report = conjugate_gradients(&a, &[1.0; 100], &mut [0.0; 100], &mut Plain, &stop, &Run::default())
            .expect("definite");
        assert!(!report.converged && report.iterations == 3 && report.residual > 1e-3);
    }
}
