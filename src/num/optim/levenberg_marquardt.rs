//! Damped least squares: the loop of Levenberg and Marquardt with Nielsen's damping.
//!
//! ```text
//! minimize E(x) = ½ Σ ρ(‖r(x)‖²),      (H + λ D) δ = −g,      H ≈ JᵀJ,  g = ∇E,  D = diag H
//! ϱ = (E(x) − E(x + δ)) / (½ δᵀ(λ D δ − g))
//! ```
//!
//! A step is taken where the gain ratio `ϱ` is positive; `λ` then falls by up to a third, the more the better the quadratic
//! model predicted the gain, and rises ever faster while steps fail. What `x` is, and how the damped system is solved, is the
//! problem's own business.
//!
//! # Reference
//! K. Madsen, H. B. Nielsen, O. Tingleff, *Methods for Non-Linear Least Squares Problems*, 2nd ed. 2004, §3.2.

use crate::run::{Run, Stopped};

/// A least-squares problem at its present point.
pub trait DampedProblem {
    /// Builds `H` and `g` at the present point.
    fn linearize(&mut self);

    /// Solves for the step under damping `λ` and prepares the trial point; returns what the quadratic model expects to gain.
    /// `None` where the system cannot be solved: more damping will be tried.
    fn propose(&mut self, lambda: f64) -> Option<f64>;

    /// `E` at the trial point.
    fn trial_cost(&mut self) -> f64;

    /// Makes the trial point the present one.
    fn accept(&mut self);
}

/// When to stop, and the initial damping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampingOptions {
    /// First `λ`, relative to the diagonal of `H`, > 0.
    pub lambda: f64,
    /// Done when an accepted step lowers `E + floor` by less than this fraction, and the model had predicted no more; ≥ 0.
    pub tolerance: f64,
    /// `E` that counts as zero, ≥ 0.
    pub floor: f64,
    /// Maximum number of steps tried, the failed ones included.
    pub max_iterations: usize,
}

impl Default for DampingOptions {
    fn default() -> Self {
        Self { lambda: 1e-4, tolerance: 1e-6, floor: 0.0, max_iterations: 50 }
    }
}

/// How a minimization went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DampingReport {
    /// Steps tried, the failed ones included.
    pub iterations: usize,
    /// `E` of the initial guess.
    pub initial_cost: f64,
    /// `E` at the end.
    pub cost: f64,
    /// The last step gained less than the tolerance.
    pub converged: bool,
}

/// Largest damping tried: beyond it the step changes no digit of `x` in double precision, whatever the scale, since damping is relative to
/// the diagonal of `H`.
const MAX_DAMPING: f64 = 1e16;
/// Smallest damping: four digits above rounding, so that singular directions stay damped; smaller changes no step that is determined.
const MIN_DAMPING: f64 = 1e-12;

