//! Camera motion from tracked points: planar motion between frames, rolling shutter, structure from motion, files.

mod background;
mod cameras;
mod clip;
mod estimator;
pub mod exchange;
mod file;
mod frame_motion;
mod planar;
mod planar_fit;
mod rolling_shutter;
pub mod sfm;
mod verdict;

pub use cameras::{ClipCameras, FrameCamera, ShotCameras, WindowCameras, WorldPoint};
pub use clip::{ClipMotion, MAX_BRIDGE};
pub use estimator::MotionEstimator;
#[cfg(feature = "schema")]
pub use file::motion_file_schema;
pub use file::{FORMAT, MotionFileError, VERSION};
pub use frame_motion::{FrameMotion, MotionQuality, PlanarModel};
pub use planar_fit::{FrameScale, Pair, homography, homography_of_four, similarity};
pub use rolling_shutter::{Readout, ReadoutEstimator, RowMotion};
pub use verdict::{MotionModel, SegmentVerdict, verdicts};
