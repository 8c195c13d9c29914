//! The plan of a clip in files: computed once, read by the processes that render parts of the clip.
//!
//! The motion is a motion file without points (`plumbline.motion`); path and models are the file of this module. Numbers are read back
//! to the bit, so that every frame gets the map that it would have got where the plan was made; [`PlanFile::new`] refuses a plan that
//! would not be. The file is no format for exchange, and is read by the program that wrote it.

use std::ops::Range;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::error::StabilizeError;
use super::frame_models::FrameModels;
use super::options::WarpOptions;
use crate::motion::{ClipMotion, MotionModel, SegmentVerdict};
use crate::path::{Segment, SegmentOutcome, VirtualCamera, VirtualPath};
use plumbline_camera::{CameraPose, Intrinsics, Vec3};
use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};

/// The name in a file's `format` field, and the only version.
const FORMAT: &str = "plumbline.clip_plan";
const VERSION: u32 = 1;

/// Path and motion models of a clip as data.
///
/// # Example
/// ```no_run
/// # use plumbline_video::stabilize::{PlanFile, RenderInputs, FrameModels, StabilizeError};
/// # fn example(inputs: &RenderInputs<'_>, models: &FrameModels) -> Result<(), StabilizeError> {
/// let text = PlanFile::new(inputs.path, models)?.to_json()?;
/// let (path, models) = PlanFile::from_json(&text)?.into_plan(inputs.motion, inputs.warp)?;
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanFile {
    format: String,
    version: u32,
    /// Per frame, row by row.
    out_from_src: Vec<[f64; 9]>,
    crop: Vec<f64>,
    cameras: Vec<Option<CameraEntry>>,
    segments: Vec<SegmentEntry>,
    models: Vec<ModelEntry>,
}

/// A virtual camera in space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct CameraEntry {
    /// Rotation `[w, x, y, z]`.
    q: [f64; 4],
    t: [f64; 3],
    /// Focal length, center and radial term.
    intrinsics: [f64; 4],
    /// `[a, b, t_x, t_y]`.
    correction: [f64; 4],
    rotation_only: bool,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct SegmentEntry {
    frames: Range<usize>,
    outcome: SegmentOutcome,
    reason: String,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct ModelEntry {
    frames: Range<usize>,
    model: MotionModel,
    reason: String,
}

fn invalid(fault: impl std::fmt::Display) -> StabilizeError {
    StabilizeError::Input(format!("not the plan of a clip: {fault}; plan it again"))
}

impl PlanFile {
    /// Of a path and the models of its frames.
    ///
    /// # Errors
    /// [`StabilizeError::Input`] for numbers that are not finite, which JSON does not have.
    pub fn new(path: &VirtualPath, models: &FrameModels) -> Result<Self, StabilizeError> {
        let segment =
            |s: &Segment| SegmentEntry { frames: s.frames.clone(), outcome: s.outcome, reason: s.reason.clone() };
        let model =
            |s: &SegmentVerdict| ModelEntry { frames: s.frames.clone(), model: s.model, reason: s.reason.clone() };
        let file = Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            out_from_src: path.out_from_src.iter().map(row_major).collect(),
            crop: path.crop.clone(),
            cameras: path.cameras.iter().map(|camera| camera.as_ref().map(CameraEntry::of)).collect(),
            segments: path.segments.iter().map(segment).collect(),
            models: models.segments().iter().map(model).collect(),
        };
        if file.numbers().all(|number| number.is_finite()) { Ok(file) } else { Err(invalid("a number is not finite")) }
    }

    fn numbers(&self) -> impl Iterator<Item = &f64> {
        let cameras = self.cameras.iter().flatten().flat_map(CameraEntry::numbers);
        self.out_from_src.iter().flatten().chain(&self.crop).chain(cameras)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: none is known.
    pub fn to_json(&self) -> Result<String, StabilizeError> {
        serde_json::to_string(self).map_err(invalid)
    }

    /// Reads the text of a file.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: no such file, or one whose segments are not those of its frames.
    pub fn from_json(text: &str) -> Result<Self, StabilizeError> {
        let file: Self = serde_json::from_str(text).map_err(invalid)?;
        if file.format != FORMAT || file.version != VERSION {
            return Err(invalid(format_args!("format {:?}, version {}", file.format, file.version)));
        }
        let frames = file.out_from_src.len();
        let cover = |mut parts: Box<dyn Iterator<Item = &Range<usize>> + '_>| {
            parts.try_fold(0, |end, part| (part.start == end && part.start <= part.end).then_some(part.end))
        };
        let segments = cover(Box::new(file.segments.iter().map(|s| &s.frames)));
        let models = cover(Box::new(file.models.iter().map(|s| &s.frames)));
        let lengths = file.crop.len() == frames && (file.cameras.is_empty() || file.cameras.len() == frames);
        if !lengths || segments != Some(frames) || models != Some(frames) {
            return Err(invalid("its parts are not of the same frames"));
        }
        Ok(file)
    }

    /// Path and models for the clip of `motion`; `None` where maps do without it.
    ///
    /// # Errors
    /// [`StabilizeError::Input`]: the motion of another clip.
    pub fn into_plan(
        self,
        motion: Option<&ClipMotion>,
        options: &WarpOptions,
    ) -> Result<(VirtualPath, FrameModels), StabilizeError> {
        if motion.is_some_and(|motion| motion.frames.len() != self.out_from_src.len()) {
            return Err(invalid("it has other frames than the motion"));
        }
        let segment = |s: SegmentEntry| Segment { frames: s.frames, outcome: s.outcome, reason: s.reason };
        let model = |s: ModelEntry| SegmentVerdict { frames: s.frames, model: s.model, reason: s.reason };
        let path = VirtualPath {
            out_from_src: self.out_from_src.iter().map(|m| Homography::new(Matrix3::from_row_slice(m))).collect(),
            crop: self.crop,
            cameras: self.cameras.iter().map(|camera| camera.as_ref().map(CameraEntry::camera)).collect(),
            segments: self.segments.into_iter().map(segment).collect(),
        };
        let mut models = FrameModels::new(options.mode, motion, &path);
        models.segments = self.models.into_iter().map(model).collect();
        Ok((path, models))
    }
}

