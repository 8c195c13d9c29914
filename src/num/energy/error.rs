//! What an energy can refuse.

use crate::options::OptionError;
use crate::run::Stopped;
use crate::sparse::SparseError;

/// Why an energy has no minimizer, or was set up wrongly.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EnergyError {
    /// Input: some unknowns are joined to no fixed one, and no term says where they are.
    #[error(
        "nothing holds the component of {} unknown(s) that contains unknown {}: fix one of them or give it a target",
        unknowns.len(),
        unknowns[0]
    )]
    Unconstrained {
        /// The component, ascending, never empty.
        unknowns: Vec<usize>,
    },
    /// Input: a weight that is negative or not finite.
    #[error("term {term} has weight {weight} (expected a finite number, 0 or more)")]
    Weight {
        /// Number of the term, in the order of adding.
        term: usize,
        /// Its weight.
        weight: f64,
    },
    /// Input: a coefficient or constant that is not finite.
    #[error("term {term} has a coefficient or target that is not finite")]
    NotFinite {
        /// Number of the term, in the order of adding.
        term: usize,
    },
    /// Input: an unknown that does not exist.
    #[error("unknown {unknown} does not exist (the energy has {unknowns}, numbered from 0)")]
    NoSuchUnknown {
        /// The number asked for.
        unknown: usize,
        /// How many there are.
        unknowns: usize,
    },
    /// Input: values made for another fixed set than the one factored.
    #[error("{given} fixed value(s) do not belong to the fixed set of {expected}")]
    FixedValues {
        /// Values given.
        given: usize,
        /// Unknowns in the fixed set.
        expected: usize,
    },
    /// Input: targets made for another energy.
    #[error("{given} target(s) do not belong to an energy of {expected} row(s)")]
    Targets {
        /// Targets given.
        given: usize,
        /// Rows of the energy.
        expected: usize,
    },
    /// Settings: a driver's option out of its range.
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
