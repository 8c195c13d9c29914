//! The blocks of a motion file with cameras in space.
//!
//! ```json
//! "cameras": [ { "q": [1,0,0,0], "t": [0,0,0], "focal": 576, "center": [320,180], "k1": 0 }, …, null ],
//! "points": [ { "shot": 0, "id": 17, "at": [0.3, -0.1, 2.5] }, … ],
//! "reconstruction": [ { "frames": [0, 150], "verdict": "3d", "reason": "…", "figures": { … } }, … ]
//! ```
//!
//! `cameras[k]` is the pose of frame `k`, `x_in_camera = R(q) x + t` with `q = [w, x, y, z]`, in the coordinates and the unit
//! of its shot, and the lens in px; `null` where no camera is known. Each block may be left out.

use std::io::{Read, Seek, Write};

use serde::{Deserialize, Serialize};

use super::{MotionFileError, VERSION, value, write_block};
use crate::motion::cameras::{ClipCameras, FrameCamera, ShotCameras, WindowCameras, WorldPoint};
use crate::motion::exchange::colmap::rotation_of;
use crate::motion::sfm::{Segment, SfmFigures, SfmVerdict};
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
use plumbline_num::document::Kind;
use plumbline_num::math::Point2;

/// The blocks, as far as a file has them.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct InSpace {
    /// Per frame its camera.
    #[cfg_attr(feature = "schema", schemars(default))]
    pub(super) cameras: Option<Vec<Option<CameraEntry>>>,
    /// Still points.
    #[cfg_attr(feature = "schema", schemars(default))]
    pub(super) points: Option<Vec<PointEntry>>,
    /// Per shot the verdict on its cameras.
    #[cfg_attr(feature = "schema", schemars(default))]
    pub(super) reconstruction: Option<Vec<ShotEntry>>,
}

/// A camera.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct CameraEntry {
    /// Rotation world to camera, `[w, x, y, z]`.
    q: [f64; 4],
    /// Translation world to camera.
    t: [f64; 3],
    /// Focal length, px.
    focal: f64,
    /// Center of projection, px.
    center: [f64; 2],
    /// First radial term.
    #[serde(default)]
    k1: f64,
}

/// A point.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct PointEntry {
    /// Index of its shot.
    shot: u32,
    /// Its track.
    id: u32,
    /// Position in the coordinates of the shot.
    at: [f64; 3],
}

/// A shot.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct ShotEntry {
    /// First frame, and the one after the last.
    frames: [usize; 2],
    /// Kind of motion that the tracks support.
    verdict: SfmVerdict,
    /// Reason.
    reason: String,
    /// Quality figures.
    figures: SfmFigures,
}

/// Writes the blocks.
pub(super) fn write(out: &mut impl Write, cameras: &ClipCameras) -> Result<(), MotionFileError> {
    write_block(out, "cameras", cameras.frames.iter().map(|c| c.map(CameraEntry::from)))?;
    write_block(out, "points", cameras.points.iter().copied().map(PointEntry::from))?;
    write_block(out, "reconstruction", cameras.shots.iter().map(ShotEntry::from))
}

impl InSpace {
    /// Refuses invalid cameras.
    pub(super) fn check(&self, frames: usize) -> Result<(), MotionFileError> {
        if let Some(found) = self.cameras.as_ref().map(Vec::len).filter(|n| *n != frames) {
            return Err(MotionFileError::Length { block: "cameras", found, frames });
        }
        for (k, camera) in self.cameras.iter().flatten().enumerate() {
            camera.map_or(Ok(()), |c| c.check(k))?;
        }
        for (k, point) in self.points.iter().flatten().enumerate() {
            if !point.at.iter().all(|v| v.is_finite()) {
                return Err(value(format!("points[{k}].at"), format!("{:?}", point.at), "finite numbers"));
            }
        }
        for (k, shot) in self.reconstruction.iter().flatten().enumerate() {
            if !(shot.frames[0] <= shot.frames[1] && shot.frames[1] <= frames) {
                return Err(value(
                    format!("reconstruction[{k}].frames"),
                    format!("{:?}", shot.frames),
                    "frames of the clip",
                ));
            }
        }
        Ok(())
    }

