//! Alternation of a local fit and the global solve.
//!
//! ```text
//! repeat   b ← local(x)          the targets that fit x best (rotations, scales, projections)
//!          x ← argmin E(x; b)    one back-substitution
//! ```
//!
//! Where the local step minimizes the same `E` over its targets, `E` never rises. It falls slowly near the end (ARAP takes
//! hundreds of rounds), hence a criterion and a report instead of a count.
//!
//! # Reference
//! O. Sorkine, M. Alexa, *As-rigid-as-possible surface modeling*, SGP 2007, section 3.

use super::{EnergyError, Factored, FixedValues, Targets, Value};
use crate::options::OptionError;
use crate::run::Run;

/// When an iteration stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Rounds at most, ≥ 1.
    pub max_iterations: usize,
    /// Converged when a round lowers the energy by no more than this fraction of it; dimensionless, in [0, 1).
    pub tolerance: f64,
}

impl Default for Convergence {
    fn default() -> Self {
        Self { max_iterations: 500, tolerance: 1e-6 }
    }
}

impl Convergence {
    /// Refuses a criterion out of its range.
    ///
    /// # Errors
    /// [`EnergyError::Option`].
    pub fn check(&self) -> Result<(), EnergyError> {
        OptionError::check(self.max_iterations > 0, "max_iterations", 0.0, "1 or more")?;
        let tolerance = self.tolerance;
        Ok(OptionError::check((0.0..1.0).contains(&tolerance), "tolerance", tolerance, "0 to below 1")?)
    }

    /// True where the last two energies no longer differ, of either sign; NaN counts as standing still.
    pub fn reached(&self, energies: &[f64]) -> bool {
        match energies {
            [.., before, now] => now.is_nan() || before - now <= self.tolerance * before.abs(),
            _ => false,
        }
    }
}

/// How an iteration went.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Global solves done.
    pub iterations: usize,
    /// Energy at the start and after each round.
    pub energies: Vec<f64>,
    /// True where the tolerance was reached, false where the rounds ran out.
    pub converged: bool,
}

/// Alternation driver over a factored energy.
#[derive(Debug)]
pub struct LocalGlobal<'a, const D: usize> {
    factored: &'a mut Factored<D>,
    targets: Targets<D>,
}

impl<'a, const D: usize> LocalGlobal<'a, D> {
    /// A driver that starts from the targets the expressions were written with.
    pub fn new(factored: &'a mut Factored<D>) -> Self {
        Self { targets: factored.targets(), factored }
    }

    /// The targets of the last local step.
    pub fn targets(&self) -> &Targets<D> {
        &self.targets
    }

    /// Minimizes from `x` (in and out; fixed unknowns are set to their values first).
    ///
    /// `local` writes the targets that fit its first argument.
    ///
    /// # Errors
    /// [`EnergyError::Option`] for a bad criterion; as [`Factored::solve`] otherwise.
    pub fn minimize(
        &mut self,
        values: &FixedValues<D>,
        x: &mut [Value<D>],
        convergence: &Convergence,
        mut local: impl FnMut(&[Value<D>], &mut Targets<D>),
        run: &Run,
    ) -> Result<Report, EnergyError> {
        convergence.check()?;
        for (&i, value) in values.set().unknowns().iter().zip(values.as_slice()) {
            x[i] = *value;
        }
        local(x, &mut self.targets);
        let mut energies = vec![self.factored.energy(&self.targets, x)];
        for iterations in 1..=convergence.max_iterations {
            run.check()?;
            self.factored.solve_into(&self.targets, values, x)?;
            local(x, &mut self.targets);
            energies.push(self.factored.energy(&self.targets, x));
            if convergence.reached(&energies) {
                return Ok(Report { iterations, energies, converged: true });
            }
        }
        Ok(Report { iterations: convergence.max_iterations, energies, converged: false })
    }
}
