//! Robust terms by iterative reweighting.
//!
//! ```text
//! E(x) = Σₖ wₖ ρ(‖rₖ(x)‖²) + the terms that stay quadratic,      wₖ ← wₖ ρ'(‖rₖ‖²)
//! ```
//!
//! `ρ` is concave in the squared residual, so each reweighted quadratic lies above `E` and touches it at the present `x`:
//! `E` never rises. Geman–McClure is not convex; it needs a start near the solution.
//!
//! # Reference
//! P. W. Holland, R. E. Welsch, *Robust regression using iteratively reweighted least-squares*, Comm. Statist. 6 (1977);
//! losses as in Ceres.

use super::{Convergence, EnergyError, Factored, FixedValues, Report, Targets, Term, Value};
use crate::options::OptionError;
use crate::run::Run;

/// `ρ(s)` of a squared residual `s`; the parameter is a residual length, in the unit of the residual, > 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// `s` up to `k²`, then `2k√s − k²`: outliers pull with constant force.
    Huber(f64),
    /// `c² ln(1 + s/c²)`: outliers pull ever less.
    Cauchy(f64),
    /// `c² s / (c² + s)`: outliers hardly pull at all.
    GemanMcClure(f64),
}

impl Loss {
    /// `ρ(s)`, with `ρ(s) ≈ s` for small `s`.
    pub fn value(self, s: f64) -> f64 {
        match self {
            Self::Huber(k) if s <= k * k => s,
            Self::Huber(k) => 2.0 * k * s.sqrt() - k * k,
            Self::Cauchy(c) => c * c * (s / (c * c)).ln_1p(),
            Self::GemanMcClure(c) => c * c * s / (c * c + s),
        }
    }

    /// `ρ'(s)`, in (0, 1].
    pub fn weight(self, s: f64) -> f64 {
        match self {
            Self::Huber(k) if s <= k * k => 1.0,
            Self::Huber(k) => k / s.sqrt(),
            Self::Cauchy(c) => 1.0 / (1.0 + s / (c * c)),
            Self::GemanMcClure(c) => (c * c / (c * c + s)).powi(2),
        }
    }

    fn check(self) -> Result<(), OptionError> {
        let (Self::Huber(scale) | Self::Cauchy(scale) | Self::GemanMcClure(scale)) = self;
        OptionError::check_positive([("loss scale", scale)])
    }
}

/// Reweighting driver: `loss` acts on some terms of a factored energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Reweighted<'a> {
    /// The loss.
    pub loss: Loss,
    /// The terms it acts on; all others stay quadratic.
    pub terms: &'a [Term],
    /// When to stop.
    pub convergence: Convergence,
}

impl Reweighted<'_> {
    /// Minimizes from `x`, in and out. Afterwards `factored` holds its first weights again.
    ///
    /// # Errors
    /// [`EnergyError::Option`] for a bad loss or criterion; as [`Factored::reweight`] and [`Factored::solve`] otherwise.
    pub fn minimize<const D: usize>(
        &self,
        factored: &mut Factored<D>,
        targets: &Targets<D>,
        values: &FixedValues<D>,
        x: &mut [Value<D>],
        run: &Run,
    ) -> Result<Report, EnergyError> {
        self.loss.check()?;
        self.convergence.check()?;
        let weights: Vec<f64> = factored.rows.iter().map(|row| row.w).collect();
        let mut robust = vec![false; weights.len()];
        self.terms.iter().for_each(|term| robust[term.0] = true);
        let result = self.iterate(factored, &weights, &robust, (targets, values), x, run);
        // The first weights come back even where the run has ended: the factored energy may be used again.
        factored.reweight(|term, _| weights[term.0], &Run::default())?;
        result
    }

    fn iterate<const D: usize>(
        &self,
        factored: &mut Factored<D>,
        weights: &[f64],
        robust: &[bool],
        (targets, values): (&Targets<D>, &FixedValues<D>),
        x: &mut [Value<D>],
        run: &Run,
    ) -> Result<Report, EnergyError> {
        let mut squares = vec![0.0; weights.len()];
        let mut energies = vec![self.measure(factored, weights, robust, targets, x, &mut squares)];
        for iterations in 1..=self.convergence.max_iterations {
            factored
                .reweight(|Term(r), _| weights[r] * if robust[r] { self.loss.weight(squares[r]) } else { 1.0 }, run)?;
            factored.solve_into(targets, values, x)?;
            energies.push(self.measure(factored, weights, robust, targets, x, &mut squares));
            if self.convergence.reached(&energies) {
                return Ok(Report { iterations, energies, converged: true });
            }
        }
        Ok(Report { iterations: self.convergence.max_iterations, energies, converged: false })
    }

    /// Squared residual of every term (by its first row), and the robust energy.
    fn measure<const D: usize>(
        &self,
        factored: &Factored<D>,
        weights: &[f64],
        robust: &[bool],
        targets: &Targets<D>,
        x: &[Value<D>],
        squares: &mut [f64],
    ) -> f64 {
        let firsts = (0..weights.len()).filter(|&r| factored.rows[r].term == r);
        firsts
            .map(|r| {
                squares[r] = factored.squared_residual(Term(r), targets, x);
                weights[r] * if robust[r] { self.loss.value(squares[r]) } else { squares[r] }
            })
            .sum()
    }
}
