//! What a bundle adjustment can refuse.

use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why nothing could be adjusted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BundleError {
    /// Input: a setting out of range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Input: a scene or an observation with a value that is not a number, or a lens without focal length.
    #[error("{what} is not finite or not valid; leave it out or set it to none")]
    NotFinite {
        /// The offending value.
        what: String,
    },
    /// Input: nothing to adjust.
    #[error("{found} points are seen by two known frames (expected at least {least}); triangulate first")]
    TooFewPoints {
        /// Points that could be used.
        found: usize,
        /// Least number.
        least: usize,
    },
    /// Input: a pose from too little.
    #[error("{found} known points are seen (expected at least {least}); a pose needs more")]
    TooFewObservations {
        /// Observations of known points.
        found: usize,
        /// Least number.
        least: usize,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
