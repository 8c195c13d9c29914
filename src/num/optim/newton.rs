//! Newton's and Gauss–Newton's method with a line search.
//!
//! ```text
//! solve H p = −g,    α = 1, ½, ¼ … until E(x + α p) ≤ E(x) + c α gᵀp,    x ← x + α p
//! ```
//!
//! `H` is the Hessian (Newton) or `JᵀJ` (Gauss–Newton: `E = ½‖r‖²`, `g = Jᵀ r`). Near a minimum with positive definite Hessian
//! Newton doubles the right digits with each step; Gauss–Newton does so where residuals vanish. Where `H` is not positive
//! definite the system is refused or `p` does not descend: the problem is then asked for a more convex `H`, by a shift `μ`
//! that grows until it is and shrinks as steps succeed.
//!
//! # Reference
//! J. Nocedal, S. J. Wright, *Numerical Optimization*, 2nd ed. 2006, sections 3.1 (Armijo), 3.4 and 10.3.

use crate::run::{Run, Stopped};

/// A smooth energy at its present point.
pub trait DescentProblem {
    /// `E` at the present point.
    fn energy(&mut self) -> f64;

    /// Solves `(H + μ D) p = −g` at the present point, `D` positive (the identity, or the diagonal of `H`), and keeps `p`.
    /// Returns `gᵀp`; `None` where the matrix is not positive definite.
    fn direction(&mut self, shift: f64) -> Option<f64>;

    /// `E` at `x + α p`.
    fn energy_along(&mut self, alpha: f64) -> f64;

    /// Moves to `x + α p`.
    fn step(&mut self, alpha: f64);
}

/// When to stop, and what counts as descent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescentOptions {
    /// Maximum number of steps.
    pub max_iterations: usize,
    /// Converged where the model promises to lower `E` by no more than this fraction of `|E| + floor`: `−½ gᵀp`; > 0.
    pub tolerance: f64,
    /// Energy that counts as zero, ≥ 0.
    pub floor: f64,
}

impl Default for DescentOptions {
    fn default() -> Self {
        Self { max_iterations: 100, tolerance: 1e-12, floor: 0.0 }
    }
}

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescentEnd {
    /// The model promises no more.
    Converged,
    /// No step along the direction lowers the energy any more: rounding, or a kink.
    NoDescent,
    /// No shift makes the system solvable, or the energy is not a number.
    NoDirection,
    /// The steps ran out.
    IterationLimit,
}

/// How a descent went.
#[derive(Clone, Debug, PartialEq)]
pub struct DescentReport {
    /// Energy of the initial guess and after each step; never rises.
    pub energies: Vec<f64>,
    /// Why it ended.
    pub end: DescentEnd,
}

impl DescentReport {
    /// Steps taken.
    pub fn iterations(&self) -> usize {
        self.energies.len() - 1
    }

    /// Ended at a minimum, within the tolerance.
    pub fn converged(&self) -> bool {
        self.end == DescentEnd::Converged
    }
}

/// Fraction of the predicted decrease that a step must reach (Armijo). Nearly any decrease will do: demanding more costs trials,
/// less admits steps that gain nothing. The usual value (Nocedal & Wright, section 3.1).
const ARMIJO: f64 = 1e-4;
/// First shift tried where `H` itself is refused, relative to `D`: nine more shifts, each eight times the last, reach 10⁴; a smaller
/// first one only adds factorizations that fail.
const FIRST_SHIFT: f64 = 1e-4;
/// Largest shift tried: beside it `H` is rounding in all but four digits, so that a refusal means that numbers are not finite.
const MAX_SHIFT: f64 = 1e12;
/// Maximum number of halvings of a step: 2⁻⁴⁰ of it is near the rounding of `x`.
const MAX_HALVINGS: u32 = 40;

