//! `plumbline blend`: two meshes blended with painted weights.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{BlendSettings, MeshLoadSettings, MeshSaveSettings};

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

    #[command(flatten)]
    blend: Given<Blend>,

    #[command(flatten)]
    job: JobArgs,
}

/// Options for `mesh.blend`.
struct Blend;

impl Offer for Blend {
    type Kind = BlendSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("paint").value("FILE.json"),
        Setting::of("frames"),
        Setting::of("landmarks").under("Method"),
        Setting::of("iterations").under("Method"),
        Setting::of("report").value("FILE.html|FILE.json"),
    ];
}

impl BlendArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let load = |path: &Path| MeshLoadSettings { path: literal_path(path), ..MeshLoadSettings::default() };
        let blend = &self.blend.settings;
        let save = MeshSaveSettings { path: literal_path(&self.output), frames: blend.frames, ..Default::default() };
        let stages = vec![
            StageEntry::built("first", &load(&self.first)),
            StageEntry::built("second", &load(&self.second)),
            StageEntry::built("blend", blend).input("mesh", "first").input("other", "second"),
            StageEntry::built("out", &save).input("mesh", "blend"),
        ];
        PipelineFile { name: Some("blend".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() }
    }
}
