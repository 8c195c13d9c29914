//! Quality figures of a reconstruction.

use super::bundle::residuals;
use super::mapper::{MIN_POINTS, WRONG_PX};
use super::prediction::predict;
use super::{Scene, TrackTable};
use plumbline_camera::CameraPose;
use plumbline_num::math::median;
use plumbline_num::run::{Run, Stopped};

/// Columns and rows of the grid in which coverage is measured: 48 cells, one bit each.
const CELLS: (usize, usize) = (8, 6);
/// Minimum fraction of the known points of a frame that its camera must explain: the majority.
const MIN_CORRECT_RATIO: f64 = 0.5;
/// Minimum fraction of the grid cells that must contain a correct observation, in a frame and in the mean of all frames: 17
/// of 48. An object of a quarter of the picture has the area of twelve.
pub(super) const MIN_COVERAGE: f64 = 0.35;

/// Quality figures of a reconstruction.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SfmFigures {
    /// Frames with a camera.
    pub registered: usize,
    /// Frames of the shot.
    pub frames: usize,
    /// Points with a position.
    pub points: usize,
    /// Observations of those points with a residual below 3 px (at 640 px across).
    pub observations: usize,
    /// Mean residual of those observations, px.
    pub reprojection_px: f64,
    /// Root mean square of these residuals, px.
    pub rms_px: f64,
    /// Median over the points of the maximum triangulation angle, rad.
    pub angle: f64,
    /// Fraction of the grid cells that contain such an observation, mean over the frames.
    pub coverage: f64,
    /// Focal length, px.
    pub focal: f64,
    /// Standard deviation of its logarithm; `None` if it was not computed.
    pub sigma_ln_focal: Option<f64>,
    /// Held-out observations that were predicted from other observations (`prediction.rs`).
    #[serde(default, alias = "foretold")]
    pub predicted: usize,
    /// Root mean square held-out prediction error with cameras and depths, px.
    #[serde(default, alias = "foretold_px")]
    pub predicted_px: f64,
    /// Root mean square held-out prediction error with homographies, px.
    #[serde(default, alias = "flat_px")]
    pub homography_px: f64,
}

/// Measures a scene against its tracks.
pub(super) fn figures(
    table: &TrackTable,
    scene: &Scene,
    sigma_ln_focal: Option<f64>,
    run: &Run,
) -> Result<SfmFigures, Stopped> {
    let unit = table.unit_px();
    let (mut sum, mut squares, mut observations) = (0.0, 0.0, 0_usize);
    let mut cells = vec![false; table.frames() * CELLS.0 * CELLS.1];
    for residual in residuals(scene, table.observations()).iter().filter(|m| m.px <= WRONG_PX * unit) {
        (sum, squares, observations) = (sum + residual.px, squares + residual.px * residual.px, observations + 1);
        cells[residual.frame as usize * CELLS.0 * CELLS.1 + table.cell(residual.pixel, CELLS)] = true;
    }
    let covered = cells.iter().filter(|c| **c).count() as f64 / (CELLS.0 * CELLS.1) as f64;
    let registered = scene.poses.iter().flatten().count();
    let mut angles: Vec<f64> = (0..table.points()).filter_map(|p| widest_angle(table, scene, p)).collect();
    let prediction = predict(table, scene, run)?;
    Ok(SfmFigures {
        registered,
        frames: table.frames(),
        points: angles.len(),
        observations,
        reprojection_px: sum / observations.max(1) as f64,
        rms_px: (squares / observations.max(1) as f64).sqrt(),
        angle: median(&mut angles).unwrap_or(0.0),
        coverage: covered / registered.max(1) as f64,
        focal: scene.intrinsics.focal,
        sigma_ln_focal,
        predicted: prediction.observations,
        predicted_px: prediction.space_px,
        homography_px: prediction.plane_px,
    })
}

/// By frame: whether its camera explains it, that is most of its known points, enough of them, over enough of the
/// image.
pub(super) fn explained_frames(table: &TrackTable, scene: &Scene) -> Vec<bool> {
    let wrong = WRONG_PX * table.unit_px();
    let mut frames = vec![Explained::default(); table.frames()];
    for residual in residuals(scene, table.observations()) {
        let frame = &mut frames[residual.frame as usize];
        frame.known += 1;
        if residual.px <= wrong {
            frame.right += 1;
            frame.cells |= 1 << table.cell(residual.pixel, CELLS);
        }
    }
    frames.iter().map(Explained::is_enough).collect()
}

/// Correct observations of a frame and their coverage.
#[derive(Clone, Copy, Debug, Default)]
struct Explained {
    known: usize,
    right: usize,
    /// One bit per grid cell.
    cells: u64,
}

impl Explained {
    fn is_enough(&self) -> bool {
        self.right >= MIN_POINTS
            && self.right as f64 >= MIN_CORRECT_RATIO * self.known as f64
            && f64::from(self.cells.count_ones()) >= MIN_COVERAGE * (CELLS.0 * CELLS.1) as f64
    }
}

/// Maximum angle, rad, between the anchor's ray of a point and the rays of the other frames that observe it.
fn widest_angle(table: &TrackTable, scene: &Scene, point: usize) -> Option<f64> {
    let seen = scene.points[point]?;
    let anchor = scene.poses[seen.anchor as usize]?;
    let ray = seen.direction();
    let angle = |pose: CameraPose| {
        let from_anchor = pose * anchor.inverse();
        (from_anchor.rotation * ray).angle(&seen.scaled_in(&pose, &anchor))
    };
    let poses = table.of_point(point).filter_map(|o| scene.poses[o.frame as usize]);
    Some(poses.map(angle).fold(0.0, f64::max))
}
