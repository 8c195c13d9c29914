//! Options of every command that analyzes a clip: the part that is read, motion estimation, the run.

use std::path::{Path, PathBuf};

use clap::Args;

use super::options::{Given, Offer, Setting};
use crate::pipeline::StageEntry;
use crate::pipeline::file::literal_path;
use crate::pipeline::items::has_extension;
use crate::pipeline::units::ClipTime;
use crate::stages::{Codec, DecodeSettings, MotionImportSettings, MotionSettings, TrackSettings};

/// Options that `stabilize` and `motion` share.
#[derive(Debug, Args)]
pub(super) struct ClipArgs {
    #[command(flatten)]
    decode: Given<Decode>,
    #[command(flatten)]
    length: LengthArg,

    /// Take motion and points from here in place of tracking: plumbline.motion JSON, or the folder of a COLMAP model
    #[arg(long, value_name = "FILE|DIR", conflicts_with = "mask", help_heading = "Analysis")]
    pub(super) motion: Option<PathBuf>,
    #[command(flatten)]
    track: Given<Track>,
    #[command(flatten)]
    camera_motion: Given<CameraMotion>,
}

/// The end of the part that is read, by its length.
#[derive(Debug, Args)]
pub(super) struct LengthArg {
    /// Length of the part to read, in place of its end
    #[arg(long, value_name = "TIME", conflicts_with = "end")]
    duration: Option<ClipTime>,
}

impl LengthArg {
    /// The option was given.
    pub(super) fn is_given(&self) -> bool {
        self.duration.is_some()
    }

    /// `decode` that stops after this length.
    pub(super) fn applied(&self, decode: DecodeSettings) -> DecodeSettings {
        let start = decode.start.map_or(0.0, ClipTime::seconds);
        let end = self.duration.and_then(|length| ClipTime::from_seconds(start + length.seconds()));
        DecodeSettings { end: end.or(decode.end), ..decode }
    }
}

/// Settings of `video.decode` that are options.
struct Decode;

impl Offer for Decode {
    type Kind = DecodeSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("start").also("ss").value("TIME"),
        Setting::of("end").also("to").value("TIME"),
        Setting::of("fps").value("RATE"),
        Setting::of("deinterlace"),
        Setting::of("stream").value("N"),
        Setting::of("allow_playlist"),
    ];
}

/// Options for `video.track`.
struct Track;

impl Offer for Track {
    type Kind = TrackSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("mask").under("Analysis")];
}

/// Options for `video.motion`.
struct CameraMotion;

impl Offer for CameraMotion {
    type Kind = MotionSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("rolling_shutter").value("auto|off|SECONDS").under("Analysis")];
}

impl ClipArgs {
    /// Stages `source` and `motion`, and `tracks` where the clip is tracked; `source`: the clip, `cameras`: those in space too.
    pub(super) fn analysis(&self, source: String, cameras: bool) -> Vec<StageEntry> {
        let decode = self.length.applied(DecodeSettings { path: source, ..self.decode.settings.clone() });
        let mut stages = vec![StageEntry::built("source", &decode)];
        let rolling_shutter = self.camera_motion.settings.rolling_shutter;
        if let Some(file) = &self.motion {
            let import = MotionImportSettings { path: literal_path(file), rolling_shutter, cameras };
            stages.push(StageEntry::built("motion", &import).input("frames", "source"));
        } else {
            let motion = MotionSettings { rolling_shutter, cameras };
            stages.push(StageEntry::built("tracks", &self.track.settings).input("frames", "source"));
            stages.push(StageEntry::built("motion", &motion).input("tracks", "tracks"));
        }
        stages
    }

    /// The output that gives the points of the clip.
    pub(super) fn tracks(&self) -> &'static str {
        if self.motion.is_some() { "motion.tracks" } else { "tracks" }
    }
}

/// Containers that hold what the default codecs give; other inputs get `mp4`.
const KEPT_CONTAINERS: [&str; 4] = ["mp4", "mov", "mkv", "m4v"];

/// The extension of results that are named after their clips: that of the input where its container holds the codec, else that
/// of one that does.
pub(super) fn clip_extension(codec: Option<Codec>, inputs: &[String]) -> &'static str {
    match codec {
        Some(Codec::Prores) => "mov",
        Some(Codec::Ffv1) => "mkv",
        _ if inputs.iter().all(|input| has_extension(Path::new(input), &KEPT_CONTAINERS)) => "${item.ext}",
        _ => "mp4",
    }
}
