//! The motion from the previous frame to a frame.

use plumbline_num::math::{Homography, Similarity2};
use plumbline_num::time::Timestamp;

/// The simplest model that explains the motion to a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlanarModel {
    /// No motion, or none known.
    #[default]
    Identity,
    /// Rotation, zoom and shift.
    Similarity,
    /// Shear, stretch or perspective are supported by the points.
    Homography,
}

/// Origin of a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum MotionQuality {
    /// First frame of a shot, without a previous frame.
    #[default]
    ShotStart,
    /// Measured on tracked points.
    Measured,
    /// The picture repeats the previous one: no motion, exactly.
    Duplicate,
    /// Interpolated between the measured motions around a short gap.
    Bridged,
    /// Not measurable (black, blurred, too few or contradicting points) and not bridged: identity.
    Lost,
}

/// The motion that leads from the previous frame to this one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameMotion {
    /// Presentation time of this frame.
    pub pts: Timestamp,
    /// Previous-frame px to this-frame px, four parameters.
    pub similarity: Similarity2,
    /// Previous-frame px to this-frame px, eight parameters; equals `similarity` where more is not supported.
    pub homography: Homography,
    /// The family the points support.
    pub model: PlanarModel,
    /// Number of points observed in both frames.
    pub points: u32,
    /// Number of those that moved with the background.
    pub inliers: u32,
    /// Fraction of the frame's cells that contain such a point, in [0, 1].
    pub coverage: f64,
    /// Median distance of the background points from the homography's prediction, px.
    pub residual_px: f64,
    /// The same for the similarity, px.
    pub similarity_residual_px: f64,
    /// Origin of the motion.
    pub quality: MotionQuality,
}

impl FrameMotion {
    /// No motion, of the given quality.
    pub fn still(pts: Timestamp, quality: MotionQuality) -> Self {
        Self {
            pts,
            similarity: Similarity2::IDENTITY,
            homography: Homography::identity(),
            model: PlanarModel::Identity,
            points: 0,
            inliers: 0,
            coverage: 0.0,
            residual_px: 0.0,
            similarity_residual_px: 0.0,
            quality,
        }
    }
}
