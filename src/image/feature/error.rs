//! Errors of features.

use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a feature was not found, or a mask cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FeatureError {
    /// Input: a picture or a mask that cannot be used; the text says why.
    #[error("{0}")]
    Input(String),
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
