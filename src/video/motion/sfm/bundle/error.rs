//! Errors of bundle adjustment.

use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why an adjustment was refused or ended early.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BundleError {
    /// Input: an option out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Input: a non-finite value in the scene or in an observation, or a lens without focal length.
    #[error("{what} is not finite or not valid; leave it out or set it to none")]
    NotFinite {
        /// The offending value.
        what: String,
    },
    /// Input: no points to adjust.
    #[error("0 points are seen by two known frames (expected at least 1); triangulate first")]
    NoPoints,
    /// The run was interrupted, or its time limit was reached.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
