//! Where the points of the tracks are in space.

use std::collections::HashMap;
use std::ops::Range;

use plumbline_camera::Point3;
use plumbline_num::math::Point2;
use plumbline_video::motion::{ClipCameras, ClipMotion, FrameCamera, FrameScale};
use plumbline_video::track::Observation;

/// Distance, px at 640 px across, at which a sighting is not one of the point that its track stands for.
const WRONG_PX: f64 = 3.0;

/// Points in space by their tracks.
pub(in crate::pipeline::stages) struct Places<'a> {
    cameras: &'a ClipCameras,
    /// By segment, which has coordinates of its own, and track.
    by_track: HashMap<(u32, u32), Point3>,
    wrong_px: f64,
    scale: FrameScale,
}

impl<'a> Places<'a> {
    pub(in crate::pipeline::stages) fn new(cameras: &'a ClipCameras, motion: &ClipMotion) -> Self {
        let by_track = cameras.points.iter().map(|p| ((p.shot, p.id), p.place)).collect();
        Self {
            cameras,
            by_track,
            wrong_px: WRONG_PX * f64::from(motion.width.max(motion.height)) / 640.0,
            scale: FrameScale::new(motion.width, motion.height),
        }
    }

    /// Where the point of a sighting is; `None` where that is not known, or the frame's camera sees it elsewhere. For a camera
    /// that only `turns`, a point in the direction of the sighting is as good as any other there.
    pub(in crate::pipeline::stages) fn of(&self, frame: usize, seen: &Observation, turns: bool) -> Option<Point3> {
        let camera = self.camera(frame)?;
        let src = Point2::new(f64::from(seen.x), f64::from(seen.y));
        if turns {
            return direction(&camera, src);
        }
        let segment = self.cameras.segment_of(frame)? as u32;
        let place = *self.by_track.get(&(segment, seen.id))?;
        let miss = camera.intrinsics.project(&camera.pose.apply(&place))? - src;
        (miss.norm() <= self.wrong_px).then_some(place)
    }

    /// Units of the frame.
    pub(super) fn scale(&self) -> FrameScale {
        self.scale
    }

    /// Frames that have coordinates in common.
    pub(super) fn segments(&self) -> impl Iterator<Item = &'a Range<usize>> {
        self.cameras.shots.iter().map(|s| &s.frames)
    }

    /// Whether coordinates of their own begin at a frame.
    pub(super) fn starts_at(&self, frame: usize) -> bool {
        self.cameras.segment_of(frame).is_some_and(|k| self.cameras.shots[k].frames.start == frame)
    }

    /// The real camera of a frame.
    pub(in crate::pipeline::stages) fn camera(&self, frame: usize) -> Option<FrameCamera> {
        self.cameras.frames.get(frame).copied().flatten()
    }
}

/// Where a camera in the world's origin looks at a pixel: the point there at unit depth.
pub(in crate::pipeline::stages) fn direction(camera: &FrameCamera, pixel: Point2) -> Option<Point3> {
    let ray = camera.intrinsics.ray(pixel)?;
    Some(Point3::from(camera.pose.rotation.inverse() * ray))
}
