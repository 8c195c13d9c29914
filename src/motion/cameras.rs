//! The cameras of a clip, shot by shot: what structure from motion found, and what it is worth.

use std::ops::Range;

use super::sfm::{Reconstruction, SfmFigures, SfmVerdict, TrackTable};
use crate::camera::{CameraPose, Intrinsics, Point3};

/// Cameras, points and verdicts of a clip.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClipCameras {
    /// One per frame; `None` where no camera is known. Poses are in the coordinates of their shot.
    pub frames: Vec<Option<FrameCamera>>,
    /// Points of all shots, by shot.
    pub points: Vec<WorldPoint>,
    /// One per shot, in order.
    pub shots: Vec<ShotCameras>,
}

/// The camera of one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameCamera {
    /// `cam_from_world`.
    pub pose: CameraPose,
    /// The lens.
    pub intrinsics: Intrinsics,
}

/// A still point of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldPoint {
    /// Index of its shot.
    pub shot: u32,
    /// Identity of its track.
    pub id: u32,
    /// Where it is, in the coordinates of the shot.
    pub place: Point3,
}

/// What was found out about the cameras of a shot.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotCameras {
    /// Its frames.
    pub frames: Range<usize>,
    /// What the tracks allow to say.
    pub verdict: SfmVerdict,
    /// Why, for the user.
    pub reason: String,
    /// How good it is.
    pub figures: SfmFigures,
}

impl ClipCameras {
    /// Whether the camera of a frame was found to have only turned.
    pub fn turns(&self, frame: usize) -> bool {
        let shot = self.shots.partition_point(|s| s.frames.end <= frame);
        self.shots.get(shot).is_some_and(|s| s.verdict == SfmVerdict::RotationOnly)
    }

    /// Adds the next shot, `frames` of the clip, of which nothing is known and why.
    pub fn push_unknown(&mut self, frames: Range<usize>, reason: String) {
        self.frames.resize(self.frames.len() + frames.len(), None);
        let figures = SfmFigures { frames: frames.len(), ..SfmFigures::default() };
        self.shots.push(ShotCameras { frames, verdict: SfmVerdict::Failed, reason, figures });
    }

    /// Adds the next shot: `frames` of the clip, reconstructed from `table`.
    pub fn push(&mut self, frames: Range<usize>, table: &TrackTable, found: Reconstruction) {
        let shot = self.shots.len() as u32;
        let scene = &found.scene;
        let camera = |pose: &Option<CameraPose>| pose.map(|pose| FrameCamera { pose, intrinsics: scene.intrinsics });
        self.frames.extend(scene.poses.iter().map(camera));
        let place = |p: u32| {
            let point = scene.points[p as usize]?;
            point.in_world(&scene.poses[point.anchor as usize]?)
        };
        let world = |p: u32| place(p).map(|place| WorldPoint { shot, id: table.id(p), place });
        self.points.extend((0..table.points() as u32).filter_map(world));
        let Reconstruction { verdict, reason, figures, .. } = found;
        self.shots.push(ShotCameras { frames, verdict, reason, figures });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shot_of_which_nothing_is_known_keeps_its_place() {
        let mut cameras = ClipCameras::default();
        cameras.push_unknown(0..3, "too long".to_owned());
        cameras.push_unknown(3..5, "too long".to_owned());
        assert_eq!((cameras.frames.len(), cameras.frames.iter().flatten().count()), (5, 0));
        assert_eq!((cameras.shots[1].frames.clone(), cameras.shots[1].figures.frames), (3..5, 2));
    }
}
