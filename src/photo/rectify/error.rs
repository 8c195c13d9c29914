//! Errors of rectification.

use plumbline_image::warp::FieldError;
use plumbline_num::energy::EnergyError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a picture cannot be rectified. Unless noted the caller is at fault.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RectifyError {
    /// The view does not overlap the picture.
    #[error("the view shows nothing of the picture: choose another direction, or a larger field of view")]
    EmptyView,
    /// An option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The output would have no pixels, or too many.
    #[error("the output would have {width} × {height} px (expected 1 to 16384 each): choose another size or crop")]
    Size {
        /// Width, px.
        width: f64,
        /// Height, px.
        height: f64,
    },
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

impl From<EnergyError> for RectifyError {
    fn from(error: EnergyError) -> Self {
        match error {
            EnergyError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Energy(error),
        }
    }
}
