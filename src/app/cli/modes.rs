//! `plumbline modes`: vibration modes of a mesh, and its near-rigid parts.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{MeshLoadSettings, MeshModesSettings};

/// Options of `plumbline modes`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("targets").required(true).multiple(true).args(["output", "parts"]))]
pub(super) struct ModesArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    #[command(flatten)]
    modes: Given<Modes>,
    #[command(flatten)]
    job: JobArgs,
}

/// Options for `mesh.modes`.
struct Modes;

impl Offer for Modes {
    type Kind = MeshModesSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("count").short('k'),
        Setting::of("modes").named("output").short('o').value("FILE.npz"),
        Setting::of("parts").value("FILE.json"),
        Setting::of("part_count").requires("parts"),
        Setting::of("cotangents"),
    ];
}

impl ModesArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let modes = StageEntry::built("modes", &self.modes.settings).input("mesh", "mesh");
        PipelineFile {
            name: Some("modes".to_owned()),
            run: self.job.run(),
            stages: vec![StageEntry::built("mesh", &load), modes],
            ..PipelineFile::default()
        }
    }
}
