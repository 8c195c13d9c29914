//! When an iteration that lowers an energy stops.

use super::EnergyError;
use crate::options::OptionError;

/// The criterion of an iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Convergence {
    /// Maximum number of iterations, ≥ 1.
    pub max_iterations: usize,
    /// Relative energy decrease per iteration at or below which it has converged; dimensionless, in [0, 1).
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

    /// True where the last two energies differ by no more than the tolerance, or the last is not a number.
    pub fn reached(&self, energies: &[f64]) -> bool {
        match energies {
            [.., before, now] => now.is_nan() || before - now <= self.tolerance * before.abs(),
            _ => false,
        }
    }
}
