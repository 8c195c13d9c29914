//! Convex quadratic programs: a sum of squares under linear equalities and inequalities.
//!
//! ```text
//! min  Σᵢ wᵢ eᵢ(x)² + c·x     s.t.  gⱼ(x) = 0,  hₖ(x) ≤ 0,      e, g, h affine in x
//! ```
//!
//! The program is written expression by expression ([`Affine`]) and solved by the interior-point method of Clarabel;
//! this is the only file that names that crate. The solution is within `1e-6` (relative) of every constraint, not
//! exactly inside: callers that need exactness move the last hair themselves. Where rounding stops the iteration early, a
//! point that meets the constraints to `1e-4` and the minimum to a thousandth is taken for solved.
//!
//! # Reference
//! P. Goulart, Y. Chen, *Clarabel: An interior-point solver for conic programs with quadratic objectives*, 2024.

use std::ops::{Add, Mul, Sub};

use crate::run::{Run, Stopped};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, NonnegativeConeT, SolverStatus, ZeroConeT};

/// Largest residual of constraints and of stationarity, and what a second attempt accepts. The solver also takes a
/// hundred times as much for divergence and gives up: at `1e-8` it does so for rounding alone on chains of some hundred
/// differences.
const FEASIBILITY: [f64; 2] = [1e-6, 1e-4];

/// Gap between the objective and its lower bound, as a fraction of it (or absolute, where it is below 1), at which an iteration
/// that rounding has stopped counts as done. With no constraint active, long chains of differences stop near `1e-4`.
const EARLY_GAP: f64 = 1e-3;

/// `Σⱼ cⱼ x_{iⱼ} + k`: an affine function of the unknowns; a variable may occur more than once.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Affine {
    terms: Vec<(usize, f64)>,
    constant: f64,
}

impl Affine {
    /// The unknown with this index.
    pub fn var(index: usize) -> Self {
        Self { terms: vec![(index, 1.0)], constant: 0.0 }
    }

    /// The same value everywhere.
    pub fn constant(value: f64) -> Self {
        Self { terms: Vec::new(), constant: value }
    }

    /// Value at `x`.
    pub fn at(&self, x: &[f64]) -> f64 {
        self.constant + self.terms.iter().map(|&(i, c)| c * x[i]).sum::<f64>()
    }

    /// Adds up the coefficients of equal variables; sorted by variable.
    fn merged(mut self) -> Self {
        self.terms.sort_unstable_by_key(|&(i, _)| i);
        self.terms.dedup_by(|from, into| {
            let same = from.0 == into.0;
            if same {
                into.1 += from.1;
            }
            same
        });
        self
    }
}

impl Add for Affine {
    type Output = Self;
    fn add(mut self, other: Self) -> Self {
        self.terms.extend(other.terms);
        self.constant += other.constant;
        self
    }
}

impl Mul<Affine> for f64 {
    type Output = Affine;
    fn mul(self, mut e: Affine) -> Affine {
        e.terms.iter_mut().for_each(|(_, c)| *c *= self);
        e.constant *= self;
        e
    }
}

impl Sub for Affine {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + (-1.0) * other
    }
}

/// Rows of a matrix as triplets, with their right-hand sides.
#[derive(Debug, Default)]
struct Rows {
    row: Vec<usize>,
    col: Vec<usize>,
    value: Vec<f64>,
    rhs: Vec<f64>,
}

impl Rows {
    /// `e ≤ 0` or `e = 0` as `terms · x ≤ −k`.
    fn push(&mut self, e: Affine, first_row: usize) {
        let r = first_row + self.rhs.len();
        for (i, c) in e.terms {
            self.row.push(r);
            self.col.push(i);
            self.value.push(c);
        }
        self.rhs.push(-e.constant);
    }
}

