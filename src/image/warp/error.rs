//! Errors of warps.

use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;

/// Why no warp could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WarpError {
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Input: a grid, a point, a saliency or a map that cannot be used; the text names it.
    #[error("{0}")]
    Input(String),
    /// Numerics: the solve failed.
    #[error("the warp could not be solved: {0}")]
    Energy(#[from] EnergyError),
}
