//! Errors of retargeting.

use plumbline_image::warp::FieldError;
use plumbline_num::energy::EnergyError;
use plumbline_num::math::Rect;
use plumbline_num::optim::qp::QpError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a picture cannot be given another shape.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RetargetError {
    /// Input: a picture without pixels, or too large for maps.
    #[error("the picture has {width}×{height} px (expected 1 to {MAX_SIDE} each way)")]
    SourceSize {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// Input: an output without pixels, or too large.
    #[error("target size {width}×{height} px is invalid (expected 1 to {MAX_SIDE} each way)")]
    TargetSize {
        /// Width, px.
        width: usize,
        /// Height, px.
        height: usize,
    },
    /// Input: a window that is empty or reaches outside the picture.
    #[error("the window from ({}, {}) to ({}, {}) is empty or reaches outside the picture",
        window.min.x, window.min.y, window.max.x, window.max.y)]
    Window {
        /// The window, px of the picture.
        window: Rect,
    },
    /// Input: a marked line with a point that is not finite.
    #[error("line {name:?} has a point that is not finite; mark it again")]
    Line {
        /// The line's name.
        name: String,
    },
    /// Input: a face whose box is empty or not finite.
    #[error("face {index} has an empty box or one that is not finite")]
    Face {
        /// Its index.
        index: usize,
    },
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Numerics: the initial guess could not be solved.
    #[error("rows and columns could not be sized: {0}")]
    Start(QpError),
    /// Numerics: the mesh could not be solved.
    #[error("the mesh could not be solved: {0}")]
    Solve(EnergyError),
    /// Numerics: the mesh cannot be inverted.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

/// Largest side of a picture, px: the largest that JPEG can hold.
pub(super) const MAX_SIDE: usize = 65_535;

impl From<QpError> for RetargetError {
    fn from(error: QpError) -> Self {
        match error {
            QpError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Start(error),
        }
    }
}

impl From<EnergyError> for RetargetError {
    fn from(error: EnergyError) -> Self {
        match error {
            EnergyError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Solve(error),
        }
    }
}
