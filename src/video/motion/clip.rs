//! The motion of a whole clip: one [`FrameMotion`] per frame, cut into shots.

use std::collections::BTreeMap;
use std::ops::Range;

use plumbline_num::math::{Point2, Similarity2, Vec2};
use plumbline_num::time::Timebase;

use super::cameras::ClipCameras;
use super::frame_motion::{FrameMotion, MotionQuality, PlanarModel};

/// Longest gap that is bridged, frames: a third of a second, over which the motion of a hand is smooth.
pub const MAX_BRIDGE: usize = 10;

/// Motion of a clip, the content of `plumbline.motion` files.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipMotion {
    /// Width of the coded picture, px: the frame of all coordinates.
    pub width: u32,
    /// Height of the coded picture, px.
    pub height: u32,
    /// Length of one tick of the time stamps.
    pub timebase: Timebase,
    /// Clockwise rotation at which the picture is shown: 0, 90, 180 or 270 degrees.
    pub rotation: u16,
    /// Width over height of one pixel, as a fraction.
    pub pixel_aspect: (u32, u32),
    /// One per frame, in order of presentation.
    pub frames: Vec<FrameMotion>,
    /// Frames of each shot, in order, without gaps.
    pub shots: Vec<Range<usize>>,
    /// Time from the first row's capture to the last row's, s; negative where rows are read upwards; `None` where not
    /// estimated or not supported.
    pub readout_s: Option<f64>,
    /// The cameras in space, where they were estimated.
    pub cameras: Option<ClipCameras>,
    /// Blocks of a motion file that this version does not know, kept as they are.
    pub other_blocks: BTreeMap<String, serde_json::Value>,
}

impl ClipMotion {
    /// A clip of `frames`, cut where their quality says [`MotionQuality::ShotStart`]; gaps are bridged.
    pub fn new(width: u32, height: u32, timebase: Timebase, frames: Vec<FrameMotion>) -> Self {
        let mut clip = Self::unbridged(width, height, timebase, frames);
        clip.bridge_gaps();
        clip
    }

    /// [`Self::new`] with every motion as it is.
    pub(super) fn unbridged(width: u32, height: u32, timebase: Timebase, frames: Vec<FrameMotion>) -> Self {
        let shots = shots_of(&frames);
        Self {
            width,
            height,
            timebase,
            rotation: 0,
            pixel_aspect: (1, 1),
            frames,
            shots,
            readout_s: None,
            cameras: None,
            other_blocks: BTreeMap::new(),
        }
    }

    /// Index of the shot that contains frame `frame`; `None` beyond the end.
    pub fn shot_of(&self, frame: usize) -> Option<usize> {
        let shot = self.shots.partition_point(|s| s.end <= frame);
        (shot < self.shots.len()).then_some(shot)
    }

    /// Mean time from one frame to the next, s; `None` for fewer than two frames.
    pub fn frame_period_s(&self) -> Option<f64> {
        let (first, last) = (self.frames.first()?, self.frames.last()?);
        let span = self.timebase.seconds(last.pts) - self.timebase.seconds(first.pts);
        (self.frames.len() > 1 && span > 0.0).then(|| span / (self.frames.len() - 1) as f64)
    }

    /// The readout in frame periods; 0 where none is known.
    pub fn readout_in_frames(&self) -> f64 {
        match (self.readout_s, self.frame_period_s()) {
            (Some(readout), Some(period)) => readout / period,
            _ => 0.0,
        }
    }

    /// Replaces lost motions in runs of at most [`MAX_BRIDGE`] frames by the interpolation between the measured motions
    /// around them; at a shot's ends the nearest measured motion fades to none.
    pub fn bridge_gaps(&mut self) {
        let center = Point2::new(f64::from(self.width) / 2.0, f64::from(self.height) / 2.0);
        for shot in self.shots.clone() {
            let mut at = shot.start;
            while at < shot.end {
                let end = (at..shot.end).find(|&k| self.frames[k].quality != MotionQuality::Lost).unwrap_or(shot.end);
                if (1..=MAX_BRIDGE).contains(&(end - at)) {
                    self.bridge(at..end, &shot, center);
                }
                at = end + 1;
            }
        }
    }

    fn bridge(&mut self, gap: Range<usize>, shot: &Range<usize>, center: Point2) {
        let rate = |k: usize| match self.frames[k].quality {
            MotionQuality::Measured | MotionQuality::Bridged => Some(Rate::of(&self.frames[k].similarity, center)),
            _ => None,
        };
        let before = (shot.start..gap.start).next_back().and_then(rate);
        let after = (gap.end < shot.end).then_some(gap.end).and_then(rate);
        if before.is_none() && after.is_none() {
            return;
        }
        let (before, after) = (before.unwrap_or_default(), after.unwrap_or_default());
        for (k, frame) in self.frames[gap.clone()].iter_mut().enumerate() {
            let t = (k + 1) as f64 / (gap.len() + 1) as f64;
            frame.similarity = before.lerp(&after, t).motion(center);
            frame.homography = frame.similarity.to_homography();
            frame.model = PlanarModel::Similarity;
            frame.quality = MotionQuality::Bridged;
        }
    }
}

fn shots_of(frames: &[FrameMotion]) -> Vec<Range<usize>> {
    let starts = (0..frames.len()).filter(|&k| k == 0 || frames[k].quality == MotionQuality::ShotStart);
    let mut starts: Vec<usize> = starts.collect();
    starts.push(frames.len());
    starts.windows(2).map(|w| w[0]..w[1]).collect()
}

/// A similarity by quantities that interpolate linearly: shift of the frame's center, angle, logarithm of the scale.
#[derive(Clone, Copy, Default)]
struct Rate {
    shift: [f64; 2],
    angle: f64,
    log_scale: f64,
}

impl Rate {
    fn of(motion: &Similarity2, center: Point2) -> Self {
        let shift = motion.apply(center) - center;
        Self { shift: [shift.x, shift.y], angle: motion.angle(), log_scale: motion.scale().ln() }
    }

    fn lerp(&self, other: &Self, t: f64) -> Self {
        let mix = |a: f64, b: f64| a + t * (b - a);
        Self {
            shift: [mix(self.shift[0], other.shift[0]), mix(self.shift[1], other.shift[1])],
            angle: mix(self.angle, other.angle),
            log_scale: mix(self.log_scale, other.log_scale),
        }
    }

    fn motion(&self, center: Point2) -> Similarity2 {
        Similarity2::about(center, self.angle, self.log_scale.exp(), Vec2::from(self.shift))
    }
}
