//! What an energy can refuse.

use crate::options::OptionError;
use crate::run::Stopped;
use crate::sparse::SparseError;

/// Why an energy has no minimizer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnergyError {
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Numerics: the normal equations could not be solved.
    #[error(transparent)]
    Solve(SparseError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<SparseError> for EnergyError {
    fn from(error: SparseError) -> Self {
        match error {
            SparseError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Solve(error),
        }
    }
}
