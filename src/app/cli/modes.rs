//! `plumbline modes`: how a mesh bends most easily, and its near-rigid parts.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{CotangentWish, MeshLoadSettings, MeshModesSettings};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry};

/// Options of `plumbline modes`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("targets").required(true).multiple(true).args(["output", "parts"]))]
pub(super) struct ModesArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// How many modes beside the rigid motions
    #[arg(short = 'k', long, default_value_t = MeshModesSettings::default().count, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1000))]
    count: u32,
    /// The NumPy archive of modes to write: values, vectors, residuals
    #[arg(short, long, value_name = "FILE.npz")]
    output: Option<PathBuf>,
    /// The file of near-rigid parts to write, as JSON
    #[arg(long, value_name = "FILE.json")]
    parts: Option<PathBuf>,
    /// Number of parts; as many as the motion needs if left out
    #[arg(long, value_name = "N", requires = "parts", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    part_count: Option<u32>,
    /// How weights of edges are taken from angles
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    cotangents: CotangentWish,
    #[command(flatten)]
    job: JobArgs,
}

impl ModesArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let path = |p: &Option<PathBuf>| p.as_ref().map(|p| literal_path(p));
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let modes = MeshModesSettings {
            count: self.count,
            cotangents: self.cotangents,
            part_count: self.part_count,
            modes: path(&self.output),
            parts: path(&self.parts),
        };
        PipelineFile {
            name: Some("modes".to_owned()),
            run: self.job.run(),
            stages: vec![StageEntry::built("mesh", &load), StageEntry::built("modes", &modes).input("mesh", "mesh")],
            ..PipelineFile::default()
        }
    }
}
