//! Kinds of clips that are found and smoothed; all others are in [`crate::stages`].

mod lens_undistort;
mod motion;
mod motion_import;
mod smooth;
mod track;
mod warp;

pub use crate::stages::*;
pub use lens_undistort::LensUndistortSettings;
pub use motion::{MotionSettings, RollingShutter};
pub use motion_import::MotionImportSettings;
pub use smooth::{InSpace, PathMethod, SmoothSettings, Zoom};
pub use track::TrackSettings;
pub use warp::{ModelChoice, WarpSettings};
