//! `plumbline motion`: how the camera moved, in the picture and in space, as a file for other programs.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::run::run_pipeline;
use super::tell;
use crate::pipeline::file::{entries_of, literal_path};
use crate::pipeline::kinds::{DecodeSettings, MotionSettings, RollingShutter, TrackSettings};
use crate::pipeline::options::{ProgressMode, RunSettings};
use crate::pipeline::reference::escape;
use crate::pipeline::units::ClipTime;
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, check, print};

/// Options of `plumbline motion`.
#[derive(Debug, Args)]
pub(super) struct MotionArgs {
    /// The clip
    #[arg(value_name = "INPUT")]
    input: String,
    /// The file to write, plumbline.motion JSON
    #[arg(short, long, value_name = "FILE.json")]
    output: PathBuf,
    /// Replace existing files
    #[arg(long)]
    overwrite: bool,
    /// First position to read: seconds or [HH:]MM:SS
    #[arg(long, value_name = "TIME")]
    start: Option<ClipTime>,
    /// Position to stop before
    #[arg(long, value_name = "TIME")]
    end: Option<ClipTime>,
    /// Picture of the clip's shape: nothing is tracked where it is white
    #[arg(long, value_name = "FILE")]
    mask: Option<PathBuf>,
    /// Rolling shutter: auto, off, or the sensor's readout time in seconds
    #[arg(long, default_value_t, value_name = "auto|off|SECONDS")]
    rolling_shutter: RollingShutter,
    /// Print the pipeline that these options mean, and do nothing
    #[arg(long)]
    print_pipeline: bool,
    /// Threads for the whole run; 0 = all processors
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=4096))]
    threads: u32,
    /// How progress is told
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    progress: ProgressMode,
}

impl MotionArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        let file = self.pipeline();
        if self.print_pipeline {
            tell(&print(&file));
            return Ok(Exit::Done);
        }
        run_pipeline(&check(file)?, backend)
    }

    /// The pipeline that the options mean.
    fn pipeline(&self) -> PipelineFile {
        let run = RunSettings { threads: self.threads, overwrite: self.overwrite, progress: self.progress };
        let decode =
            DecodeSettings { path: escape(&self.input), start: self.start, end: self.end, ..DecodeSettings::default() };
        let mask = self.mask.as_ref().map(|m| literal_path(m));
        let motion = MotionSettings {
            rolling_shutter: self.rolling_shutter,
            cameras: true,
            export: Some(literal_path(&self.output)),
        };
        PipelineFile {
            name: Some("motion".to_owned()),
            run: entries_of(&run, &RunSettings::default()),
            stages: vec![
                StageEntry::built("source", &decode),
                StageEntry::built("tracks", &TrackSettings { mask, ..TrackSettings::default() })
                    .input("frames", "source"),
                StageEntry::built("motion", &motion).input("tracks", "tracks"),
            ],
            ..PipelineFile::default()
        }
    }
}