/// Minimizes from the problem's present point, where `E` is `cost`.
///
/// # Errors
/// [`Stopped`]; the problem is then at the last point accepted.
pub fn minimize(
    problem: &mut impl DampedProblem,
    cost: f64,
    options: &DampingOptions,
    run: &Run,
) -> Result<DampingReport, Stopped> {
    let mut report = DampingReport { iterations: 0, initial_cost: cost, cost, converged: false };
    let (mut lambda, mut growth) = (options.lambda, 2.0);
    let mut stale = true;
    while report.iterations < options.max_iterations && !report.converged && lambda < MAX_DAMPING {
        run.check()?;
        if std::mem::take(&mut stale) {
            problem.linearize();
        }
        // The step under the present damping; more damping where there is none.
        report.iterations += 1;
        let predicted = problem.propose(lambda).filter(|gain| gain.is_finite());
        let small = options.tolerance * (report.cost + options.floor);
        let Some(predicted) = predicted else {
            (lambda, growth) = (lambda * growth, growth * 2.0);
            continue;
        };
        // Nielsen: damping follows the ratio of gained to predicted decrease.
        let trial = problem.trial_cost();
        let gain = report.cost - trial;
        if gain > 0.0 {
            problem.accept();
            stale = true;
            report.cost = trial;
            report.converged = gain <= small && predicted <= small;
            let model_error = 2.0 * gain / predicted - 1.0;
            lambda = (lambda * (1.0 - model_error.powi(3)).max(1.0 / 3.0)).max(MIN_DAMPING);
            growth = 2.0;
        } else {
            // A predicted gain below rounding that does not come is no failure.
            report.converged = predicted <= small.max(report.cost * f64::EPSILON);
            (lambda, growth) = (lambda * growth, growth * 2.0);
        }
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    /// Rosenbrock's valley as residuals `(10 (y − x²), 1 − x)`.
    struct Valley {
        at: Vector2<f64>,
        trial: Vector2<f64>,
        j: Matrix2<f64>,
        r: Vector2<f64>,
    }

    impl Valley {
        fn residual(at: &Vector2<f64>) -> Vector2<f64> {
            Vector2::new(10.0 * (at.y - at.x * at.x), 1.0 - at.x)
        }
    }

    impl DampedProblem for Valley {
        fn linearize(&mut self) {
            self.r = Self::residual(&self.at);
            self.j = Matrix2::new(-20.0 * self.at.x, 10.0, -1.0, 0.0);
        }

        fn propose(&mut self, lambda: f64) -> Option<f64> {
            let (h, g) = (self.j.transpose() * self.j, self.j.transpose() * self.r);
            let d = Matrix2::from_diagonal(&(lambda * h.diagonal()));
            let step = -(h + d).try_inverse()? * g;
            self.trial = self.at + step;
            Some(0.5 * step.dot(&(d * step - g)))
        }

        fn trial_cost(&mut self) -> f64 {
            0.5 * Self::residual(&self.trial).norm_squared()
        }

        fn accept(&mut self) {
            self.at = self.trial;
        }
    }

    fn valley() -> (Valley, f64) {
        let mut valley =
            Valley { at: Vector2::new(-1.2, 1.0), trial: Vector2::zeros(), j: Matrix2::zeros(), r: Vector2::zeros() };
        valley.linearize();
        let cost = 0.5 * valley.r.norm_squared();
        (valley, cost)
    }

    #[test]
    fn the_valley_is_followed_to_its_end() {
        let (mut valley, cost) = valley();
        let report = minimize(
            &mut valley,
            cost,
            &DampingOptions { tolerance: 1e-12, ..DampingOptions::default() },
            &Run::default(),
        )
        .expect("a run that never stops");
        assert!((valley.at - Vector2::new(1.0, 1.0)).norm() < 1e-8, "{:?}", valley.at);
        assert!(report.converged && report.cost < 1e-16 && report.initial_cost == cost && report.iterations < 40);
    }

    #[test]
    fn a_minimum_is_recognized_and_the_iteration_limit_holds() {
        let (mut valley, cost) = valley();
        let options = DampingOptions { max_iterations: 1, ..DampingOptions::default() };
        let report = minimize(&mut valley, cost, &options, &Run::default()).expect("a run that never stops");
        assert!(!report.converged && report.iterations == 1 && report.cost <= cost);
        (valley.at, valley.trial) = (Vector2::new(1.0, 1.0), Vector2::zeros());
        let report =
            minimize(&mut valley, 0.0, &DampingOptions::default(), &Run::default()).expect("a run that never stops");
        assert!(report.converged && report.iterations == 1 && valley.at == Vector2::new(1.0, 1.0));
    }

    #[test]
    fn a_system_that_cannot_be_solved_ends_the_search_where_it_stands() {
        struct Unsolvable;
        impl DampedProblem for Unsolvable {
            fn linearize(&mut self) {}
            fn propose(&mut self, _: f64) -> Option<f64> {
                None
            }
            fn trial_cost(&mut self) -> f64 {
                unreachable!("nothing is proposed")
            }
            fn accept(&mut self) {
                unreachable!("nothing is proposed")
            }
        }
        let report = minimize(
            &mut Unsolvable,
            5.0,
            &DampingOptions { max_iterations: 200, ..DampingOptions::default() },
            &Run::default(),
        )
        .expect("a run that never stops");
        assert!(!report.converged && report.cost == 5.0 && report.iterations < 20);
    }
}
