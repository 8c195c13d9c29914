//! The cameras of a clip, segment by segment: the result of structure from motion, and its quality.

use std::ops::Range;

use super::sfm::{Segment, SfmFigures, SfmVerdict};
use plumbline_camera::{CameraPose, Intrinsics, Point3};

/// Cameras, points and verdicts of a clip.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClipCameras {
    /// One per frame; `None` where no camera is known. Poses are in the coordinates of their segment.
    pub frames: Vec<Option<FrameCamera>>,
    /// Points of all segments, by segment.
    pub points: Vec<WorldPoint>,
    /// The segments, in order, each a shot or a part of one.
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
    /// Index of its segment.
    pub shot: u32,
    /// Identity of its track.
    pub id: u32,
    /// Position, in the coordinates of the segment.
    pub position: Point3,
}

/// The result for a shot, or for the part of one whose cameras have common coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct ShotCameras {
    /// Its frames.
    pub frames: Range<usize>,
    /// Kind of motion that the tracks support.
    pub verdict: SfmVerdict,
    /// Reason, for the user.
    pub reason: String,
    /// Quality figures.
    pub figures: SfmFigures,
}

/// The segments that structure from motion found in one window of a shot.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowCameras {
    /// The frames of the window.
    pub frames: Range<usize>,
    /// Segments, which cover the window in order.
    pub segments: Vec<Segment>,
}

impl ClipCameras {
    /// Index of the segment that a frame belongs to.
    pub fn segment_of(&self, frame: usize) -> Option<usize> {
        let segment = self.shots.partition_point(|s| s.frames.end <= frame);
        self.shots.get(segment).is_some_and(|s| s.frames.contains(&frame)).then_some(segment)
    }

    /// Whether the camera of a frame only rotated.
    pub fn is_rotation_only(&self, frame: usize) -> bool {
        self.segment_of(frame).is_some_and(|k| self.shots[k].verdict == SfmVerdict::RotationOnly)
    }

    /// Adds the next segment; segments follow each other without a gap.
    pub fn push(&mut self, segment: Segment) {
        let shot = self.shots.len() as u32;
        let Segment { frames, cameras, points, verdict, reason, figures } = segment;
        self.frames.extend(cameras);
        self.points.extend(points.into_iter().map(|(id, position)| WorldPoint { shot, id, position }));
        self.shots.push(ShotCameras { frames, verdict, reason, figures });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_segment_without_cameras_keeps_its_index() {
        let mut cameras = ClipCameras::default();
        for frames in [0..3, 3..5] {
            cameras.push(Segment::unknown(frames, SfmVerdict::Failed, "dark".to_owned()));
        }
        assert_eq!((cameras.frames.len(), cameras.frames.iter().flatten().count()), (5, 0));
        assert_eq!((cameras.shots[1].frames.clone(), cameras.shots[1].figures.frames), (3..5, 2));
    }
}
