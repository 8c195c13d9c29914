//! Errors of plumb-line calibration.

use plumbline_num::run::Stopped;

/// Marked lines from which no lens can be estimated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// A size that is not positive and finite.
    #[error("picture size {0} × {1} px is invalid (expected two finite numbers above 0)")]
    Size(f64, f64),
    /// A mark that is not finite.
    #[error("line {line:?} has a point that is not finite: mark it again")]
    NotFinite {
        /// Name of the line.
        line: String,
    },
    /// Too few lines or points.
    #[error(
        "{lines} lines of three points or more with {samples} points in all do not determine a lens (expected 2 lines and {needed} \
         points): mark more points along long lines near the picture's edges"
    )]
    TooFew {
        /// Lines of three points or more.
        lines: usize,
        /// Their points.
        samples: usize,
        /// Points needed.
        needed: usize,
    },
    /// No model could be fitted.
    #[error(
        "no lens model makes the marked lines straight: check that they are straight in the world, or give the lens"
    )]
    NoLens,
    /// Most lines contradict each other.
    #[error(
        "only {used} of {lines} marked lines agree on a lens: check that they are straight in the world, or give the lens"
    )]
    LinesDisagree {
        /// Lines that agree.
        used: usize,
        /// Lines of three points or more.
        lines: usize,
    },
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}