    /// The cameras of the blocks; image coordinates are shifted by `shift` px.
    pub(super) fn into_cameras(self, shift: f64) -> Option<ClipCameras> {
        let frames = self.cameras?;
        let shot = |s: ShotEntry| ShotCameras {
            frames: s.frames[0]..s.frames[1],
            verdict: s.verdict,
            reason: s.reason,
            figures: s.figures,
        };
        let point = |p: PointEntry| WorldPoint { shot: p.shot, id: p.id, position: Point3::from(p.at) };
        Some(ClipCameras {
            frames: frames.into_iter().map(|c| c.map(|c| c.camera(shift))).collect(),
            points: self.points.into_iter().flatten().map(point).collect(),
            shots: self.reconstruction.into_iter().flatten().map(shot).collect(),
        })
    }
}

/// Cameras alone, for a later run on the same tracks.
const CAMERAS: Kind = Kind { name: "a file of cameras", format: "plumbline.cameras", max_bytes: 1 << 32 };
/// Cameras of windows, for the task that joins them.
const WINDOWS: Kind =
    Kind { name: "a file of cameras of windows", format: "plumbline.window_cameras", max_bytes: 1 << 32 };

/// A file of cameras.
#[derive(Serialize, Deserialize)]
struct CamerasFile {
    format: String,
    version: u32,
    found: Found,
}

/// A file of the cameras of windows.
#[derive(Serialize, Deserialize)]
struct WindowsFile {
    format: String,
    version: u32,
    windows: Vec<WindowEntry>,
}

/// A window. Frames of its segments count from its first one.
#[derive(Serialize, Deserialize)]
struct WindowEntry {
    /// First frame, and the one after the last.
    frames: [usize; 2],
    found: Found,
}

/// The blocks of a motion file with cameras, all of them there.
#[derive(Serialize, Deserialize)]
struct Found {
    cameras: Vec<Option<CameraEntry>>,
    points: Vec<PointEntry>,
    reconstruction: Vec<ShotEntry>,
}

impl ClipCameras {
    /// The cameras, points and verdicts as JSON: the blocks of a motion file alone. [`Self::from_json`] restores them bit for bit, if all
    /// numbers are finite.
    ///
    /// # Errors
    /// [`MotionFileError::Io`]: none is known.
    pub fn to_json(&self) -> Result<String, MotionFileError> {
        let file = CamerasFile { format: CAMERAS.format.to_owned(), version: VERSION, found: self.into() };
        Ok(serde_json::to_string(&file).map_err(std::io::Error::from)?)
    }

    /// The cameras of [`Self::to_json`].
    ///
    /// # Errors
    /// [`MotionFileError`]: not JSON, another format or version, a value out of range, a number of a frame or a shot out of range.
    pub fn from_json(text: &str) -> Result<Self, MotionFileError> {
        CAMERAS.parse::<CamerasFile>(text)?.found.cameras()
    }
}

impl WindowCameras {
    /// Windows as JSON. [`Self::from_json`] restores them bit for bit, if all numbers are finite.
    ///
    /// # Errors
    /// [`MotionFileError::Io`]: none is known.
    pub fn to_json(windows: &[Self]) -> Result<String, MotionFileError> {
        let entry = |window: &Self| {
            let mut found = ClipCameras::default();
            for segment in &window.segments {
                let inside = |frame: usize| frame - window.frames.start;
                let frames = inside(segment.frames.start)..inside(segment.frames.end);
                found.push(Segment { frames, ..segment.clone() });
            }
            WindowEntry { frames: [window.frames.start, window.frames.end], found: (&found).into() }
        };
        let windows = windows.iter().map(entry).collect();
        let file = WindowsFile { format: WINDOWS.format.to_owned(), version: VERSION, windows };
        Ok(serde_json::to_string(&file).map_err(std::io::Error::from)?)
    }

    /// The windows of [`Self::to_json`].
    ///
    /// # Errors
    /// [`MotionFileError`], as for [`ClipCameras::from_json`]; segments that do not follow each other, or do not cover their window.
    pub fn from_json(text: &str) -> Result<Vec<Self>, MotionFileError> {
        WINDOWS.parse::<WindowsFile>(text)?.windows()
    }

    /// [`Self::from_json`] from a file, which is not held in memory.
    ///
    /// # Errors
    /// As there; [`MotionFileError::Io`].
    pub fn read_json(file: impl Read + Seek) -> Result<Vec<Self>, MotionFileError> {
        WINDOWS.stream::<WindowsFile>(file)?.windows()
    }
}

impl WindowsFile {
    fn windows(self) -> Result<Vec<WindowCameras>, MotionFileError> {
        self.windows.into_iter().enumerate().map(|(k, entry)| entry.window(k)).collect()
    }
}

