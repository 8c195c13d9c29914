//! Motion of the camera's picture, from tracked points: planar motion between frames that follows the still world.

mod background;
mod estimator;
mod frame_motion;
mod planar;
mod planar_fit;

pub use estimator::{MotionEstimator, MotionOptions};
pub use frame_motion::{FrameFlags, FrameInput, FrameMotion, MotionQuality, PlanarModel, TrackPoint};
pub use planar_fit::{FrameScale, Pair, homography, homography_dlt, homography_of_four, similarity};
