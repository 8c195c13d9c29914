//! `video.motion_import`: motion and points from a motion file or a COLMAP model, checked against the clip.
//!
//! Where the container states number and rate of the frames, and those are the file's, the clip is not decoded here. Else, and
//! always for a model, which knows no times, its frames are counted and their times read first.

use std::path::Path;

use super::clip::stream::for_each_frame;
use super::prelude::*;
use super::video_motion::RollingShutter;
use super::video_track::{clip_info, focal_px_of, hand_on_motion};
use crate::pipeline::paths::to_path;
use crate::stages::{DecodeSettings, MotionSettings};
use plumbline_media::VideoInfo;
use plumbline_num::time::Timestamp;
use plumbline_video::motion::ClipMotion;
use plumbline_video::stabilize::{ImportedModels, MotionFile, Tracks};

/// Settings of `video.motion_import`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionImportSettings {
    /// A motion file (JSON, `plumbline.motion`), or the folder of a COLMAP model
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Rolling-shutter correction: as the file says, off, or the sensor's readout time in seconds
    pub rolling_shutter: RollingShutter,
    /// Also recover where the camera stood in space, where the file does not say
    pub cameras: bool,
}

impl Stage for MotionImportSettings {
    const KIND: &'static str = "video.motion_import";
    const SUMMARY: &'static str = "reads motion and points from a file instead of tracking the clip";
    const INPUTS: &'static [Port] =
        &[Port::one("frames", PortType::Frames, "the clip that they are of; its size and times are compared")];
    const OUTPUTS: &'static [Port] = &[
        Port::one("motion", PortType::Motion, "motion between neighboring frames"),
        Port::one("tracks", PortType::Tracks, "the points of every frame"),
    ];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = Wired;
    type Output = HandedOn;

    fn over_time(&self) -> TemporalScope {
        TemporalScope::Once
    }

    fn memory(&self) -> Vec<MemoryCost> {
        // As video.motion and video.track: the file is read point by point.
        vec![
            MemoryCost { what: "motion", bytes_per_clip_frame: 192.0, ..MemoryCost::default() },
            MemoryCost { what: "tracks", bytes_per_clip_frame: 8_000.0, on_disk: true, ..MemoryCost::default() },
        ]
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, Wired { stage }: Wired, context: &mut Context<'_, '_>) -> Result<HandedOn, RunError> {
        let decode = context.required(stage, "frames")?.from;
        let path = &to_path(&self.path);
        let focal_px = if self.cameras { focal_px_of(&context.input(decode)?) } else { None };
        let (motion, tracks) =
            if path.is_dir() { from_models(context, decode, path)? } else { from_motion_file(context, decode, path)? };
        let settings = MotionSettings { rolling_shutter: self.rolling_shutter, cameras: self.cameras };
        hand_on_motion(context, stage, motion, &tracks, &settings, focal_px)?;
        context.values.put(stage, "tracks", tracks);
        Ok(HandedOn)
    }
}

fn from_motion_file(
    context: &mut Context<'_, '_>,
    decode: usize,
    path: &Path,
) -> Result<(ClipMotion, Tracks), RunError> {
    let file = MotionFile::read(path)?;
    let (_, reader) = context.open(decode)?;
    let info = clip_info(reader.info());
    drop(reader);
    file.check_size(&info)?;
    let settings = context.stage(decode).settings.get::<DecodeSettings>();
    let trimmed = settings.is_none_or(|s| s.start.is_some() || s.end.is_some());
    if trimmed || !file.matches(&info) {
        let (times, video) = times(context, decode)?;
        file.check_times(&times, &clip_info(&video))?;
    }
    if !file.has_tracks() {
        let help = "frames follow the planned camera, and nothing bends them";
        context.warn(format!("{} has no tracks: {help}", path.display()));
    }
    Ok(file.into_motion()?)
}

/// Cameras and points of a model, and the motion that its points imply.
fn from_models(context: &mut Context<'_, '_>, decode: usize, folder: &Path) -> Result<(ClipMotion, Tracks), RunError> {
    let models = ImportedModels::read(folder)?;
    let (times, video) = times(context, decode)?;
    let imported = models.motion(&times, &clip_info(&video))?;
    let missing = imported.frames_without_image;
    if missing > 0 {
        context.warn(format!("{}: {missing} of {} frames have no image there", folder.display(), times.len()));
    }
    Ok((imported.motion, imported.tracks))
}

/// Times of the clip's frames.
fn times(context: &mut Context<'_, '_>, decode: usize) -> Result<(Vec<Timestamp>, VideoInfo), RunError> {
    let (_, reader) = context.open(decode)?;
    let video = reader.info().clone();
    let mut times = Vec::new();
    context.job.progress.begin(context.pass.index, "read times", video.frames_estimate);
    let report = for_each_frame(context.job, reader, |frame| {
        times.push(frame.pts);
        Ok(())
    })?;
    context.report_damage(&report);
    Ok((times, video))
}
