//! `video.motion_import`: motion and points from a motion file or a COLMAP model, checked against the clip.
//!
//! Where the container tells number and rate of the frames, and those are the file's, the clip is not decoded here. Else, and
//! always for a model, which knows no times, its frames are counted and their times read first.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::analysis::{ClipSize, Tracks, Wanted, hand_on_motion, store_error, told_focal_px};
use super::context::Context;
use super::measuring::Measuring;
use super::stream::for_each_frame;
use crate::pipeline::kinds::{DecodeSettings, MotionImportSettings};
use crate::pipeline::run_error::RunError;
use plumbline_media::VideoInfo;
use plumbline_num::time::Timestamp;
use plumbline_video::motion::ClipMotion;
use plumbline_video::motion::exchange::colmap::{ColmapError, ImportedClip, Model};
use plumbline_video::track::{FrameQuality, FrameTracks, TrackStore};

/// How far the mean rate of a file's frames may be off the clip's, as a share, to be believed without a look at the frames: headers
/// round it, and count a last frame's length or not.
const RATE_SLACK: f64 = 0.1;

/// Most numbered folders that are looked for.
const MOST_MODELS: usize = 10_000;

/// Reads the file.
pub(super) fn run(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &MotionImportSettings,
) -> Result<(), RunError> {
    let decode = context.required(stage, "frames")?.from;
    let path = Path::new(&settings.path);
    let focal_px = if settings.cameras { told_focal_px(&context.input(decode)?) } else { None };
    let wanted = Wanted { rolling_shutter: settings.rolling_shutter, cameras: settings.cameras, focal_px };
    let (motion, tracks) =
        if path.is_dir() { from_models(context, decode, path)? } else { from_motion_file(context, decode, path)? };
    hand_on_motion(context, stage, motion, &tracks, wanted)?;
    context.values.put(stage, "tracks", tracks);
    Ok(())
}

fn refused(path: &Path, why: &dyn std::fmt::Display) -> RunError {
    RunError::Input(format!("{}: {why}", path.display()))
}

fn from_motion_file(
    context: &mut Context<'_, '_>,
    decode: usize,
    path: &Path,
) -> Result<(ClipMotion, Tracks), RunError> {
    let file = File::open(path).map_err(|e| refused(path, &format!("cannot be read: {e}")))?;
    let (motion, store) = ClipMotion::read_json(file).map_err(|e| refused(path, &e))?;
    let (_, reader) = context.open(decode)?;
    let info = reader.info().clone();
    drop(reader);
    let sizes = [(motion.width as usize, motion.height as usize), (info.width, info.height)];
    if sizes[0] != sizes[1] {
        let [(w, h), (clip_w, clip_h)] = sizes;
        let why = format!("source is of {w}×{h} px, and the clip of {clip_w}×{clip_h} px; it belongs to another clip");
        return Err(refused(path, &why));
    }
    let settings = context.stage(decode).settings.clone();
    let trimmed = settings.get::<DecodeSettings>().is_none_or(|s| s.start.is_some() || s.end.is_some());
    if trimmed || !seems_of(&motion, &info) {
        let (times, info) = times(context, decode)?;
        check_times(&motion, &times, &info).map_err(|why| refused(path, &why))?;
    }
    let store = if let Some(store) = store {
        store
    } else {
        let help = "frames follow the planned camera, and nothing bends them";
        context.warn(format!("{} holds no tracks: {help}", path.display()));
        without_points(&motion)?
    };
    let clip = ClipSize { width: info.width, height: info.height, timebase: motion.timebase };
    Ok((motion, Tracks { store, clip }))
}

/// Whether number and mean rate of the frames are what the container tells.
fn seems_of(motion: &ClipMotion, info: &VideoInfo) -> bool {
    let count = info.frames_estimate == Some(motion.frames.len() as u64);
    let rates = motion.frame_period_s().zip(info.frame_rate);
    count && rates.is_some_and(|(period, rate)| (period * rate.value() - 1.0).abs() <= RATE_SLACK)
}