/// Descends from the problem's present point.
///
/// ```
/// use plumbline_num::optim::newton::{DescentOptions, DescentProblem, descend};
/// use plumbline_num::run::Run;
///
/// // E(x) = x⁴/4 − x, whose minimum is at 1.
/// struct Quartic { x: f64, step: f64 }
/// impl DescentProblem for Quartic {
///     fn energy(&mut self) -> f64 { self.energy_along(0.0) }
///     fn direction(&mut self, shift: f64) -> Option<f64> {
///         let (gradient, hessian) = (self.x.powi(3) - 1.0, 3.0 * self.x.powi(2) + shift);
///         self.step = -gradient / hessian;
///         (hessian > 0.0).then_some(gradient * self.step)
///     }
///     fn energy_along(&mut self, alpha: f64) -> f64 {
///         let x = self.x + alpha * self.step;
///         x.powi(4) / 4.0 - x
///     }
///     fn step(&mut self, alpha: f64) { self.x += alpha * self.step }
/// }
/// let mut problem = Quartic { x: 3.0, step: 0.0 };
/// let report = descend(&mut problem, &DescentOptions::default(), &Run::default())?;
/// assert!(report.converged() && (problem.x - 1.0).abs() < 1e-6);
/// # Ok::<(), plumbline_num::run::Stopped>(())
/// ```
///
/// # Errors
/// [`Stopped`]; the problem is then at the last point reached.
pub fn descend(
    problem: &mut impl DescentProblem,
    options: &DescentOptions,
    run: &Run,
) -> Result<DescentReport, Stopped> {
    let mut energies = vec![problem.energy()];
    let mut shift: f64 = 0.0;
    let end = loop {
        run.check()?;
        let energy = energies[energies.len() - 1];
        if energies.len() > options.max_iterations {
            break DescentEnd::IterationLimit;
        }
        let Some(slope) = find_direction(problem, &mut shift).filter(|_| energy.is_finite()) else {
            break DescentEnd::NoDirection;
        };
        let small = options.tolerance * (energy.abs() + options.floor);
        if -0.5 * slope <= small {
            break DescentEnd::Converged;
        }
        let Some((alpha, lower)) = search(problem, energy, slope) else {
            // A predicted decrease below the rounding of `E` cannot be measured.
            let below_rounding = -slope <= 1e3 * f64::EPSILON * energy.abs();
            break if below_rounding { DescentEnd::Converged } else { DescentEnd::NoDescent };
        };
        problem.step(alpha);
        energies.push(lower);
        // A full step confirms the model: less shift next time.
        if alpha == 1.0 {
            shift = if shift > FIRST_SHIFT { shift / 8.0 } else { 0.0 };
        }
    };
    Ok(DescentReport { energies, end })
}

/// The direction under the least shift, from the present one upwards, that descends.
fn find_direction(problem: &mut impl DescentProblem, shift: &mut f64) -> Option<f64> {
    while *shift <= MAX_SHIFT {
        if let Some(slope) = problem.direction(*shift).filter(|slope| *slope <= 0.0) {
            return Some(slope);
        }
        *shift = (8.0 * *shift).max(FIRST_SHIFT);
    }
    None
}

