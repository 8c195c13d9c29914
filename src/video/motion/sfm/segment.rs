//! Segments of a shot: cameras in a common coordinate system, or none, with the reason.

use std::ops::Range;

use super::{Reconstruction, SfmFigures, SfmVerdict, TrackTable};
use crate::motion::FrameCamera;
use plumbline_camera::{CameraPose, Point3};

/// Consecutive frames whose cameras have a common coordinate system.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Its frames.
    pub frames: Range<usize>,
    /// By frame; `None` if the camera is unknown.
    pub cameras: Vec<Option<FrameCamera>>,
    /// Tracks and the positions of their points, by track.
    pub points: Vec<(u32, Point3)>,
    /// Kind of the result.
    pub verdict: SfmVerdict,
    /// Reason for the verdict, for the user.
    pub reason: String,
    /// Quality figures.
    pub figures: SfmFigures,
}

impl Segment {
    /// The reconstruction of `frames` from `table`; without cameras and points if the verdict excludes them.
    pub fn new(frames: Range<usize>, table: &TrackTable, found: Reconstruction) -> Self {
        let Reconstruction { scene, verdict, reason, figures } = found;
        if !verdict.has_cameras() {
            return Self { figures, ..Self::unknown(frames, verdict, reason) };
        }
        let camera = |pose: &Option<CameraPose>| pose.map(|pose| FrameCamera { pose, intrinsics: scene.intrinsics });
        let position = |p: u32| {
            let point = scene.points[p as usize]?;
            Some((table.id(p), point.in_world(&scene.poses[point.anchor as usize]?)?))
        };
        Self {
            frames,
            cameras: scene.poses.iter().map(camera).collect(),
            points: (0..table.points() as u32).filter_map(position).collect(),
            verdict,
            reason,
            figures,
        }
    }

    /// A segment without cameras.
    pub fn unknown(frames: Range<usize>, verdict: SfmVerdict, reason: String) -> Self {
        let figures = SfmFigures { frames: frames.len(), ..SfmFigures::default() };
        Self { cameras: vec![None; frames.len()], points: Vec::new(), frames, verdict, reason, figures }
    }

    /// The camera of a frame.
    pub fn camera(&self, frame: usize) -> Option<FrameCamera> {
        self.frames.contains(&frame).then(|| self.cameras[frame - self.frames.start]).flatten()
    }

    /// Restricts the segment to `frames`; if the rest is shorter than `shortest` or has no camera, it becomes unknown.
    pub(super) fn clip(&mut self, frames: Range<usize>, shortest: usize) {
        let within = |f: usize| f.clamp(self.frames.start, self.frames.end);
        let kept = within(frames.start)..within(frames.end);
        let inside = |f: usize| f - self.frames.start;
        if self.verdict.has_cameras() && kept.len() < shortest {
            let reason = format!("{} frames are too few for cameras of their own", kept.len());
            *self = Self::unknown(kept, SfmVerdict::Failed, reason);
            return;
        }
        self.cameras = self.cameras[inside(kept.start)..inside(kept.end)].to_vec();
        self.frames = kept;
        self.count();
    }

    /// Removes the cameras of the frames that are not `explained`.
    pub(super) fn forget(&mut self, explained: &[bool]) {
        for (camera, _) in self.cameras.iter_mut().zip(explained).filter(|(_, e)| !**e) {
            *camera = None;
        }
        self.count();
    }

    /// Updates the numbers of frames and cameras in the figures.
    pub(super) fn count(&mut self) {
        self.figures.frames = self.frames.len();
        self.figures.registered = self.cameras.iter().flatten().count();
    }
}
