//! `plumbline motion`: the motion of the camera, in the image plane and in space, as files for other programs and later runs.

use clap::{ArgGroup, Args};

use super::clip::ClipArgs;
use super::job::path_text;
use super::prelude::*;
use crate::pipeline::reference::escape;
use crate::stages::MotionExportSettings;

/// Options of `plumbline motion`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("targets").required(true).multiple(true).args(["output", "colmap", "gltf", "csv"]))]
pub(super) struct MotionArgs {
    /// The clip
    #[arg(value_parser = path_text(), value_name = "INPUT")]
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

impl BuildsPipeline for MotionArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let mut stages = self.clip.analysis(escape(&self.input), true);
        let export = StageEntry::built("files", &self.export.settings);
        stages.push(export.input("motion", "motion").input("tracks", self.clip.tracks()));
        Ok(PipelineFile::built("motion", stages))
    }
}
