//! `plumbline motion`: how the camera moved, in the picture and in space, as files for other programs and later runs.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::clip::ClipArgs;
use super::failure::Failure;
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
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
    /// Write motion, cameras and points as plumbline.motion JSON, which --motion reads again
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// Write a COLMAP model, as text and binary; a folder in it per shot where several have cameras
    #[arg(long, value_name = "DIR")]
    colmap: Option<PathBuf>,
    /// Write a glTF scene, cameras animated, points as a cloud: .glb, or .gltf with its numbers embedded
    #[arg(long, value_name = "FILE")]
    gltf: Option<PathBuf>,
    /// Write a table with one line per frame
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    #[command(flatten)]
    clip: ClipArgs,
}

impl MotionArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.clip.job.print_pipeline, session)
    }

    /// The pipeline that the options mean.
    fn pipeline(&self) -> PipelineFile {
        let path = |p: &Option<PathBuf>| p.as_ref().map(|p| literal_path(p));
        let export = MotionExportSettings {
            path: path(&self.output),
            colmap: path(&self.colmap),
            gltf: path(&self.gltf),
            csv: path(&self.csv),
        };
        let mut stages = self.clip.analysis(escape(&self.input), true);
        let export = StageEntry::built("files", &export);
        stages.push(export.input("motion", "motion").input("tracks", self.clip.tracks()));
        PipelineFile { name: Some("motion".to_owned()), run: self.clip.job.run(), stages, ..PipelineFile::default() }
    }
}
