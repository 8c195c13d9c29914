//! `plumbline motion`: the motion of the camera, in the image plane and in space, as files for other programs and later runs.

use clap::{ArgGroup, Args};

use super::clip::ClipArgs;
use super::failure::Failure;
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::reference::escape;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::MotionExportSettings;

/// Options of `plumbline motion`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("targets").required(true).multiple(true).args(["output", "colmap", "gltf", "csv"]))]
pub(super) struct MotionArgs {
    /// The clip
    #[arg(value_name = "INPUT")]
    input: String,
    #[command(flatten)]
    export: Given<Export>,
    #[command(flatten)]
    clip: ClipArgs,
}

/// Options for `video.motion_export`.
struct Export;

impl Offer for Export {
    type Kind = MotionExportSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("path").named("output").short('o').value("FILE.json"),
        Setting::of("colmap").value("DIR"),
        Setting::of("gltf").value("FILE"),
        Setting::of("csv").value("FILE.csv"),
    ];
}

impl MotionArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.clip.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    fn pipeline(&self) -> PipelineFile {
        let mut stages = self.clip.analysis(escape(&self.input), true);
        let export = StageEntry::built("files", &self.export.settings);
        stages.push(export.input("motion", "motion").input("tracks", self.clip.tracks()));
        PipelineFile { name: Some("motion".to_owned()), run: self.clip.job.run(), stages, ..PipelineFile::default() }
    }
}
