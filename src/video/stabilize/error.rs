//! Errors of the stabilizer, by whose fault they are.

use crate::path::PathError;
use crate::track::{JoinError, StoreError, TrackError};
use plumbline_image::feature::FeatureError;
use plumbline_image::warp::WarpError;
use plumbline_num::options::OptionError;
use plumbline_num::run::Stopped;

/// Why a clip was not stabilized.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StabilizeError {
    /// The options are at fault: change them.
    #[error("{0}")]
    Options(String),
    /// The clip, or a file that goes with it, is at fault: give another.
    #[error("{0}")]
    Input(String),
    /// The input is at fault: the source of frames failed.
    #[error("{0}")]
    Frames(#[source] Box<dyn std::error::Error + Send + Sync>),
    /// The input is at fault: a path file is aligned by the cameras of the clip, and these were not recovered.
    #[error("a path file needs the recovered cameras of the clip, and its tracks: set `motion.cameras`")]
    PathFileWithoutCameras,
    /// The machine is at fault: the tracks of the clip cannot be kept in its temporary files.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Input: the warp of a frame could not be solved, or has no inverse.
    #[error("frame {frame}: {reason}; take the mode `similarity`, which has no meshes, or cut the frame out")]
    Warp {
        /// The frame, from 0.
        frame: usize,
        /// Why.
        #[source]
        reason: WarpError,
    },
    /// The call was stopped from outside, or its time is up.
    #[error(transparent)]
    Interrupted(#[from] Stopped),
}

impl From<OptionError> for StabilizeError {
    fn from(error: OptionError) -> Self {
        Self::Options(error.to_string())
    }
}

impl From<TrackError> for StabilizeError {
    fn from(error: TrackError) -> Self {
        Self::Options(error.to_string())
    }
}

impl From<JoinError> for StabilizeError {
    fn from(error: JoinError) -> Self {
        Self::Input(error.to_string())
    }
}

impl From<FeatureError> for StabilizeError {
    fn from(error: FeatureError) -> Self {
        match error {
            FeatureError::Interrupted(stopped) => Self::Interrupted(stopped),
            FeatureError::Option(_) => Self::Options(error.to_string()),
            error => Self::Input(error.to_string()),
        }
    }
}

impl From<PathError> for StabilizeError {
    fn from(error: PathError) -> Self {
        match error {
            PathError::Options(text) => Self::Options(text),
            PathError::Input(text) => Self::Input(text),
            PathError::Interrupted(stopped) => Self::Interrupted(stopped),
        }
    }
}
