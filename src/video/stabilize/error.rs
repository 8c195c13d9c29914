//! Errors of the stabilizer, and whose fault they are.

use std::path::PathBuf;

use crate::path::PathError;
use crate::track::{StoreError, TrackError};
use plumbline_image::feature::MaskError;
use plumbline_image::warp::{FieldError, WarpError};
use plumbline_num::run::Stopped;

/// Errors of the stabilizer; [`StabilizeError::fault`] returns whose fault one is.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StabilizeError {
    /// The options are at fault: a value is out of range.
    #[error("{option} {value} is invalid (expected {low} to {high})")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// Value given.
        value: f64,
        /// Smallest allowed value.
        low: f64,
        /// Largest allowed value.
        high: f64,
    },
    /// The options are at fault: no tracker has such settings.
    #[error(transparent)]
    Tracker {
        /// What is wrong with them.
        #[from]
        source: TrackError,
    },
    /// The input is at fault: the mask is missing, no picture, or hides everything.
    #[error(transparent)]
    Mask {
        /// What is wrong with it.
        #[from]
        source: MaskError,
    },
    /// The input is at fault: the source of frames failed.
    #[error("{source}")]
    Frames {
        /// Error of the source.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The input is at fault: the source ended before its first frame.
    #[error("the clip has no frame that could be decoded")]
    NoFrames,
    /// The input is at fault: the clip is another than the one analyzed.
    #[error("the clip has more frames than were analyzed ({analyzed})")]
    TooManyFrames {
        /// Frames that were analyzed.
        analyzed: usize,
    },
    /// The input is at fault: the motion file cannot be read, or is of another clip.
    #[error("{}: {reason}", path.display())]
    MotionFile {
        /// The file, or the folder of a model.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The input is at fault: a model of another program cannot be read.
    #[error(transparent)]
    Model {
        /// What is wrong with it.
        source: crate::motion::exchange::colmap::ColmapError,
    },
    /// The input is at fault: the path file cannot be read, or does not fit the clip.
    #[error("{}: {reason}", path.display())]
    PathFile {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The input is at fault: a path file is aligned by the cameras of the clip, and these were not recovered.
    #[error("a path file needs the recovered cameras of the clip, and its tracks: set `motion.cameras`")]
    PathFileWithoutCameras,
    /// The options or the clip are at fault: no path can be planned.
    #[error(transparent)]
    Path {
        /// Why.
        source: PathError,
    },
    /// The options are at fault: no grid of this shape and stiffness.
    #[error(transparent)]
    Grid {
        /// What is wrong with it.
        source: WarpError,
    },
    /// A fault of the library: the warp of a frame could not be solved.
    #[error("frame {frame}: {source}")]
    Warp {
        /// The frame, from 0.
        frame: usize,
        /// Why.
        source: WarpError,
    },
    /// A fault of the library: the map of a frame has no inverse.
    #[error("frame {frame}: {source}")]
    Map {
        /// The frame, from 0.
        frame: usize,
        /// Why.
        source: FieldError,
    },
    /// The environment is at fault: the tracks of the clip cannot be kept in its temporary files.
    #[error(transparent)]
    Store {
        /// Why.
        #[from]
        source: StoreError,
    },
    /// The call was stopped from outside, or its time is up.
    #[error(transparent)]
    Interrupted {
        /// Which of the two.
        #[from]
        source: Stopped,
    },
}

impl From<PathError> for StabilizeError {
    fn from(error: PathError) -> Self {
        match error {
            PathError::Interrupted(source) => Self::Interrupted { source },
            source => Self::Path { source },
        }
    }
}

/// Whose fault a [`StabilizeError`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StabilizeFault {
    /// Of the options: change them.
    Options,
    /// Of the clip or of a file that goes with it: give another.
    Input,
    /// Of the machine: the next try may succeed.
    Environment,
    /// Of nobody: the call was stopped.
    Interrupted,
    /// Of this library: please report it.
    Internal,
}

impl StabilizeError {
    /// Whose fault it is.
    pub fn fault(&self) -> StabilizeFault {
        match self {
            Self::Option { .. }
            | Self::Tracker { .. }
            | Self::Grid { .. }
            | Self::Path { source: PathError::Option { .. } | PathError::NoRoom } => StabilizeFault::Options,
            Self::Mask { .. }
            | Self::Frames { .. }
            | Self::NoFrames
            | Self::TooManyFrames { .. }
            | Self::MotionFile { .. }
            | Self::Model { .. }
            | Self::PathFile { .. }
            | Self::PathFileWithoutCameras
            | Self::Path { .. } => StabilizeFault::Input,
            Self::Store { .. } => StabilizeFault::Environment,
            Self::Interrupted { .. } => StabilizeFault::Interrupted,
            Self::Warp { .. } | Self::Map { .. } => StabilizeFault::Internal,
        }
    }
}
