//! The figures of a plan: crop, shake before and after, and the motion model of each segment.

use std::ops::Range;

use super::frame_models::FrameModels;
use super::shake::{PathDeviations, ShakeSummary};
use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipMotion, MotionModel};
use crate::path::VirtualPath;

/// The figures of a plan.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSummary {
    /// Fraction of the picture's width and height that is kept, mean over the frames, in [0, 1].
    pub mean_crop: f64,
    /// Least fraction kept in any frame.
    pub min_crop: f64,
    /// Shake before and after, where the motion is known.
    pub shake: Option<ShakeSummary>,
    /// The segments, in order, without gaps.
    pub segments: Vec<PlanSegment>,
}

/// Figures of a run of frames that are warped with the same model.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanSegment {
    /// Its frames.
    pub frames: Range<usize>,
    /// The model.
    pub model: MotionModel,
    /// Why this model and this path, for the user.
    pub reason: String,
    /// Fraction of the picture's width and height that is kept, mean over its frames.
    pub crop: Option<f64>,
    /// Shake before and after.
    pub shake: Option<ShakeSummary>,
}

impl PlanSummary {
    /// The figures of `path` under the models of its frames.
    pub fn of(motion: Option<&ClipMotion>, path: &VirtualPath, models: &FrameModels) -> Self {
        // A frame rotated inside a window of its own size is a trace larger than the window.
        let crop: Vec<f64> = path.crop.iter().map(|c| c.min(1.0)).collect();
        let mean = |crop: &[f64]| crop.iter().sum::<f64>() / crop.len().max(1) as f64;
        let deviations = motion.map(|m| PathDeviations::of(m, &path.out_from_src));
        let segments = models.segments().iter().map(|s| PlanSegment {
            frames: s.frames.clone(),
            model: s.model,
            reason: s.reason.clone(),
            crop: crop.get(s.frames.clone()).map(mean),
            shake: deviations.as_ref().and_then(|deviations| deviations.over(s.frames.clone())),
        });
        Self {
            mean_crop: mean(&crop),
            min_crop: crop.iter().copied().fold(1.0, f64::min),
            shake: deviations.as_ref().and_then(PathDeviations::whole),
            segments: segments.collect(),
        }
    }
}

/// The word for a motion model.
pub fn model_name(model: MotionModel) -> &'static str {
    match model {
        MotionModel::Untouched => "unchanged",
        MotionModel::Similarity => "similarity",
        MotionModel::Homography => "homography",
        MotionModel::Mesh => "mesh",
        MotionModel::Rotation => "rotation",
        MotionModel::Subspace => "subspace",
        MotionModel::ThreeD => "3d",
    }
}

/// The word for the verdict on the cameras of a shot.
pub fn verdict_name(verdict: SfmVerdict) -> &'static str {
    match verdict {
        SfmVerdict::ThreeD => "3d",
        SfmVerdict::Planar => "planar",
        SfmVerdict::RotationOnly => "rotation",
        SfmVerdict::Zoom => "zoom",
        SfmVerdict::TooFewPoints => "few points",
        SfmVerdict::Failed => "no cameras",
    }
}
