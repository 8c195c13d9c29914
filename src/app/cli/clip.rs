//! Options of every command that analyzes a clip: what of it is read, how its motion is found, how the run goes.

use std::path::PathBuf;

use clap::Args;

use super::job::JobArgs;
use super::options::choice;
use crate::pipeline::StageEntry;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{DecodeSettings, MotionImportSettings, MotionSettings, RollingShutter, TrackSettings};
use crate::pipeline::units::{ClipTime, FrameRate};
use plumbline_media::Deinterlace;

/// Options that `stabilize` and `motion` share.
#[derive(Debug, Args)]
pub(super) struct ClipArgs {
    /// First position to read: seconds or [HH:]MM:SS
    #[arg(long, value_name = "TIME")]
    start: Option<ClipTime>,
    /// Position to stop before
    #[arg(long, value_name = "TIME")]
    end: Option<ClipTime>,
    /// Frames per second of an image sequence, such as 24 or 30000/1001; 25 if left out
    #[arg(long, value_name = "RATE")]
    fps: Option<FrameRate>,
    /// What happens to interlaced pictures
    #[arg(long, default_value = "auto", value_name = "HOW", value_parser = choice::<Deinterlace>(&[]))]
    deinterlace: Deinterlace,

    /// Take motion and points from here in place of tracking: plumbline.motion JSON, or the folder of a COLMAP model
    #[arg(long, value_name = "FILE|DIR", conflicts_with = "mask", help_heading = "Analysis")]
    pub(super) motion: Option<PathBuf>,
    /// Picture of the clip's shape: nothing is tracked where it is white
    #[arg(long, value_name = "FILE", help_heading = "Analysis")]
    mask: Option<PathBuf>,
    /// Rolling-shutter correction: auto, off, or the sensor's readout time in seconds
    #[arg(long, default_value_t, value_name = "auto|off|SECONDS", help_heading = "Analysis")]
    rolling_shutter: RollingShutter,

    #[command(flatten)]
    pub(super) job: JobArgs,
}

impl ClipArgs {
    /// Stages `source` and `motion`, and `tracks` where the clip is tracked; `source`: the clip, `cameras`: those in space too.
    pub(super) fn analysis(&self, source: String, cameras: bool) -> Vec<StageEntry> {
        let decode = DecodeSettings {
            path: source,
            start: self.start,
            end: self.end,
            fps: self.fps,
            deinterlace: self.deinterlace,
        };
        let mut stages = vec![StageEntry::built("source", &decode)];
        if let Some(file) = &self.motion {
            let import =
                MotionImportSettings { path: literal_path(file), rolling_shutter: self.rolling_shutter, cameras };
            stages.push(StageEntry::built("motion", &import).input("frames", "source"));
        } else {
            let mask = self.mask.as_ref().map(|m| PathBuf::from(literal_path(m)));
            let track = TrackSettings { mask, ..TrackSettings::default() };
            let motion = MotionSettings { rolling_shutter: self.rolling_shutter, cameras };
            stages.push(StageEntry::built("tracks", &track).input("frames", "source"));
            stages.push(StageEntry::built("motion", &motion).input("tracks", "tracks"));
        }
        stages
    }

    /// The output that gives the points of the clip.
    pub(super) fn tracks(&self) -> &'static str {
        if self.motion.is_some() { "motion.tracks" } else { "tracks" }
    }
}
