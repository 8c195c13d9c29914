//! Verdicts: the motion model that the tracks of a segment support, and the reason.

use std::ops::Range;

use super::clip::ClipMotion;
use super::frame_motion::{FrameMotion, MotionQuality, PlanarModel};
use plumbline_num::math::median;

/// Model of the picture's motion, from the simplest to the most flexible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionModel {
    /// No reliable motion: the frames are not warped.
    Untouched,
    /// Translation, rotation and zoom.
    Similarity,
    /// One homography per frame.
    Homography,
    /// The homography with local motion on a grid.
    Mesh,
    /// A camera that rotates about its center.
    Rotation,
    /// The mesh, toward trajectories smoothed in their common subspace.
    Subspace,
    /// Cameras and points in space.
    ThreeD,
}

/// A segment of one shot with the model that it supports.
#[derive(Clone, Debug, PartialEq)]
pub struct SegmentVerdict {
    /// Its frames.
    pub frames: Range<usize>,
    /// The most flexible model that its tracks support.
    pub model: MotionModel,
    /// Reason, for the user.
    pub reason: String,
}

/// Longest part with one verdict, frames: two to four seconds, so that a short disturbance does not decide for a whole shot.
const MAX_PART: usize = 90;
/// Least number of background points per frame (median) for local motion: one per cell of a 12×10 grid.
const POINTS_FOR_MESH: f64 = 120.0;
/// The same for perspective: five times the eight parameters of a homography.
const POINTS_FOR_HOMOGRAPHY: f64 = 40.0;
/// Least fraction of the frame's cells with background points for local motion: a mesh extrapolates into the others.
const COVERAGE_FOR_MESH: f64 = 0.35;
/// The same for perspective, which few well-distributed points determine.
const COVERAGE_FOR_HOMOGRAPHY: f64 = 0.2;
/// Residual of the homography, px at 640 px across, from which local motion is modeled: above the noise of the tracker on a
/// plane. Residuals of 0.1 px that vary from frame to frame are visible as wobble: on nus-regular-0 (0.12 px) the mesh lowers the
/// wobble ratio from 1.11 to 0.95.
const RESIDUAL_FOR_MESH: f64 = 0.06;
/// Least fraction of frames with a measured motion; below it most of the path would be interpolated.
const MIN_MEASURED_RATIO: f64 = 0.5;

/// The verdicts on a clip, shot by shot, in parts of at most 90 frames; neighbors with the same model are one segment.
pub fn verdicts(clip: &ClipMotion) -> Vec<SegmentVerdict> {
    let unit = f64::from(clip.width.max(clip.height)) / 640.0;
    let mut segments: Vec<SegmentVerdict> = Vec::new();
    for shot in &clip.shots {
        let parts = shot.len().div_ceil(MAX_PART).max(1);
        for part in 0..parts {
            let frames = shot.start + shot.len() * part / parts..shot.start + shot.len() * (part + 1) / parts;
            let (model, reason) = verdict_on(&clip.frames[frames.clone()], unit);
            match segments.last_mut() {
                Some(last) if last.frames.end > shot.start && last.model == model => last.frames.end = frames.end,
                _ => segments.push(SegmentVerdict { frames, model, reason }),
            }
        }
    }
    segments
}

fn verdict_on(frames: &[FrameMotion], unit_px: f64) -> (MotionModel, String) {
    let moving =
        || frames.iter().filter(|f| f.quality != MotionQuality::ShotStart && f.quality != MotionQuality::Duplicate);
    let measured: Vec<&FrameMotion> = moving().filter(|f| f.quality == MotionQuality::Measured).collect();
    let ratio = measured.len() as f64 / moving().count().max(1) as f64;
    if !(ratio >= MIN_MEASURED_RATIO) || measured.is_empty() {
        return (
            MotionModel::Untouched,
            format!("motion could be measured in {:.0} % of the frames only", 100.0 * ratio),
        );
    }
    let middle = |f: &dyn Fn(&FrameMotion) -> f64| {
        let mut v: Vec<f64> = measured.iter().map(|m| f(m)).collect();
        median(&mut v).unwrap_or(0.0)
    };
    let (points, coverage) = (middle(&|f| f64::from(f.inliers)), middle(&|f| f.coverage));
    let percent = 100.0 * coverage;
    if points < POINTS_FOR_HOMOGRAPHY || coverage < COVERAGE_FOR_HOMOGRAPHY {
        return (
            MotionModel::Similarity,
            format!("{points:.0} background points on {percent:.0} % of the frame are few"),
        );
    }
    let bent = measured.iter().filter(|f| f.model == PlanarModel::Homography).count() as f64 / measured.len() as f64;
    let residual = middle(&|f| f.residual_px) / unit_px;
    if residual >= RESIDUAL_FOR_MESH && points >= POINTS_FOR_MESH && coverage >= COVERAGE_FOR_MESH {
        return (
            MotionModel::Mesh,
            format!("{points:.0} points move {residual:.2} px beside any plane: depth or wobble"),
        );
    }
    if bent < 0.5 {
        return (MotionModel::Similarity, format!("perspective shows in {:.0} % of the frames only", 100.0 * bent));
    }
    (
        MotionModel::Homography,
        format!("{points:.0} points on {percent:.0} % of the frame move as one plane, to {residual:.2} px"),
    )
}
