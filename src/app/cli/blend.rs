//! `plumbline blend`: two meshes mixed as painted.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{BlendSettings, MeshLoadSettings, MeshSaveSettings};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry};

/// Options of `plumbline blend`.
#[derive(Debug, Args)]
pub(super) struct BlendArgs {
    /// The mesh where 0 is painted, whose faces the blend has
    #[arg(value_name = "FIRST")]
    first: PathBuf,
    /// The mesh where 1 is painted: another pose of the first, or any mesh with --landmarks
    #[arg(value_name = "SECOND")]
    second: PathBuf,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    /// Times painted on the first mesh (`plumbline schema paint` describes the file)
    #[arg(long, value_name = "FILE.json")]
    paint: PathBuf,
    /// Shapes on the way from the first mesh to the blend, as NAME_0000.EXT and so on
    #[arg(long, default_value_t = BlendSettings::default().frames, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=9999))]
    frames: u32,
    /// Places of both meshes that belong together (`plumbline schema landmarks`, .cons or .yml)
    #[arg(long, value_name = "FILE", help_heading = "Method")]
    landmarks: Option<PathBuf>,
    /// Rounds in which the shape is made more rigid towards both meshes
    #[arg(long, default_value_t = BlendSettings::default().rounds, value_name = "N", help_heading = "Method")]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=10_000))]
    rounds: u32,

    /// Also write how it went, as JSON, with the self-intersections of every shape
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    #[command(flatten)]
    job: JobArgs,
}

impl BlendArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let load = |path: &Path| MeshLoadSettings { path: literal_path(path), ..MeshLoadSettings::default() };
        let blend = BlendSettings {
            paint: literal_path(&self.paint),
            landmarks: self.landmarks.as_ref().map(|path| literal_path(path)),
            frames: self.frames,
            rounds: self.rounds,
            report: self.report.as_ref().map(|path| literal_path(path)),
        };
        let save = MeshSaveSettings { path: literal_path(&self.output), frames: self.frames, ..Default::default() };
        let stages = vec![
            StageEntry::built("first", &load(&self.first)),
            StageEntry::built("second", &load(&self.second)),
            StageEntry::built("blend", &blend).input("mesh", "first").input("other", "second"),
            StageEntry::built("out", &save).input("mesh", "blend"),
        ];
        PipelineFile { name: Some("blend".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() }
    }
}
