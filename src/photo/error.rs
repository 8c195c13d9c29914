//! Errors of the methods on photos and clips of them, and of files of marks.

use plumbline_image::warp::WarpError;
use plumbline_num::document::DocumentError;
use plumbline_num::energy::EnergyError;
use plumbline_num::optim::qp::QpError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a method on photos gave no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PhotoError {
    /// Settings: an option out of its range.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// Settings: an output that the picture cannot give.
    #[error("{0}")]
    Output(String),
    /// Input: a picture, a lens or a mark that cannot be used; the text names it.
    #[error("{0}")]
    Input(String),
    /// Input: a file of marks that is no such document, or cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// Input: a value that is not finite, so that the energy has no minimizer.
    #[error("the mesh could not be solved: {0}")]
    Energy(#[source] EnergyError),
    /// Input: a value that is not finite, so that the mesh is no warp.
    #[error(transparent)]
    Warp(#[from] WarpError),
    /// The run was interrupted, or its time is used up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<EnergyError> for PhotoError {
    fn from(error: EnergyError) -> Self {
        match error {
            EnergyError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Energy(error),
        }
    }
}

impl From<QpError> for PhotoError {
    fn from(error: QpError) -> Self {
        match error {
            QpError::Interrupted(stopped) => Self::Interrupted(stopped),
            error => Self::Input(format!("rows and columns could not be sized: {error}")),
        }
    }
}