/// Refuses motion of other frames than the clip's.
fn check_times(motion: &ClipMotion, times: &[Timestamp], info: &VideoInfo) -> Result<(), String> {
    let (found, frames) = (motion.frames.len(), times.len());
    if found != frames {
        return Err(format!(
            "frames has {found} entries, and the clip {frames} frames; it belongs to another clip or span"
        ));
    }
    let from_first = |times: Vec<f64>| {
        let first = times.first().copied().unwrap_or(0.0);
        times.into_iter().map(|t| t - first).collect::<Vec<f64>>()
    };
    let theirs = from_first(motion.frames.iter().map(|f| motion.timebase.seconds(f.pts)).collect());
    let ours = from_first(times.iter().map(|t| info.timebase.seconds(*t)).collect());
    // Time bases differ between containers: half a frame apart is another frame.
    let slack = 0.5 * ours.last().copied().unwrap_or(0.0) / (frames.max(2) - 1) as f64;
    let off = theirs.iter().zip(&ours).position(|(a, b)| !((a - b).abs() <= slack));
    off.map_or(Ok(()), |k| {
        let (found, expected) = (theirs[k], ours[k]);
        Err(format!("frames[{k}].pts is {found:.3} s after the first (expected {expected:.3} s, as in the clip)"))
    })
}

/// As many frames as the motion has, and no points.
fn without_points(motion: &ClipMotion) -> Result<TrackStore, RunError> {
    let mut store = TrackStore::new().map_err(store_error)?;
    for frame in &motion.frames {
        let (pts, quality) = (frame.pts, FrameQuality::default());
        store.push(&FrameTracks { pts, observations: Vec::new(), quality }).map_err(store_error)?;
    }
    Ok(store)
}

/// Cameras and points of a model, and the motion that its points say.
fn from_models(context: &mut Context<'_, '_>, decode: usize, folder: &Path) -> Result<(ClipMotion, Tracks), RunError> {
    let models = folders_of(folder).iter().map(|f| Model::read(f)).collect::<Result<Vec<_>, ColmapError>>();
    let models = models.map_err(|e| match e {
        ColmapError::Io { .. } | ColmapError::NoModel { .. } => RunError::Input(e.to_string()),
        _ => refused(folder, &e),
    })?;
    let (times, info) = times(context, decode)?;
    let size = (info.width as u32, info.height as u32);
    let found = ImportedClip::new(&models, times.len(), size).map_err(|e| refused(folder, &e))?;
    let images: usize = found.shots.iter().map(|s| s.images).sum();
    if images < times.len() {
        let missing = times.len() - images;
        context.warn(format!("{}: {missing} of {} frames have no image there", folder.display(), times.len()));
    }
    let mut measuring = Measuring::new(ClipSize::of(&info))?;
    for (k, (pts, observations)) in times.into_iter().zip(found.tracks).enumerate() {
        let cut_before = found.shots.iter().any(|s| s.frames.start == k);
        measuring.take(FrameTracks {
            pts,
            observations,
            quality: FrameQuality { cut_before, ..FrameQuality::default() },
        })?;
    }
    let (mut motion, tracks) = measuring.finish(&info);
    motion.cameras = Some(found.cameras);
    Ok((motion, tracks))
}

/// The folders of the models: `folder` itself, or the numbered ones in it where it holds none.
fn folders_of(folder: &Path) -> Vec<PathBuf> {
    let own = ["cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).is_file());
    let numbered: Vec<PathBuf> =
        (0..MOST_MODELS).map(|k| folder.join(k.to_string())).take_while(|f| f.is_dir()).collect();
    if own || numbered.is_empty() { vec![folder.to_owned()] } else { numbered }
}

/// Times of the clip's frames.
fn times(context: &mut Context<'_, '_>, decode: usize) -> Result<(Vec<Timestamp>, VideoInfo), RunError> {
    let (_, reader) = context.open(decode)?;
    let info = reader.info().clone();
    let mut times = Vec::new();
    context.job.progress.begin(context.pass.index, "read times", info.frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        times.push(frame.pts);
        Ok(())
    })?;
    context.tell_damage(&report);
    Ok((times, info))
}
