//! `video.track` with the `video.motion` that takes its points: one streaming pass over the clip.

use super::context::Context;
use super::importance::watchers;
use super::stream::for_each_frame;
use super::summary::shot_segment;
use super::undistort::Undistorted;
use crate::pipeline::kind::Settings;
use crate::pipeline::kinds::{MotionSettings, SmoothSettings, TrackSettings, VideoRetargetSettings, WarpSettings};
use crate::pipeline::run_error::RunError;
use plumbline_media::{Input, Ratio, VideoInfo};
use plumbline_video::motion::ClipMotion;
use plumbline_video::stabilize::{ClipInfo, ClipTracker, Tracks, complete_motion};

/// Tracks the clip, and measures its motion where a later stage takes it.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &TrackSettings) -> Result<(), RunError> {
    let decode = context.required(stage, "frames")?.from;
    let (input, reader) = context.open(decode)?;
    let video = reader.info().clone();
    let lens: Option<Undistorted> = match context.edge(stage, "lens") {
        Some(edge) => Some(context.values.get::<Undistorted>(edge)?.clone()),
        None => None,
    };
    let mut tracker = ClipTracker::new(&clip_info(&video), settings, lens.as_ref().map(Undistorted::carrier))?;
    let mut watching = watchers(context, decode, &video)?;
    context.job.progress.begin(context.pass.index, "analyze", video.frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        let cut = tracker.push(&frame)?;
        watching.iter_mut().try_for_each(|w| w.look(&frame, cut))
    })?;
    context.report_damage(&report);
    let (motion, tracks) = tracker.finish()?;
    for watcher in watching {
        watcher.finish(context);
    }
    let motions: Vec<usize> =
        context.pass.stages.iter().copied().filter(|&s| takes_points_of(context, s, stage)).collect();
    for stage in motions {
        let settings = context.stage(stage).settings.get::<MotionSettings>().copied().unwrap_or_default();
        let focal_px = (settings.cameras && lens.is_none()).then(|| focal_px_of(&input)).flatten();
        hand_on_motion(context, stage, motion.clone(), &tracks, &settings, focal_px)?;
    }
    context.values.put(stage, "tracks", tracks);
    Ok(())
}

/// What the stabilizer needs to know of a clip before its first frame.
pub(super) fn clip_info(video: &VideoInfo) -> ClipInfo {
    ClipInfo {
        rotation: (video.rotation_deg.round() as i64).rem_euclid(360) as u16,
        pixel_aspect: video.sample_aspect.map_or((1, 1), |aspect| (aspect.num as u32, aspect.den as u32)),
        frame_rate: video.frame_rate.map(Ratio::value),
        frames: video.frames_estimate,
        ..ClipInfo::new(video.width, video.height, video.timebase)
    }
}

/// The focal length in the metadata of a clip, px.
pub(super) fn focal_px_of(input: &Input) -> Option<f64> {
    plumbline_media::probe(input).ok()?.focal_px()
}

/// Gives a stage its motion: with the readout that its settings ask for, and cameras where they do and none are known.
pub(super) fn hand_on_motion(
    context: &mut Context<'_, '_>,
    stage: usize,
    mut motion: ClipMotion,
    tracks: &Tracks,
    settings: &MotionSettings,
    focal_px: Option<f64>,
) -> Result<(), RunError> {
    complete_motion(&mut motion, tracks, settings, focal_px, &context.job.run())?;
    let has = |of: fn(&dyn Settings) -> bool| context.job.graph().stages.iter().any(|s| of(s.settings.as_ref()));
    let smoothed = has(|s| s.get::<SmoothSettings>().is_some());
    let bends = has(|s| s.get::<WarpSettings>().is_some()) || !has(|s| s.get::<VideoRetargetSettings>().is_some());
    if let Some(found) = motion.cameras.as_ref().filter(|_| !smoothed) {
        context.summary.segments.extend(found.shots.iter().map(shot_segment));
        context.summary.frames = motion.frames.len() as u64;
        context.summary.size = Some((motion.width, motion.height));
    }
    context.summary.readout_s = motion.readout_s.filter(|_| bends);
    context.values.put(stage, "motion", motion);
    Ok(())
}

fn takes_points_of(context: &Context<'_, '_>, motion: usize, tracks: usize) -> bool {
    context.stage(motion).settings.get::<MotionSettings>().is_some()
        && context.edge(motion, "tracks").is_some_and(|e| e.from == tracks)
}
