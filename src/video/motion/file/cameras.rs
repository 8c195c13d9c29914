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

use std::io::Write;

use serde::{Deserialize, Serialize};

use super::{MotionFileError, value, write_block};
use crate::motion::cameras::{ClipCameras, FrameCamera, ShotCameras, WorldPoint};
use crate::motion::exchange::colmap::rotation_of;
use crate::motion::sfm::{SfmFigures, SfmVerdict};
use plumbline_camera::{CameraPose, Intrinsics, Point3, Vec3};
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
    write_block(
        out,
        "points",
        cameras.points.iter().map(|p| PointEntry { shot: p.shot, id: p.id, at: p.position.into() }),
    )?;
    write_block(
        out,
        "reconstruction",
        cameras.shots.iter().map(|s| ShotEntry {
            frames: [s.frames.start, s.frames.end],
            verdict: s.verdict,
            reason: s.reason.clone(),
            figures: s.figures,
        }),
    )
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