fn row_major(h: &Homography) -> [f64; 9] {
    let m = h.matrix();
    std::array::from_fn(|k| m[(k / 3, k % 3)])
}

impl CameraEntry {
    fn of(camera: &VirtualCamera) -> Self {
        let VirtualCamera { pose, intrinsics: i, correction: c, rotation_only } = camera;
        let q = pose.rotation.quaternion();
        Self {
            q: [q.w, q.i, q.j, q.k],
            t: pose.translation.into(),
            intrinsics: [i.focal, i.center.x, i.center.y, i.k1],
            correction: [c.a, c.b, c.t.x, c.t.y],
            rotation_only: *rotation_only,
        }
    }

    fn camera(&self) -> VirtualCamera {
        let [w, i, j, k] = self.q;
        let [focal, x, y, k1] = self.intrinsics;
        let [a, b, t_x, t_y] = self.correction;
        // As it was: to normalize it again would change its last digits.
        let rotation = UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k));
        VirtualCamera {
            pose: CameraPose { rotation, translation: Vec3::from(self.t) },
            intrinsics: Intrinsics { focal, center: Point2::new(x, y), k1 },
            correction: Similarity2 { a, b, t: Vec2::new(t_x, t_y) },
            rotation_only: self.rotation_only,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &f64> {
        self.q.iter().chain(&self.t).chain(&self.intrinsics).chain(&self.correction)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> (VirtualPath, FrameModels) {
        let mut random = fastrand::Rng::with_seed(3);
        let mut number = || random.f64() - 0.3;
        let camera = VirtualCamera {
            pose: CameraPose {
                rotation: UnitQuaternion::from_euler_angles(number(), number(), number()),
                translation: Vec3::new(number(), number(), number()),
            },
            intrinsics: Intrinsics { focal: 500.0 / 3.0, center: Point2::new(number(), number()), k1: number() },
            correction: Similarity2 { a: number(), b: number(), t: Vec2::new(number(), number()) },
            rotation_only: true,
        };
        let path = VirtualPath {
            out_from_src: (0..6).map(|_| Homography::new(Matrix3::from_fn(|_, _| number()))).collect(),
            crop: (0..6).map(|_| number()).collect(),
            cameras: vec![None, Some(camera), None, None, Some(camera), None],
            segments: [0..4, 4..6]
                .map(|frames| Segment { frames, outcome: SegmentOutcome::Given, reason: "a \"reason\"".to_owned() })
                .to_vec(),
        };
        let mut models = FrameModels::new(crate::stabilize::ModelChoice::Mesh, None, &path);
        models.segments[1].model = MotionModel::Subspace;
        (path, models)
    }

    #[test]
    fn a_plan_is_read_back_to_the_bit() {
        let (path, models) = plan();
        let text = PlanFile::new(&path, &models).expect("finite").to_json().expect("plain data");
        let options = WarpOptions { mode: crate::stabilize::ModelChoice::Mesh, ..WarpOptions::default() };
        let (path_read, models_read) =
            PlanFile::from_json(&text).expect("its own").into_plan(None, &options).expect("whole");
        assert_eq!(format!("{path_read:?}"), format!("{path:?}"));
        assert_eq!(format!("{models_read:?}"), format!("{models:?}"));
        let entries =
            |path: &VirtualPath| path.out_from_src.iter().flat_map(row_major).map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(entries(&path_read), entries(&path));
    }

    #[test]
    fn damaged_plans_are_refused() {
        let (mut path, models) = plan();
        let text = PlanFile::new(&path, &models).expect("finite").to_json().expect("plain data");
        for (from, to) in [
            ("plumbline.clip_plan", "plumbline.motion"),
            ("\"version\":1", "\"version\":2"),
            ("\"start\":4,\"end\":6", "\"start\":4,\"end\":7"),
            ("\"start\":0,\"end\":4", "\"start\":0,\"end\":3"),
            ("\"crop\":[", "\"crop\":[1.0,"),
            ("\"cameras\":[null,", "\"cameras\":["),
        ] {
            assert!(text.contains(from), "{from}");
            let error = PlanFile::from_json(&text.replace(from, to)).expect_err(from).to_string();
            assert!(error.starts_with("not the plan of a clip: "), "{error}");
        }
        path.crop[2] = f64::NAN;
        assert!(PlanFile::new(&path, &models).is_err());
    }
}
