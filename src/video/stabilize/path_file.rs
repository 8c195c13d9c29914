//! The path file: the target poses of the virtual camera, by a person or another program.
//!
//! ```json
//! { "wanted": [ { "time_s": 0.0, "q": [1,0,0,0], "t": [0,0,0] }, … ],
//!   "input":  [ { "q": [1,0,0,0], "t": [0,0,0] }, … ] }
//! ```
//!
//! Poses are `cam_from_world`, rotations a quaternion `q = [w, x, y, z]` or a matrix `R`. `input` holds the input's own
//! cameras `I_t`, one per frame, in the same world: a similarity aligns them with those that were recovered, `P_t`, and the wanted
//! ones `W_t` with them. The remainder is the drift of the recovered cameras, which the points recovered with them share; so the
//! virtual cameras follow it,
//!
//! ```text
//! V_t = W_t Ē_t,      Ē: low-pass of E_t = I_t⁻¹ P_t
//! ```
//!
//! (the low-pass, since the errors of single frames would shake the path). `wanted` has one pose per frame, or poses with times
//! between which it is interpolated. `stable` and `shaky` are accepted for `wanted` and `input`.

use std::path::Path;

use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion};
use serde::Deserialize;

use super::error::StabilizeError;
use crate::motion::{ClipCameras, FrameCamera};
use crate::path::smoothed_poses;
use plumbline_camera::{CameraPose, Vec3, align};
use plumbline_num::document::read_bounded;

/// Deviation from orthonormality up to which a rotation is accepted: files with four digits pass, a matrix that contains a scale
/// does not.
const MAX_DEVIATION: f64 = 1e-3;

/// Standard deviation, s, of the low-pass over the drift: faster errors of recovered cameras would appear as shake. It is that
/// of point trajectories.
const DRIFT_S: f64 = 0.25;

/// Largest file that is read, bytes: six hours at 60 frames per second, with all digits.
const MAX_BYTES: u64 = 1 << 29;

/// Latest time, s, and largest coordinate of a translation, units of the file: beyond, differences lose their digits.
const MAX_TIME_S: f64 = 1e9;
const MAX_TRANSLATION: f64 = 1e12;

/// A path file: the target poses of the camera.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Document {
    /// The wanted cameras: one per frame, or with times between which they are interpolated.
    #[serde(alias = "stable")]
    wanted: Vec<Entry>,
    /// The input's own cameras in the same world, one per frame.
    #[serde(alias = "shaky")]
    input: Vec<Entry>,
}

/// A pose `cam_from_world`, its rotation as a quaternion or a matrix.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Entry {
    /// Time of the pose, s.
    #[serde(default)]
    time_s: Option<f64>,
    /// Rotation `[w, x, y, z]`.
    #[serde(default)]
    q: Option<[f64; 4]>,
    /// Rotation matrix, row by row.
    #[serde(default, rename = "R")]
    r: Option<[[f64; 3]; 3]>,
    /// Translation.
    t: [f64; 3],
}

/// The JSON schema of the path file.
#[cfg(feature = "schema")]
pub fn path_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

/// The target cameras of every frame, in the coordinates of the recovered ones.
pub(super) struct AlignedPath {
    pub(super) poses: Vec<Option<CameraPose>>,
    /// RMS distance of the input's cameras from the recovered ones, as a fraction of their path's length.
    pub(super) residual: f64,
}

/// The poses of a path file, in the coordinates of its author.
#[derive(Clone, Debug, PartialEq)]
pub struct PathFile {
    /// Times of the target poses, s, ascending; `None`: one pose per frame.
    times_s: Option<Vec<f64>>,
    wanted: Vec<CameraPose>,
    input: Vec<CameraPose>,
}

impl PathFile {
    /// Reads the bytes of a path file.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: not such a file, an entry that is no pose, times out of order.
    pub fn parse(bytes: &[u8]) -> Result<Self, StabilizeError> {
        let bad = |reason: String| StabilizeError::Input(reason);
        let document: Document = serde_json::from_slice(bytes).map_err(|e| bad(format!("not a path file: {e}")))?;
        let poses = |name: &str, entries: &[Entry]| {
            let pose = |(k, e): (usize, &Entry)| e.pose().ok_or_else(|| bad(format!("{name}[{k}] is no pose")));
            entries.iter().enumerate().map(pose).collect::<Result<Vec<_>, _>>()
        };
        let (wanted, input) = (poses("wanted", &document.wanted)?, poses("input", &document.input)?);
        let times: Option<Vec<f64>> = document.wanted.iter().map(|e| e.time_s).collect();
        let times_s = times.filter(|t| !t.is_empty());
        if let Some(time) = times_s.iter().flatten().find(|t| t.abs() > MAX_TIME_S) {
            return Err(bad(format!("a time of wanted is {time} s (expected up to {MAX_TIME_S})")));
        }
        if times_s.as_ref().is_some_and(|times| !times.windows(2).all(|w| w[0] < w[1])) {
            return Err(bad("the times of wanted are not in ascending order".to_owned()));
        }
        Ok(Self { times_s, wanted, input })
    }