/// What stopped the solver from delivering a minimiser.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum QpError {
    /// The constraints contradict each other.
    #[error("no point satisfies all {constraints} constraints of the quadratic program")]
    Infeasible {
        /// Number of scalar constraints.
        constraints: usize,
    },
    /// The objective falls without end in some direction.
    #[error("the quadratic program has no minimum: its objective falls without end")]
    Unbounded,
    /// The iteration ended without reaching its tolerance.
    #[error("the quadratic program was not solved ({status}) after {iterations} iterations")]
    Stalled {
        /// The solver's own word for it.
        status: String,
        /// Interior-point iterations done.
        iterations: u32,
    },
    /// The solver refused the data.
    #[error("the quadratic program is malformed: {reason}")]
    Malformed {
        /// The solver's own word for it.
        reason: String,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

/// A quadratic program under construction.
#[derive(Debug)]
pub struct QuadraticProgram {
    hessian: Rows,
    linear: Vec<f64>,
    equal: Rows,
    at_most: Vec<Affine>,
}

impl QuadraticProgram {
    /// A program over `variables` unknowns, objective zero, no constraints.
    pub fn new(variables: usize) -> Self {
        Self { hessian: Rows::default(), linear: vec![0.0; variables], equal: Rows::default(), at_most: Vec::new() }
    }

    /// Adds `weight · e²` to the objective, `weight ≥ 0`.
    pub fn add_square(&mut self, weight: f64, e: Affine) {
        let e = e.merged();
        for (p, &(i, ci)) in e.terms.iter().enumerate() {
            self.linear[i] += 2.0 * weight * e.constant * ci;
            for &(j, cj) in &e.terms[p..] {
                self.hessian.row.push(i);
                self.hessian.col.push(j);
                self.hessian.value.push(2.0 * weight * ci * cj);
            }
        }
    }

    /// Adds the linear function `e` (its constant does not matter) to the objective.
    pub fn add_linear(&mut self, e: &Affine) {
        for &(i, c) in &e.terms {
            self.linear[i] += c;
        }
    }

    /// Demands `e = 0`.
    pub fn require_zero(&mut self, e: Affine) {
        self.equal.push(e.merged(), 0);
    }

    /// Demands `e ≤ 0`.
    pub fn require_at_most_zero(&mut self, e: Affine) {
        self.at_most.push(e.merged());
    }

    /// The minimiser.
    ///
    /// # Errors
    /// [`QpError::Infeasible`] and [`QpError::Unbounded`] where there is none, [`QpError::Stalled`] where the iteration
    /// gives up, [`QpError::Malformed`] for data that the solver refuses, [`QpError::Interrupted`].
    pub fn solve(self, run: &Run) -> Result<Vec<f64>, QpError> {
        let n = self.linear.len();
        let hessian = CscMatrix::new_from_triplets(n, n, self.hessian.row, self.hessian.col, self.hessian.value);
        let mut rows = self.equal;
        let cones = [ZeroConeT(rows.rhs.len()), NonnegativeConeT(self.at_most.len())];
        for e in self.at_most {
            rows.push(e, 0);
        }
        let m = rows.rhs.len();
        let constraints = CscMatrix::new_from_triplets(m, n, rows.row, rows.col, rows.value);
        let attempt = |feasibility: f64| {
            run.check()?;
            let settings = DefaultSettingsBuilder::default()
                .verbose(false)
                .tol_feas(feasibility)
                .reduced_tol_gap_abs(EARLY_GAP)
                .reduced_tol_gap_rel(EARLY_GAP)
                .build()
                .map_err(|e| QpError::Malformed { reason: e.to_string() })?;
            let mut solver = DefaultSolver::new(&hessian, &self.linear, &constraints, &rows.rhs, &cones, settings)
                .map_err(|e| QpError::Malformed { reason: e.to_string() })?;
            let watched = run.silent();
            solver.set_termination_callback(move |_| watched.check().is_err());
            solver.solve();
            // The solver asks once per iteration; a minimizer that is found is not thrown away.
            if solver.solution.status == SolverStatus::CallbackTerminated {
                run.check()?;
            }
            let done = solver.solution;
            match done.status {
                SolverStatus::Solved | SolverStatus::AlmostSolved => Ok(done.x),
                SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => {
                    Err(QpError::Infeasible { constraints: m })
                }
                SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => Err(QpError::Unbounded),
                status => Err(QpError::Stalled { status: format!("{status:?}"), iterations: done.iterations }),
            }
        };
        let [strict, loose] = FEASIBILITY;
        match attempt(strict) {
            Err(QpError::Stalled { .. }) => attempt(loose),
            done => done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn x(i: usize) -> Affine {
        Affine::var(i)
    }

    fn k(v: f64) -> Affine {
        Affine::constant(v)
    }

    #[test]
    fn the_free_minimum_of_a_sum_of_squares_is_the_least_squares_solution() {
        let mut qp = QuadraticProgram::new(2);
        qp.add_square(1.0, x(0) + x(1) - k(3.0));
        qp.add_square(4.0, x(0) - x(1) - k(1.0));
        qp.require_at_most_zero(x(0) - k(100.0));
        let s = qp.solve(&Run::default()).expect("convex and bounded");
        assert!((s[0] - 2.0).abs() < 1e-6 && (s[1] - 1.0).abs() < 1e-6, "{s:?}");
    }

    #[test]
    fn weights_trade_contradicting_squares_against_each_other() {
        let mut qp = QuadraticProgram::new(1);
        qp.add_square(1.0, x(0));
        qp.add_square(3.0, x(0) - k(4.0));
        qp.require_at_most_zero(x(0) - k(100.0));
        let s = qp.solve(&Run::default()).expect("convex and bounded");
        assert!((s[0] - 3.0).abs() < 1e-6, "{s:?}");
    }

    #[test]
    fn constraints_hold_at_the_minimum() {
        let mut qp = QuadraticProgram::new(2);
        qp.add_square(1.0, x(0) - k(5.0));
        qp.add_square(1.0, x(1));
        qp.require_zero(x(0) - x(1));
        qp.require_at_most_zero(x(0) - k(2.0));
        let s = qp.solve(&Run::default()).expect("feasible");
        assert!((s[0] - 2.0).abs() < 1e-6 && (s[1] - 2.0).abs() < 1e-6, "{s:?}");
    }

    #[test]
    fn a_repeated_variable_counts_as_its_sum() {
        let mut qp = QuadraticProgram::new(1);
        qp.add_square(1.0, x(0) + x(0) - k(6.0));
        qp.require_at_most_zero(k(-100.0) - x(0));
        assert!((qp.solve(&Run::default()).expect("bounded")[0] - 3.0).abs() < 1e-6);
    }

    #[test]
    fn a_linear_reward_pushes_to_its_bound() {
        let mut qp = QuadraticProgram::new(1);
        qp.add_linear(&(-2.0 * x(0)));
        qp.require_at_most_zero(x(0) - k(7.0));
        assert!((qp.solve(&Run::default()).expect("bounded")[0] - 7.0).abs() < 1e-6);
    }

    #[test]
    fn contradictions_and_missing_bounds_are_told_apart() {
        let mut qp = QuadraticProgram::new(1);
        qp.require_at_most_zero(x(0) + k(1.0));
        qp.require_at_most_zero(k(1.0) - x(0));
        let e = qp.solve(&Run::default()).expect_err("x ≤ −1 and x ≥ 1");
        assert_eq!(e.to_string(), "no point satisfies all 2 constraints of the quadratic program");
        let mut qp = QuadraticProgram::new(1);
        qp.add_linear(&x(0));
        qp.require_at_most_zero(x(0));
        assert!(matches!(qp.solve(&Run::default()), Err(QpError::Unbounded)));
    }
}
