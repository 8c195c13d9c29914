//! Motion from points, frame by frame, whoever followed them: the tracker of this program or another.

use super::analysis::{ClipSize, Tracks, store_error};
use crate::pipeline::run_error::RunError;
use plumbline_media::VideoInfo;
use plumbline_video::motion::{
    ClipMotion, FrameFlags, FrameInput, FrameMotion, MotionEstimator, MotionOptions, MotionQuality, ReadoutEstimator,
    TrackPoint,
};
use plumbline_video::track::{FrameTracks, TrackStore};

/// Estimator and store at work.
pub(super) struct Measuring {
    clip: ClipSize,
    estimator: MotionEstimator,
    readout: ReadoutEstimator,
    store: TrackStore,
    motion: Vec<FrameMotion>,
    points: Vec<TrackPoint>,
}

impl Measuring {
    pub(super) fn new(clip: ClipSize) -> Result<Self, RunError> {
        let (width, height) = (clip.width as u32, clip.height as u32);
        let estimator = MotionEstimator::new(width, height, MotionOptions::default());
        let store = TrackStore::new().map_err(store_error)?;
        let readout = ReadoutEstimator::new(height);
        Ok(Self { clip, estimator, readout, store, motion: Vec::new(), points: Vec::new() })
    }

    /// Measures the motion to a frame, marks its points, and stores both.
    pub(super) fn take(&mut self, mut tracks: FrameTracks) -> Result<(), RunError> {
        self.points.clear();
        self.points.extend(tracks.observations.iter().map(|o| TrackPoint { id: o.id, x: o.x, y: o.y }));
        let q = tracks.quality;
        let flags = FrameFlags {
            black: q.black,
            duplicate: q.duplicate,
            blurred: q.blurred,
            cut_before: q.cut_before && q.bridged == 0,
        };
        let motion = self.estimator.push(FrameInput { pts: tracks.pts, flags, points: &self.points });
        for (observation, &background) in tracks.observations.iter_mut().zip(self.estimator.background()) {
            observation.background = background;
        }
        if motion.quality == MotionQuality::Measured {
            self.readout.push(&motion.similarity, self.estimator.background_pairs());
        } else {
            self.readout.interrupt();
        }
        self.motion.push(motion);
        self.store.push(&tracks).map_err(store_error)
    }

    /// True where no frame was taken.
    pub(super) fn is_empty(&self) -> bool {
        self.motion.is_empty()
    }

    /// The motion of the whole clip and its points.
    pub(super) fn finish(self, info: &VideoInfo) -> (ClipMotion, Tracks) {
        let clip = self.clip;
        let mut motion = ClipMotion::new(clip.width as u32, clip.height as u32, clip.timebase, self.motion);
        motion.rotation = (info.rotation_deg.round() as i64).rem_euclid(360) as u16;
        if let Some(aspect) = info.sample_aspect {
            motion.pixel_aspect = (aspect.num as u32, aspect.den as u32);
        }
        let period = motion.frame_period_s();
        motion.readout_s = self.readout.estimate().zip(period).map(|(readout, period)| readout.frames * period);
        (motion, Tracks { store: self.store, clip })
    }
}
