//! The points of the tracks in space.

use std::collections::HashMap;
use std::ops::Range;

use crate::motion::{ClipCameras, ClipMotion, FrameCamera, FrameScale};
use crate::track::Observation;
use plumbline_camera::Point3;
use plumbline_num::math::Point2;

/// Reprojection error, px at 640 px across, from which an observation is an outlier of its track's point: several standard
/// deviations of a track (a pixel or less).
const MAX_ERROR_PX: f64 = 3.0;

/// Points in space by their tracks.
pub(in crate::stabilize) struct ScenePoints<'a> {
    cameras: &'a ClipCameras,
    /// By segment, which has coordinates of its own, and track.
    by_track: HashMap<(u32, u32), Point3>,
    max_error_px: f64,
    scale: FrameScale,
}

impl<'a> ScenePoints<'a> {
    pub(in crate::stabilize) fn new(cameras: &'a ClipCameras, motion: &ClipMotion) -> Self {
        let by_track = cameras.points.iter().map(|p| ((p.shot, p.id), p.position)).collect();
        Self {
            cameras,
            by_track,
            max_error_px: MAX_ERROR_PX * f64::from(motion.width.max(motion.height)) / 640.0,
            scale: FrameScale::new(motion.width, motion.height),
        }
    }

    /// The point of an observation; `None` where it is unknown, or its reprojection error is too large. For a camera that only
    /// rotates, the point at unit depth in the direction of the observation.
    pub(in crate::stabilize) fn of(&self, frame: usize, seen: &Observation, rotation_only: bool) -> Option<Point3> {
        let camera = self.camera(frame)?;
        let src = Point2::new(f64::from(seen.x), f64::from(seen.y));
        if rotation_only {
            return viewing_direction(&camera, src);
        }
        let segment = self.cameras.segment_of(frame)? as u32;
        let point = *self.by_track.get(&(segment, seen.id))?;
        let error = camera.intrinsics.project(&camera.pose.apply(&point))? - src;
        (error.norm() <= self.max_error_px).then_some(point)
    }

    /// Units of the frame's coordinates.
    pub(super) fn scale(&self) -> FrameScale {
        self.scale
    }

    /// Ranges of frames that share coordinates in space.
    pub(super) fn segments(&self) -> impl Iterator<Item = &'a Range<usize>> {
        self.cameras.shots.iter().map(|s| &s.frames)
    }

    /// Whether a range with coordinates of its own begins at a frame.
    pub(super) fn starts_at(&self, frame: usize) -> bool {
        self.cameras.segment_of(frame).is_some_and(|k| self.cameras.shots[k].frames.start == frame)
    }

    /// The real camera of a frame.
    pub(in crate::stabilize) fn camera(&self, frame: usize) -> Option<FrameCamera> {
        self.cameras.frames.get(frame).copied().flatten()
    }
}

/// The viewing direction of a pixel: a point at unit depth for a camera in the world's origin.
pub(in crate::stabilize) fn viewing_direction(camera: &FrameCamera, pixel: Point2) -> Option<Point3> {
    let ray = camera.intrinsics.ray(pixel)?;
    Some(Point3::from(camera.pose.rotation.inverse() * ray))
}
