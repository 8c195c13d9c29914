//! The path file: where a person or another program wants the camera.
//!
//! ```json
//! { "wanted": [ { "time_s": 0.0, "q": [1,0,0,0], "t": [0,0,0] }, … ],
//!   "input":  [ { "q": [1,0,0,0], "t": [0,0,0] }, … ] }
//! ```
//!
//! Poses are `cam_from_world`, rotations a quaternion `q = [w, x, y, z]` or a matrix `R`. `input` holds the input's own
//! cameras, one per frame, in the same world: a similarity lays them over those that were recovered, and the wanted ones with
//! them. `wanted` has one pose per frame, or poses with times between which it is interpolated. `stable` and `shaky` are
//! understood for `wanted` and `input`.

use std::path::Path;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use serde::Deserialize;

use crate::camera::{CameraPose, Vec3, align};
use crate::motion::ClipCameras;
use crate::pipeline::run_error::RunError;

/// How far a rotation may be from one.
const SLACK: f64 = 1e-3;

#[derive(Deserialize)]
struct Document {
    #[serde(alias = "stable")]
    wanted: Vec<Entry>,
    #[serde(alias = "shaky")]
    input: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    #[serde(default)]
    time_s: Option<f64>,
    #[serde(default)]
    q: Option<[f64; 4]>,
    #[serde(default, rename = "R")]
    r: Option<[[f64; 3]; 3]>,
    t: [f64; 3],
}

/// The wanted cameras of every frame, in the coordinates of the recovered ones.
pub(super) struct WantedPath {
    pub(super) poses: Vec<Option<CameraPose>>,
    /// RMS distance of the input's cameras from the recovered ones, as a share of their path's length.
    pub(super) residual: f64,
}

/// Reads a path file for a clip whose frames are shown at `times_s`.
pub(super) fn read(path: &str, cameras: &ClipCameras, times_s: &[f64]) -> Result<WantedPath, RunError> {
    let bad = |what: String| RunError::Input(format!("{path}: {what}"));
    let bytes = std::fs::read(Path::new(path)).map_err(|e| bad(format!("cannot be read: {e}")))?;
    let document: Document = serde_json::from_slice(&bytes).map_err(|e| bad(format!("not a path file: {e}")))?;
    let poses = |name: &str, entries: &[Entry]| {
        let pose = |(k, e): (usize, &Entry)| e.pose().ok_or_else(|| bad(format!("{name}[{k}] is no pose")));
        entries.iter().enumerate().map(pose).collect::<Result<Vec<_>, _>>()
    };
    let (wanted, input) = (poses("wanted", &document.wanted)?, poses("input", &document.input)?);
    if input.len() != times_s.len() {
        return Err(bad(format!("input has {} cameras for {} frames; give one per frame", input.len(), times_s.len())));
    }
    let wanted = at_frames(&document.wanted, &wanted, times_s).map_err(bad)?;
    let known =
        |(given, found): (&CameraPose, &Option<crate::motion::FrameCamera>)| Some((*given, found.as_ref()?.pose));
    let pairs: Vec<_> = input.iter().zip(&cameras.frames).filter_map(known).collect();
    let (ours_from_file, rms) = align(&pairs)
        .ok_or_else(|| bad("the clip's cameras were not recovered, so nothing can be aligned".to_owned()))?;
    let length: f64 = pairs.windows(2).map(|w| (w[1].1.center() - w[0].1.center()).norm()).sum();
    let residual = if length > 0.0 { rms / length } else { 0.0 };
    Ok(WantedPath { poses: wanted.iter().map(|p| Some(ours_from_file.camera(p))).collect(), residual })
}

/// One pose per frame: as they are, or interpolated between their times.
fn at_frames(entries: &[Entry], poses: &[CameraPose], times_s: &[f64]) -> Result<Vec<CameraPose>, String> {
    let times: Option<Vec<f64>> = entries.iter().map(|e| e.time_s).collect();
    let Some(times) = times.filter(|t| !t.is_empty()) else {
        let (found, frames) = (poses.len(), times_s.len());
        let wrong = format!("wanted has {found} poses for {frames} frames; give one per frame, or `time_s` to each");
        return if found == frames { Ok(poses.to_vec()) } else { Err(wrong) };
    };
    if !times.windows(2).all(|w| w[0] < w[1]) {
        return Err("the times of wanted do not ascend".to_owned());
    }
    let start = times_s.first().copied().unwrap_or(0.0);
    let at = |time: &f64| {
        let time = time - start + times[0];
        let after = times.partition_point(|t| *t <= time).clamp(1, times.len().max(2) - 1);
        if times.len() == 1 {
            return poses[0];
        }
        let share = ((time - times[after - 1]) / (times[after] - times[after - 1])).clamp(0.0, 1.0);
        poses[after - 1].toward(&poses[after], share)
    };
    Ok(times_s.iter().map(at).collect())
}

impl Entry {
    fn pose(&self) -> Option<CameraPose> {
        let rotation = match (self.q, self.r) {
            (Some([w, x, y, z]), None) => {
                let q = Quaternion::new(w, x, y, z);
                ((q.norm() - 1.0).abs() <= SLACK).then(|| UnitQuaternion::new_normalize(q))?
            }
            (None, Some(r)) => {
                let m = Matrix3::from_fn(|i, j| r[i][j]);
                let off = (m * m.transpose() - Matrix3::identity()).amax();
                if !(off <= SLACK && m.determinant() > 0.0) {
                    return None;
                }
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m))
            }
            _ => return None,
        };
        let finite = self.t.iter().all(|v| v.is_finite()) && rotation.coords.iter().all(|v| v.is_finite());
        finite.then(|| CameraPose { rotation, translation: Vec3::from(self.t) })
    }
}
