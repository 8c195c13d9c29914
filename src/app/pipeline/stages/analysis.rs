//! `video.track` with the `video.motion` that takes its points: one streaming pass over the clip.

use std::path::Path;

use super::cameras;
use super::context::Context;
use super::measuring::Measuring;
use super::stream::for_each_frame;
use super::telling::verdict_name;
use super::undistort::Undistorted;
use super::watching::watchers;
use crate::pipeline::kind::Settings;
use crate::pipeline::kinds::{
    MotionSettings, RollingShutter, SmoothSettings, TrackSettings, VideoRetargetSettings, WarpSettings,
};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::SegmentSummary;
use plumbline_image::feature::Mask;
use plumbline_media::{Input, VideoInfo};
use plumbline_num::time::Timebase;
use plumbline_video::motion::{ClipMotion, ShotCameras};
use plumbline_video::track::{StoreError, TrackOptions, TrackStore, Tracker};

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
    pub(super) fn of(info: &VideoInfo) -> Self {
        Self { width: info.width, height: info.height, timebase: info.timebase }
    }

    /// The same clip in another size, px.
    fn sized(self, (width, height): (usize, usize)) -> Self {
        Self { width, height, ..self }
    }
}

/// Tracks the clip, and measures its motion where a later stage wants to know.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &TrackSettings) -> Result<(), RunError> {
    let decode = context.required(stage, "frames")?.from;
    let (input, reader) = context.open(decode)?;
    let info = reader.info().clone();
    let clip = ClipSize::of(&info);
    let mut tracker = tracker(clip, settings)?;
    let lens: Option<Undistorted> = match context.edge(stage, "lens") {
        Some(edge) => Some(context.values.get::<Undistorted>(edge)?.clone()),
        None => None,
    };
    let shown = lens.as_ref().map_or(clip, |lens| clip.sized(lens.size()));
    let mut measuring = Measuring::new(shown)?;
    let mut watching = watchers(context, decode, &info)?;
    context.job.progress.begin(context.pass.index, "analyze", info.frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        let mut tracks = tracker.push(&frame);
        let cut = tracks.quality.cut_before && tracks.quality.bridged == 0;
        watching.iter_mut().try_for_each(|w| w.look(&frame, cut))?;
        drop(frame);
        if let Some(lens) = &lens {
            lens.carry(&mut tracks);
        }
        measuring.take(tracks)
    })?;
    context.tell_damage(&report);
    if measuring.is_empty() {
        return Err(RunError::Input("the clip holds no frame that could be decoded".to_owned()));
    }
    let motions: Vec<usize> =
        context.pass.stages.iter().copied().filter(|&s| takes_points_of(context, s, stage)).collect();
    let (motion, tracks) = measuring.finish(&info);
    for watcher in watching {
        watcher.finish(context);
    }
    for stage in motions {
        let settings = context.stage(stage).settings.clone();
        let wanted = settings.get::<MotionSettings>().map_or_else(Wanted::default, |s| Wanted {
            rolling_shutter: s.rolling_shutter,
            cameras: s.cameras,
            focal_px: (s.cameras && lens.is_none()).then(|| told_focal_px(&input)).flatten(),
        });
        hand_on_motion(context, stage, motion.clone(), &tracks, wanted)?;
    }
    context.values.put(stage, "tracks", tracks);
    Ok(())
}

/// What a stage that gives motion was asked for.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wanted {
    pub(super) rolling_shutter: RollingShutter,
    pub(super) cameras: bool,
    /// The focal length that the container tells.
    pub(super) focal_px: Option<f64>,
}

/// The focal length that the container of a clip tells, px.
pub(super) fn told_focal_px(input: &Input) -> Option<f64> {
    plumbline_media::probe(input).ok()?.focal_px()
}

/// Gives a stage its motion: with the readout that its settings ask for, and cameras where they do and none are known.
pub(super) fn hand_on_motion(
    context: &mut Context<'_, '_>,
    stage: usize,
    mut motion: ClipMotion,
    tracks: &Tracks,
    wanted: Wanted,
) -> Result<(), RunError> {
    match wanted.rolling_shutter {
        RollingShutter::Auto => {}
        RollingShutter::Off => motion.readout_s = None,
        RollingShutter::Readout(seconds) => motion.readout_s = Some(seconds),
    }
    if wanted.cameras && motion.cameras.is_none() {
        let rolling_shutter = wanted.rolling_shutter != RollingShutter::Off;
        motion.cameras = Some(cameras::recover(tracks, &motion, rolling_shutter, wanted.focal_px)?);
    }
    let smoothed = context.job.graph().stages.iter().any(|s| s.settings.get::<SmoothSettings>().is_some());
    if let Some(found) = motion.cameras.as_ref().filter(|_| !smoothed) {
        context.summary.segments.extend(found.shots.iter().map(told));
        context.summary.frames = motion.frames.len() as u64;
        context.summary.size = Some((motion.width, motion.height));
    }
    let has = |of: fn(&dyn Settings) -> bool| context.job.graph().stages.iter().any(|s| of(s.settings.as_ref()));
    let bends = has(|s| s.get::<WarpSettings>().is_some()) || !has(|s| s.get::<VideoRetargetSettings>().is_some());
    context.summary.readout_s = motion.readout_s.filter(|_| bends);
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

fn tracker(clip: ClipSize, settings: &TrackSettings) -> Result<Tracker, RunError> {
    let options = TrackOptions { points: settings.points as usize, ..TrackOptions::default() };
    let mask = settings.mask.as_deref().map(|path| open_mask(path, clip, &options)).transpose()?;
    Tracker::new(clip.width, clip.height, options, mask).map_err(|e| RunError::Input(e.to_string()))
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
