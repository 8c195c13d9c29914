//! `plumbline skin`: how a surface follows a skeleton.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::job::JobArgs;
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{MeshLoadSettings, SkinWeightsSettings, WeightWish};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry};

/// Options of `plumbline skin`.
#[derive(Debug, Args)]
pub(super) struct SkinArgs {
    #[command(subcommand)]
    command: SkinCommand,
}

#[derive(Debug, Subcommand)]
enum SkinCommand {
    /// Find how much each vertex of a mesh follows each joint of a skeleton
    Weights(WeightsArgs),
}

/// Options of `plumbline skin weights`.
#[derive(Debug, Args)]
struct WeightsArgs {
    /// The mesh at rest: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// The skeleton in it (`plumbline schema skeleton` describes the file)
    #[arg(long, value_name = "FILE.json")]
    skeleton: PathBuf,
    /// The file of weights to write (`plumbline schema weights` describes it)
    #[arg(short, long, value_name = "FILE.json")]
    output: PathBuf,
    /// How weights are found
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    method: WeightWish,
    /// Joints per vertex at most: 4 for most programs, 8 where two sets are read
    #[arg(long, default_value_t = SkinWeightsSettings::default().influences, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=64))]
    influences: u32,
    /// Rounds of smoothing over neighbors
    #[arg(long, default_value_t = SkinWeightsSettings::default().smooth, value_name = "N")]
    #[arg(value_parser = clap::value_parser!(u32).range(0..=1000))]
    smooth: u32,
    #[command(flatten)]
    job: JobArgs,
}

impl SkinArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        let SkinCommand::Weights(args) = &self.command;
        run_or_print(args.pipeline(), args.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> PipelineFile {
        let SkinCommand::Weights(args) = &self.command;
        args.pipeline()
    }
}

impl WeightsArgs {
    fn pipeline(&self) -> PipelineFile {
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let weights = SkinWeightsSettings {
            skeleton: literal_path(&self.skeleton),
            method: self.method,
            influences: self.influences,
            smooth: self.smooth,
            path: literal_path(&self.output),
        };
        PipelineFile {
            name: Some("skin".to_owned()),
            run: self.job.run(),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("weights", &weights).input("mesh", "mesh"),
            ],
            ..PipelineFile::default()
        }
    }
}
