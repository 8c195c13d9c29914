//! `plumbline compose`: parts of two meshes joined into one.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{ComposeSettings, MeshLoadSettings, MeshSaveSettings};

/// Options of `plumbline compose`.
#[derive(Debug, Args)]
pub(super) struct ComposeArgs {
    /// The base mesh, which keeps its position
    #[arg(value_name = "BASE")]
    base: PathBuf,
    /// The mesh from which a part is added
    #[arg(value_name = "PART")]
    part: PathBuf,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    #[command(flatten)]
    compose: Given<Compose>,
    #[command(flatten)]
    job: JobArgs,
}

/// Options for `mesh.compose`.
struct Compose;

impl Offer for Compose {
    type Kind = ComposeSettings;
    const SETTINGS: &'static [Setting] =
        &[Setting::of("seam").value("FILE.json"), Setting::of("report").value("FILE.html|FILE.json")];
}

impl ComposeArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let load = |path: &Path| MeshLoadSettings { path: literal_path(path), ..MeshLoadSettings::default() };
        let compose = &self.compose.settings;
        let save = MeshSaveSettings { path: literal_path(&self.output), ..Default::default() };
        let stages = vec![
            StageEntry::built("base", &load(&self.base)),
            StageEntry::built("part", &load(&self.part)),
            StageEntry::built("composed", compose).input("base", "base").input("part", "part"),
            StageEntry::built("out", &save).input("mesh", "composed"),
        ];
        PipelineFile { name: Some("compose".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() }
    }
}
