//! Errors of rectangling.

use plumbline_image::warp::FieldError;
use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a picture cannot be made rectangular. Unless noted the caller is at fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RectangleError {
    /// The picture has no border of one color.
    #[error(
        "nothing lies around the picture: a border that is transparent, black or white along the frame is what \
         rectangling fills"
    )]
    NoBorder,
    /// Too little of the picture is inside the border.
    #[error(
        "only {percent:.1} % of the picture lies inside its border (expected at least 20): is it the right picture?"
    )]
    Empty {
        /// Fraction inside, %.
        percent: f64,
    },
    /// The outline cannot be laid out without folds.
    #[error("the outline of the picture is too ragged to become a rectangle: crop it first")]
    Ragged,
    /// An option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The energy has no minimizer: an input is not finite.
    #[error(transparent)]
    Energy(EnergyError),
    /// The grid is no warp: an input is not finite.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<EnergyError> for RectangleError {
    fn from(error: EnergyError) -> Self {
        match error {
            EnergyError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Energy(error),
        }
    }
}