    /// The target poses and the input's own ones for a clip whose frames are shown at `times_s`.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: not as many poses as the clip has frames.
    pub fn at_frames(&self, times_s: &[f64]) -> Result<(Vec<CameraPose>, &[CameraPose]), StabilizeError> {
        let (found, frames) = (self.input.len(), times_s.len());
        if found != frames {
            let wrong = format!("input has {found} cameras for {frames} frames; give one per frame");
            return Err(StabilizeError::Input(wrong));
        }
        let wanted = match &self.times_s {
            Some(times) => interpolated(times, &self.wanted, times_s),
            None if self.wanted.len() == frames => self.wanted.clone(),
            None => {
                let found = self.wanted.len();
                let wrong =
                    format!("wanted has {found} poses for {frames} frames; give one per frame, or `time_s` to each");
                return Err(StabilizeError::Input(wrong));
            }
        };
        Ok((wanted, &self.input))
    }
}

/// Reads a path file for a clip whose frames are shown at `times_s`.
pub(super) fn read(path: &Path, cameras: &ClipCameras, times_s: &[f64]) -> Result<AlignedPath, StabilizeError> {
    let bad = |reason: String| StabilizeError::Input(format!("{}: {reason}", path.display()));
    let named = |error: StabilizeError| bad(error.to_string());
    let bytes = read_bounded(path, MAX_BYTES).map_err(|e| bad(format!("cannot be read: {e}")))?;
    let file = PathFile::parse(&bytes).map_err(named)?;
    let (wanted, input) = file.at_frames(times_s).map_err(named)?;
    let known = |(given, found): (&CameraPose, &Option<FrameCamera>)| Some((*given, found.as_ref()?.pose));
    let pairs: Vec<_> = input.iter().zip(&cameras.frames).filter_map(known).collect();
    let (ours_from_file, rms) = align(&pairs)
        .ok_or_else(|| bad("the clip's cameras were not recovered, so nothing can be aligned".to_owned()))?;
    let length: f64 = pairs.windows(2).map(|w| (w[1].1.center() - w[0].1.center()).norm()).sum();
    let residual = if length > 0.0 { rms / length } else { 0.0 };
    let aligned = |poses: &[CameraPose]| poses.iter().map(|p| ours_from_file.camera(p)).collect::<Vec<_>>();
    let (mut poses, input) = (aligned(&wanted), aligned(input));
    let found: Vec<_> = cameras.frames.iter().map(|c| c.map(|c| c.pose)).collect();
    for segment in cameras.shots.iter().map(|s| s.frames.clone()) {
        let (input, found) = (&input[segment.clone()], &found[segment.clone()]);
        follow_drift(&mut poses[segment.clone()], input, found, &times_s[segment]);
    }
    Ok(AlignedPath { poses: poses.into_iter().map(Some).collect(), residual })
}

/// `W_t ← W_t Ē_t` over a segment: `input` as it was given, `found` as it was recovered.
fn follow_drift(wanted: &mut [CameraPose], input: &[CameraPose], found: &[Option<CameraPose>], times_s: &[f64]) {
    let drift: Vec<_> = input.iter().zip(found).map(|(i, found)| found.map(|p| i.inverse() * p)).collect();
    for (wanted, drift) in wanted.iter_mut().zip(smoothed_poses(times_s, &drift, DRIFT_S)) {
        *wanted = drift.map_or(*wanted, |drift| *wanted * drift);
    }
}

/// One pose per frame, interpolated between the times of the poses, the first of which is that of the first frame.
fn interpolated(times: &[f64], poses: &[CameraPose], times_s: &[f64]) -> Vec<CameraPose> {
    let start = times_s.first().copied().unwrap_or(0.0);
    let at = |time: &f64| {
        let time = time - start + times[0];
        let after = times.partition_point(|t| *t <= time).clamp(1, times.len().max(2) - 1);
        if times.len() == 1 {
            return poses[0];
        }
        let fraction = ((time - times[after - 1]) / (times[after] - times[after - 1])).clamp(0.0, 1.0);
        poses[after - 1].toward(&poses[after], fraction)
    };
    times_s.iter().map(at).collect()
}

