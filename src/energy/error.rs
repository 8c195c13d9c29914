//! What an energy can refuse.

use crate::sparse::SparseError;

/// Why an energy has no minimizer, or was set up wrongly.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnergyError {
    /// Numerics: the normal equations could not be solved.
    #[error(transparent)]
    Solve(#[from] SparseError),
}