impl WindowEntry {
    /// The window, which is number `k` of its file.
    fn window(self, k: usize) -> Result<WindowCameras, MotionFileError> {
        let [start, end] = self.frames;
        let ClipCameras { mut frames, points, shots } = self.found.cameras()?;
        let covered = shots.iter().try_fold(0, |at, shot| (shot.frames.start == at).then_some(shot.frames.end));
        if end.checked_sub(start) != Some(frames.len()) || covered != Some(frames.len()) {
            let expected = "segments that cover a window, one behind the other";
            return Err(value(format!("windows[{k}].frames"), format!("{:?}", self.frames), expected));
        }
        let mut of_shot: Vec<Vec<(u32, Point3)>> = vec![Vec::new(); shots.len()];
        for point in points {
            of_shot[point.shot as usize].push((point.id, point.position));
        }
        let segment = |(shot, points): (ShotCameras, Vec<(u32, Point3)>)| {
            let ShotCameras { frames: inside, verdict, reason, figures } = shot;
            let cameras = frames.drain(..inside.len()).collect();
            Segment { frames: start + inside.start..start + inside.end, cameras, points, verdict, reason, figures }
        };
        let segments = shots.into_iter().zip(of_shot).map(segment).collect();
        Ok(WindowCameras { frames: start..end, segments })
    }
}

impl From<&ClipCameras> for Found {
    fn from(cameras: &ClipCameras) -> Self {
        Self {
            cameras: cameras.frames.iter().map(|c| c.map(CameraEntry::from)).collect(),
            points: cameras.points.iter().copied().map(PointEntry::from).collect(),
            reconstruction: cameras.shots.iter().map(ShotEntry::from).collect(),
        }
    }
}

impl Found {
    /// The cameras, checked.
    fn cameras(self) -> Result<ClipCameras, MotionFileError> {
        let Self { cameras, points, reconstruction } = self;
        let (frames, shots) = (cameras.len(), reconstruction.len());
        if let Some(k) = points.iter().position(|point| point.shot as usize >= shots) {
            return Err(value(format!("points[{k}].shot"), points[k].shot, "a shot of the reconstruction"));
        }
        let blocks = InSpace { cameras: Some(cameras), points: Some(points), reconstruction: Some(reconstruction) };
        blocks.check(frames)?;
        Ok(blocks.into_cameras(0.0).unwrap_or_default())
    }
}

impl From<WorldPoint> for PointEntry {
    fn from(point: WorldPoint) -> Self {
        Self { shot: point.shot, id: point.id, at: point.position.into() }
    }
}

impl From<&ShotCameras> for ShotEntry {
    fn from(shot: &ShotCameras) -> Self {
        Self {
            frames: [shot.frames.start, shot.frames.end],
            verdict: shot.verdict,
            reason: shot.reason.clone(),
            figures: shot.figures,
        }
    }
}

impl From<FrameCamera> for CameraEntry {
    fn from(camera: FrameCamera) -> Self {
        let (q, i) = (camera.pose.rotation, camera.intrinsics);
        Self {
            q: [q.w, q.i, q.j, q.k],
            t: camera.pose.translation.into(),
            focal: i.focal,
            center: [i.center.x, i.center.y],
            k1: i.k1,
        }
    }
}

impl CameraEntry {
    fn check(&self, k: usize) -> Result<(), MotionFileError> {
        if rotation_of(self.q).is_none() {
            return Err(value(format!("cameras[{k}].q"), format!("{:?}", self.q), "a quaternion of length 1"));
        }
        if !(self.focal > 0.0 && self.focal.is_finite()) {
            return Err(value(format!("cameras[{k}].focal"), self.focal, "above 0 px"));
        }
        if !self.t.iter().chain(&self.center).chain([&self.k1]).all(|v| v.is_finite()) {
            return Err(value(format!("cameras[{k}]"), format!("{self:?}"), "finite numbers"));
        }
        Ok(())
    }