/// The first of the steps 1, ½, ¼ … that lowers the energy enough, and the energy there.
fn search(problem: &mut impl DescentProblem, energy: f64, slope: f64) -> Option<(f64, f64)> {
    (0..MAX_HALVINGS).map(|k| 0.5_f64.powi(k as i32)).find_map(|alpha| {
        let there = problem.energy_along(alpha);
        (there <= energy + ARMIJO * alpha * slope && there < energy).then_some((alpha, there))
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    /// A function of the plane with its gradient and Hessian.
    struct Plane<F> {
        at: Vector2<f64>,
        direction: Vector2<f64>,
        f: F,
    }

    impl<F: Fn(Vector2<f64>) -> (f64, Vector2<f64>, Matrix2<f64>)> DescentProblem for Plane<F> {
        fn energy(&mut self) -> f64 {
            (self.f)(self.at).0
        }

        fn direction(&mut self, shift: f64) -> Option<f64> {
            let (_, g, h) = (self.f)(self.at);
            let factor = (h + Matrix2::identity() * shift).cholesky()?;
            self.direction = -factor.solve(&g);
            Some(self.direction.dot(&g))
        }

        fn energy_along(&mut self, alpha: f64) -> f64 {
            (self.f)(self.at + alpha * self.direction).0
        }

        fn step(&mut self, alpha: f64) {
            self.at += alpha * self.direction;
        }
    }

    fn from<F>(x: f64, y: f64, f: F) -> Plane<F> {
        Plane { at: Vector2::new(x, y), direction: Vector2::zeros(), f }
    }

    /// Rosenbrock's valley.
    fn valley(p: Vector2<f64>) -> (f64, Vector2<f64>, Matrix2<f64>) {
        let (a, b) = (p.y - p.x * p.x, 1.0 - p.x);
        let g = Vector2::new(-200.0 * a * p.x - b, 100.0 * a);
        let h = Matrix2::new(-200.0 * a + 400.0 * p.x * p.x + 1.0, -200.0 * p.x, -200.0 * p.x, 100.0);
        (50.0 * a * a + 0.5 * b * b, g, h)
    }

    /// The same with the Hessian of Gauss and Newton.
    fn valley_by_residuals(p: Vector2<f64>) -> (f64, Vector2<f64>, Matrix2<f64>) {
        let (e, g, _) = valley(p);
        let j = Matrix2::new(-20.0 * p.x, 10.0, -1.0, 0.0);
        (e, g, j.transpose() * j)
    }

    #[test]
    fn both_follow_the_valley_to_its_end_and_never_climb() {
        let mut newton = from(-1.2, 1.0, valley);
        let mut gauss = from(-1.2, 1.0, valley_by_residuals);
        let options = DescentOptions { tolerance: 1e-14, floor: 1e-6, ..DescentOptions::default() };
        let reports = [
            descend(&mut newton, &options, &Run::default()).expect("a run that never stops"),
            descend(&mut gauss, &options, &Run::default()).expect("a run that never stops"),
        ];
        for (report, at) in reports.iter().zip([newton.at, gauss.at]) {
            assert!(report.converged() && (at - Vector2::new(1.0, 1.0)).norm() < 1e-8, "{report:?} {at:?}");
            assert!(report.energies.is_sorted_by(|a, b| a > b) && report.iterations() < 40);
        }
    }

    #[test]
    fn newton_doubles_the_digits_near_the_minimum() {
        let mut problem = from(1.05, 1.1, valley);
        let options = DescentOptions { tolerance: 1e-300, ..DescentOptions::default() };
        let energies = descend(&mut problem, &options, &Run::default()).expect("a run that never stops").energies;
        let last = &energies[energies.len() - 3..];
        assert!(last[1] < last[0].powf(1.5), "{energies:?}");
    }

    #[test]
    fn a_saddle_is_left_by_shifting() {
        // cos x + y²/2 at its maximum in x: no Newton direction descends there but by a shift.
        let wave = |p: Vector2<f64>| {
            let g = Vector2::new(-p.x.sin(), p.y);
            (p.x.cos() + 0.5 * p.y * p.y, g, Matrix2::new(-p.x.cos(), 0.0, 0.0, 1.0))
        };
        let mut problem = from(0.1, 1.0, wave);
        let report =
            descend(&mut problem, &DescentOptions::default(), &Run::default()).expect("a run that never stops");
        assert!(report.converged() && (problem.at.x.abs() - std::f64::consts::PI).abs() < 1e-6, "{:?}", problem.at);
    }

    #[test]
    fn an_energy_without_a_minimum_is_reported() {
        let nan = |_: Vector2<f64>| (f64::NAN, Vector2::zeros(), Matrix2::identity());
        assert_eq!(
            descend(&mut from(0.0, 0.0, nan), &DescentOptions::default(), &Run::default())
                .expect("a run that never stops")
                .end,
            DescentEnd::NoDirection
        );
        let wrong = |p: Vector2<f64>| (p.norm(), -p, Matrix2::identity());
        assert_eq!(
            descend(&mut from(1.0, 0.0, wrong), &DescentOptions::default(), &Run::default())
                .expect("a run that never stops")
                .end,
            DescentEnd::NoDescent
        );
        let down = |p: Vector2<f64>| (-p.x, Vector2::new(-1.0, 0.0), Matrix2::identity());
        let options = DescentOptions { max_iterations: 5, ..DescentOptions::default() };
        let report = descend(&mut from(0.0, 0.0, down), &options, &Run::default()).expect("a run that never stops");
        assert!(report.end == DescentEnd::IterationLimit && report.iterations() == 5);
    }
}
