//! `video.track` with the `video.motion` that takes its points: one streaming pass over the clip.

use std::path::Path;

use super::cameras;
use super::context::Context;
use super::export;
use super::stream::for_each_frame;
use super::telling::verdict_name;
use crate::feature::Mask;
use crate::media::VideoInfo;
use crate::motion::{
    ClipMotion, FrameFlags, FrameInput, FrameMotion, MotionEstimator, MotionOptions, MotionQuality, ReadoutEstimator,
    ShotCameras, TrackPoint,
};
use crate::pipeline::kinds::{MotionSettings, RollingShutter, SmoothSettings, TrackSettings};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::SegmentSummary;
use crate::time::Timebase;
use crate::track::{FrameTracks, StoreError, TrackOptions, TrackStore, Tracker};

/// The points of a clip.
pub(super) struct Tracks {
    pub(super) store: TrackStore,
    pub(super) clip: ClipSize,
}

/// What is alike in all frames of a clip.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClipSize {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) timebase: Timebase,
}

impl ClipSize {
    fn of(info: &VideoInfo) -> Self {
        Self { width: info.width, height: info.height, timebase: info.timebase }
    }
}

/// Tracks the clip, and measures its motion where a later stage wants to know.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &TrackSettings) -> Result<(), RunError> {
    let decode = context.required(stage, "frames")?.from;
    let (_, reader) = context.open(decode)?;
    let info = reader.info().clone();
    let clip = ClipSize::of(&info);
    let mut analysis = Analysis::new(clip, settings)?;
    context.job.progress.begin(context.pass.index, "analyze", info.frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        let tracks = analysis.tracker.push(&frame);
        drop(frame);
        analysis.take(tracks)
    })?;
    context.tell_damage(&report);
    if analysis.motion.is_empty() {
        return Err(RunError::Input("the clip holds no frame that could be decoded".to_owned()));
    }
    let motions: Vec<usize> =
        context.pass.stages.iter().copied().filter(|&s| takes_points_of(context, s, stage)).collect();
    let (motion, store) = analysis.finish(clip, &info);
    let tracks = Tracks { store, clip };
    for stage in motions {
        hand_on_motion(context, stage, motion.clone(), &tracks)?;
    }
    context.values.put(stage, "tracks", tracks);
    Ok(())
}

/// Gives a motion stage its result: with the readout that its settings ask for, and in a file where they ask for one.
fn hand_on_motion(
    context: &mut Context<'_, '_>,
    stage: usize,
    mut motion: ClipMotion,
    tracks: &Tracks,
) -> Result<(), RunError> {
    let settings = context.stage(stage).settings.clone();
    if let Some(settings) = settings.get::<MotionSettings>() {
        match settings.rolling_shutter {
            RollingShutter::Auto => {}
            RollingShutter::Off => motion.readout_s = None,
            RollingShutter::Readout(seconds) => motion.readout_s = Some(seconds),
        }
        if settings.cameras {
            let found = cameras::recover(tracks, &motion, settings.rolling_shutter != RollingShutter::Off)?;
            let smoothed = context.job.graph().stages.iter().any(|s| s.settings.get::<SmoothSettings>().is_some());
            if !smoothed {
                context.summary.segments.extend(found.shots.iter().map(told));
                context.summary.frames = motion.frames.len() as u64;
                context.summary.size = Some((motion.width, motion.height));
            }
            motion.cameras = Some(found);
        }
        if let Some(path) = &settings.export {
            export::write(&motion, Path::new(path))?;
            context.summary.outputs.push(path.into());
        }
    }
    context.summary.readout_s = motion.readout_s;
    context.values.put(stage, "motion", motion);
    Ok(())
}

/// The cameras of a shot, for the summary.
fn told(shot: &ShotCameras) -> SegmentSummary {
    let frames = shot.frames.start as u64..shot.frames.end as u64;
    SegmentSummary {
        frames,
        mode: verdict_name(shot.verdict).to_owned(),
        reason: shot.reason.clone(),
        crop: None,
        shake: None,
    }
}

fn takes_points_of(context: &Context<'_, '_>, motion: usize, tracks: usize) -> bool {
    context.stage(motion).settings.get::<MotionSettings>().is_some()
        && context.edge(motion, "tracks").is_some_and(|e| e.from == tracks)
}

/// Tracker, estimator and store at work.
struct Analysis {
    tracker: Tracker,
    estimator: MotionEstimator,
    readout: ReadoutEstimator,
    store: TrackStore,
    motion: Vec<FrameMotion>,
    points: Vec<TrackPoint>,
}

impl Analysis {
    fn new(clip: ClipSize, settings: &TrackSettings) -> Result<Self, RunError> {
        let options = TrackOptions { points: settings.points as usize, ..TrackOptions::default() };
        let mask = settings.mask.as_deref().map(|path| open_mask(path, clip, &options)).transpose()?;
        let tracker = Tracker::new(clip.width, clip.height, options, mask);
        let tracker = tracker.map_err(|e| RunError::Input(e.to_string()))?;
        let (width, height) = (clip.width as u32, clip.height as u32);
        let estimator = MotionEstimator::new(width, height, MotionOptions::default());
        let store = TrackStore::new().map_err(store_error)?;
        let readout = ReadoutEstimator::new(height);
        Ok(Self { tracker, estimator, readout, store, motion: Vec::new(), points: Vec::new() })
    }

    /// Measures the motion to a frame, marks its points, and stores both.
    fn take(&mut self, mut tracks: FrameTracks) -> Result<(), RunError> {
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

    /// The motion of the whole clip and its points.
    fn finish(self, clip: ClipSize, info: &VideoInfo) -> (ClipMotion, TrackStore) {
        let mut motion = ClipMotion::new(clip.width as u32, clip.height as u32, clip.timebase, self.motion);
        motion.rotation = (info.rotation_deg.round() as i64).rem_euclid(360) as u16;
        if let Some(aspect) = info.sample_aspect {
            motion.pixel_aspect = (aspect.num as u32, aspect.den as u32);
        }
        let period = motion.frame_period_s();
        motion.readout_s = self.readout.estimate().zip(period).map(|(readout, period)| readout.frames * period);
        (motion, self.store)
    }
}

fn open_mask(path: &str, clip: ClipSize, options: &TrackOptions) -> Result<Mask, RunError> {
    let (width, height) = options.analysis_size(clip.width, clip.height);
    let mask = Mask::open(Path::new(path), width, height, 10);
    mask.map_err(|e| RunError::Input(e.to_string()))
}

/// An error of the track store in the terms of a run: the temporary folder is full or gone.
#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err wants")]
pub(super) fn store_error(error: StoreError) -> RunError {
    RunError::Temporary(error.to_string())
}