    fn camera(&self, shift: f64) -> FrameCamera {
        let rotation = rotation_of(self.q).expect("checked");
        let center = Point2::new(self.center[0] + shift, self.center[1] + shift);
        FrameCamera {
            pose: CameraPose { rotation, translation: Vec3::from(self.t) },
            intrinsics: Intrinsics { focal: self.focal, center, k1: self.k1 },
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;

    fn cameras() -> ClipCameras {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut number = move || 2.0 * rng.f64() - 1.0;
        let mut camera = |frame: usize| {
            let axis = Vec3::new(number(), number(), number());
            let rotation = UnitQuaternion::from_scaled_axis(axis) * UnitQuaternion::from_scaled_axis(2.0 * axis);
            let pose = CameraPose { rotation, translation: Vec3::new(number(), -0.0, number() * 1e-300) };
            let intrinsics = Intrinsics { focal: 600.0 + number(), center: Point2::new(320.0, 180.0), k1: number() };
            (frame != 2).then_some(FrameCamera { pose, intrinsics })
        };
        let frames: Vec<_> = (0..50).map(&mut camera).collect();
        let position = Point3::new(1.0 / 3.0, 1e17, -0.1);
        let figures = SfmFigures { registered: 3, reprojection_px: 0.1 + 0.2, ..SfmFigures::default() };
        let shot = |frames, verdict| ShotCameras { frames, verdict, reason: "seen \"well\"".to_owned(), figures };
        ClipCameras {
            frames,
            points: vec![WorldPoint { shot: 1, id: 7, position }],
            shots: vec![shot(0..2, SfmVerdict::Failed), shot(2..50, SfmVerdict::ThreeD)],
        }
    }

    #[test]
    fn cameras_come_back_bit_for_bit_from_their_file() {
        let cameras = cameras();
        let text = cameras.to_json().expect("finite");
        let again = ClipCameras::from_json(&text).expect("just written");
        assert_eq!(again, cameras);
        assert_eq!(again.to_json().expect("finite"), text);
    }

    fn windows() -> Vec<WindowCameras> {
        let ClipCameras { frames, shots, .. } = cameras();
        let segment = |shot: &ShotCameras, points| Segment {
            frames: 600 + shot.frames.start..600 + shot.frames.end,
            cameras: frames[shot.frames.clone()].to_vec(),
            points,
            verdict: shot.verdict,
            reason: shot.reason.clone(),
            figures: shot.figures,
        };
        let points = vec![(3, Point3::new(0.1, -2.0, 1.0 / 3.0)), (9, Point3::new(1e-9, 0.0, 5.0))];
        let first =
            WindowCameras { frames: 0..4, segments: vec![Segment::unknown(0..4, SfmVerdict::Zoom, String::new())] };
        let second = vec![segment(&shots[0], Vec::new()), segment(&shots[1], points)];
        vec![first, WindowCameras { frames: 600..650, segments: second }]
    }

    #[test]
    fn windows_come_back_bit_for_bit_from_their_file() {
        let windows = windows();
        let text = WindowCameras::to_json(&windows).expect("finite");
        assert_eq!(WindowCameras::from_json(&text).expect("just written"), windows);
        let file = std::io::Cursor::new(text);
        assert_eq!(WindowCameras::read_json(file).expect("just written"), windows);
        assert_eq!(WindowCameras::from_json(&WindowCameras::to_json(&[]).expect("empty")).expect("empty"), []);
    }

    #[test]
    fn windows_that_their_segments_do_not_cover_are_refused() {
        let text = WindowCameras::to_json(&windows()).expect("finite");
        for (from, to, expected) in [
            ("\"frames\":[600,650]", "\"frames\":[600,651]", "windows[1].frames"),
            ("\"frames\":[600,650]", "\"frames\":[650,600]", "windows[1].frames"),
            ("\"frames\":[2,50]", "\"frames\":[3,50]", "windows[1].frames"),
            ("\"frames\":[2,50]", "\"frames\":[2,49]", "windows[1].frames"),
            ("\"frames\":[2,50]", "\"frames\":[2,9000000000]", "reconstruction[1].frames"),
            ("\"shot\":1", "\"shot\":2", "points[0].shot"),
            ("plumbline.window_cameras", "plumbline.cameras", "plumbline.window_cameras"),
        ] {
            assert!(text.contains(from), "{from}");
            let fault = WindowCameras::from_json(&text.replacen(from, to, 1)).expect_err(to).to_string();
            assert!(fault.contains(expected), "{to}: {fault}");
        }
    }

    #[test]
    fn a_damaged_file_of_cameras_is_refused() {
        let text = cameras().to_json().expect("finite");
        for (from, to, expected) in [
            ("\"frames\":[0,2]", "\"frames\":[0,51]", "reconstruction[0].frames"),
            ("\"shot\":1", "\"shot\":2", "points[0].shot"),
            ("plumbline.cameras", "plumbline.motion", "plumbline.cameras"),
            ("\"version\":1", "\"version\":2", "version 2"),
            ("\"focal\":", "\"focal\":-", "cameras[0].focal"),
        ] {
            assert!(text.contains(from), "{from}");
            let fault = ClipCameras::from_json(&text.replacen(from, to, 1)).expect_err(to).to_string();
            assert!(fault.contains(expected), "{to}: {fault}");
        }
    }
}
