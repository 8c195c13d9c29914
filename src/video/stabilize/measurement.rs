//! Motion from tracks, frame by frame; the tracks come from the tracker or from another program.

use super::error::StabilizeError;
use super::source::ClipInfo;
use super::tracks::Tracks;
use crate::motion::{ClipMotion, FrameMotion, MotionEstimator, MotionQuality, ReadoutEstimator};
use crate::track::{FrameTracks, TrackStore};

/// Estimators of motion and readout time, and the store of the tracks.
pub(super) struct MotionMeasurement {
    /// Size of the pictures of the tracks, px.
    size: (usize, usize),
    estimator: MotionEstimator,
    readout: ReadoutEstimator,
    store: TrackStore,
    motion: Vec<FrameMotion>,
}

impl MotionMeasurement {
    /// An empty measurement of pictures of `size` px.
    pub(super) fn new(size: (usize, usize)) -> Result<Self, StabilizeError> {
        let (width, height) = (size.0 as u32, size.1 as u32);
        let estimator = MotionEstimator::new(width, height);
        let readout = ReadoutEstimator::new(height);
        Ok(Self { size, estimator, readout, store: TrackStore::new()?, motion: Vec::new() })
    }

    /// Measures the motion to a frame, marks its points of the background, and stores both.
    pub(super) fn push(&mut self, mut tracks: FrameTracks) -> Result<(), StabilizeError> {
        let motion = self.estimator.push(&tracks);
        for (observation, &background) in tracks.observations.iter_mut().zip(self.estimator.background()) {
            observation.background = background;
        }
        if motion.quality == MotionQuality::Measured {
            self.readout.push(&motion.similarity, self.estimator.background_pairs());
        } else {
            self.readout.interrupt();
        }
        self.motion.push(motion);
        Ok(self.store.push(&tracks)?)
    }

    /// Frames measured so far.
    pub(super) fn frames(&self) -> usize {
        self.motion.len()
    }

    /// The motion of the whole clip and its tracks.
    pub(super) fn finish(self, info: &ClipInfo) -> (ClipMotion, Tracks) {
        let (width, height) = self.size;
        let mut motion = ClipMotion::new(width as u32, height as u32, info.timebase, self.motion);
        motion.rotation = info.rotation;
        motion.pixel_aspect = info.pixel_aspect;
        let period = motion.frame_period_s();
        motion.readout_s = self.readout.estimate().zip(period).map(|(readout, period)| readout.frames * period);
        (motion, Tracks { store: self.store, width, height, timebase: info.timebase })
    }
}