impl Entry {
    fn pose(&self) -> Option<CameraPose> {
        let rotation = match (self.q, self.r) {
            (Some([w, x, y, z]), None) => {
                let q = Quaternion::new(w, x, y, z);
                ((q.norm() - 1.0).abs() <= MAX_DEVIATION).then(|| UnitQuaternion::new_normalize(q))?
            }
            (None, Some(r)) => {
                let m = Matrix3::from_fn(|i, j| r[i][j]);
                let off = (m * m.transpose() - Matrix3::identity()).amax();
                if !(off <= MAX_DEVIATION && m.determinant() > 0.0) {
                    return None;
                }
                UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m))
            }
            _ => return None,
        };
        let finite = self.t.iter().all(|v| v.abs() <= MAX_TRANSLATION) && rotation.coords.iter().all(|v| v.is_finite());
        finite.then(|| CameraPose { rotation, translation: Vec3::from(self.t) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::Point3;

    const FRAMES: usize = 120;

    fn times_s() -> Vec<f64> {
        (0..FRAMES).map(|t| t as f64 / 30.0).collect()
    }

    /// Cameras that pan and walk, shaken where asked.
    fn cameras(shake: f64) -> Vec<CameraPose> {
        let mut random = fastrand::Rng::with_seed(4);
        let mut noise = move || shake * (random.f64() - 0.5);
        let camera = |s: f64| {
            let rotation = Vec3::new(0.1 * s.sin() + noise(), 0.2 * s + noise(), noise());
            let center = Point3::new(s + noise(), 0.3 * (0.5 * s).cos() + noise(), noise());
            CameraPose::looking_from(center, UnitQuaternion::from_scaled_axis(rotation))
        };
        times_s().into_iter().map(camera).collect()
    }

    /// Distance of two cameras, in rotation and position.
    fn apart(a: &CameraPose, b: &CameraPose) -> f64 {
        a.rotation.angle_to(&b.rotation) + (a.center() - b.center()).norm()
    }

    /// The drift of a recovered world at a time.
    fn drift(s: f64) -> CameraPose {
        let rotation = UnitQuaternion::from_scaled_axis(Vec3::new(0.004 * s, -0.01 * s, 0.003 * (0.4 * s).sin()));
        CameraPose { rotation, translation: Vec3::new(0.02 * s, 0.0, -0.01 * s) }
    }

    #[test]
    fn a_virtual_camera_relates_to_the_recovered_one_as_the_target_to_the_input() {
        let (input, wanted) = (cameras(0.05), cameras(0.0));
        let found: Vec<_> = input.iter().zip(times_s()).map(|(i, s)| Some(*i * drift(s))).collect();
        let mut followed = wanted.clone();
        follow_drift(&mut followed, &input, &found, &times_s());
        let (mut worst, mut left) = (0.0_f64, 0.0_f64);
        for t in 0..FRAMES {
            let (real, asked) = (found[t].expect("known").inverse(), wanted[t] * input[t].inverse());
            worst = worst.max(apart(&(followed[t] * real), &asked));
            left = left.max(apart(&(wanted[t] * real), &asked));
        }
        assert!(worst < 1e-3 && left > 0.05, "{worst} with the drift, {left} without");
    }

    #[test]
    fn errors_of_single_frames_do_not_shake_the_path() {
        let (input, wanted) = (cameras(0.0), cameras(0.0));
        let found: Vec<_> = cameras(0.01).into_iter().map(Some).collect();
        let mut followed = wanted.clone();
        follow_drift(&mut followed, &input, &found, &times_s());
        let step = |path: &[CameraPose]| {
            let miss = |t: usize| apart(&(path[t] * path[t - 1].inverse()), &(wanted[t] * wanted[t - 1].inverse()));
            (1..FRAMES).map(miss).sum::<f64>() / (FRAMES - 1) as f64
        };
        let found: Vec<_> = found.into_iter().flatten().collect();
        assert!(step(&followed) < 0.1 * step(&found), "{} of {}", step(&followed), step(&found));
    }

    #[test]
    fn frames_without_a_camera_keep_the_target() {
        let (input, wanted) = (cameras(0.0), cameras(0.0));
        let mut followed = wanted.clone();
        follow_drift(&mut followed, &input, &[None; FRAMES], &times_s());
        assert_eq!(followed, wanted);
    }
}
