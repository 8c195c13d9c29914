//! `video.track`: follows points through the frames. Motion stages that take the points are computed in the same pass.

use std::path::Path;

use super::clip::stream::for_each_frame;
use super::clip::summary::shot_segment;
use super::kept::{CachedTracks, Recording, with_cameras};
use super::lens_undistort::Undistorted;
use super::prelude::*;
use super::video_importance::{ImportanceEstimator, estimate, importance_estimators};
use crate::pipeline::kind::Settings;
use crate::pipeline::paths::unescaped;
use crate::stages::{MotionSettings, SmoothSettings, VideoRetargetSettings, WarpSettings};
use plumbline_media::{Input, Ratio, VideoInfo, VideoReader};
use plumbline_video::motion::ClipMotion;
pub use plumbline_video::stabilize::TrackingOptions as TrackSettings;
use plumbline_video::stabilize::{ClipInfo, ClipTracker, Tracks, WindowJoiner};
use plumbline_video::track::AnalysisWindows;

impl Stage for TrackSettings {
    const KIND: &'static str = "video.track";
    const SUMMARY: &'static str =
        "follows points through the frames, and recognizes cuts, blurred and duplicate frames";
    const INPUTS: &'static [Port] = &[
        Port::one("frames", PortType::Frames, "the clip to analyze"),
        Port::optional("lens", PortType::Warp, "a map of the whole clip that the points are carried through"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("tracks", PortType::Tracks, "the points of every frame")];
    type Input = Wired;
    type Output = HandedOn;

    fn memory(&self) -> Vec<MemoryCost> {
        // Two frames' luma pyramids (1 + 1/4 + 1/16 + … = 4/3 each); tracks go to a temporary file at 8 bytes per point.
        vec![
            MemoryCost { what: "two luma pyramids", bytes_per_px: 8.0 / 3.0, ..MemoryCost::default() },
            MemoryCost {
                what: "tracks",
                bytes_per_clip_frame: f64::from(self.points) * 8.0,
                on_disk: true,
                ..MemoryCost::default()
            },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        self.mask.as_deref().and_then(Path::to_str).into_iter().collect()
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let (input, reader) = context.open(decode)?;
        let video = reader.info().clone();
        let options = Self { mask: self.mask.as_deref().map(unescaped), ..self.clone() };
        let lens: Option<Undistorted> = match context.edge(stage, "lens") {
            Some(edge) => Some(context.values.get::<Undistorted>(edge)?.clone()),
            None => None,
        };
        let (info, carrier) = (clip_info(&video), lens.as_ref().map(Undistorted::carrier));
        let estimators = importance_estimators(context, decode, &video, Some(&options))?;
        let cached = CachedTracks::of(context, stage, decode, &options);
        let known = match &cached {
            Some(cached) => {
                cached.find(WindowJoiner::new(&info, &options, AnalysisWindows::default(), carrier)?, context)?
            }
            None => None,
        };
        let (motion, tracks) = if let Some(known) = known {
            estimate(context, reader, estimators, &known.cuts)?;
            (known.motion, known.tracks)
        } else {
            let tracker = ClipTracker::new(&info, &options, carrier)?;
            let recording = cached.and_then(|cached| cached.begin((info.width, info.height), context));
            analyzed(context, reader, tracker, recording, estimators)?
        };
        hand_on_to_all(context, stage, &motion, &tracks, || focal_px_of(&input).filter(|_| lens.is_none()))?;
        context.values.put(stage, "tracks", tracks);
        Ok(HandedOn)
    }
}

/// Tracks the points through the frames of a clip, and stores the tracks of a clip without damage.
fn analyzed(
    context: &mut Context<'_, '_>,
    reader: VideoReader,
    mut tracker: ClipTracker<'_>,
    mut recording: Option<Recording>,
    mut estimators: Vec<ImportanceEstimator>,
) -> Result<(ClipMotion, Tracks), RunError> {
    context.job.progress.begin(context.pass.index, "analyze", reader.info().frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        let mut owner = usize::MAX;
        let cut = tracker.push_noting(&frame, |window, tracks| {
            owner = owner.min(window);
            if let Some(recording) = &mut recording {
                recording.note(window, tracks);
            }
        })?;
        if let Some(recording) = &mut recording {
            recording.flush(owner);
        }
        estimators.iter_mut().try_for_each(|e| e.push(&frame, cut))
    })?;
    // Of a damaged clip the decoder has to report each time.
    let whole = context.report_damage(&report);
    if let Some(recording) = recording.filter(|_| whole) {
        recording.publish(context);
    }
    for estimator in estimators {
        estimator.finish(context, whole);
    }
    Ok(tracker.finish()?)
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
    with_cameras(context, stage, &mut motion, tracks, settings, focal_px)?;
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

/// Gives the motion of the tracks of stage `stage` to all that take it; `focal_px`: the focal length, where it is known.
pub(super) fn hand_on_to_all(
    context: &mut Context<'_, '_>,
    stage: usize,
    motion: &ClipMotion,
    tracks: &Tracks,
    focal_px: impl Fn() -> Option<f64>,
) -> Result<(), RunError> {
    let motions: Vec<usize> =
        context.pass.stages.iter().copied().filter(|&s| takes_points_of(context, s, stage)).collect();
    for stage in motions {
        let settings = context.stage(stage).settings.get::<MotionSettings>().copied().unwrap_or_default();
        let focal_px = settings.cameras.then(&focal_px).flatten();
        hand_on_motion(context, stage, motion.clone(), tracks, &settings, focal_px)?;
    }
    Ok(())
}

fn takes_points_of(context: &Context<'_, '_>, motion: usize, tracks: usize) -> bool {
    context.stage(motion).settings.get::<MotionSettings>().is_some()
        && context.edge(motion, "tracks").is_some_and(|e| e.from == tracks)
}
