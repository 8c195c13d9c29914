//! `plumbline skin`: how a surface follows a skeleton.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::job::{JobArgs, WeightsArg};
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{
    BindingWish, MeshLoadSettings, SkeletonLoadSettings, SkinTrainSettings, SkinWeightsSettings,
};
use crate::pipeline::reference::escape;
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, number_for};

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
    /// Learn from poses of a mesh how it follows a skeleton
    Train(Box<TrainArgs>),
}

/// Options of `plumbline skin weights`.
#[derive(Debug, Args)]
struct WeightsArgs {
    /// The mesh at rest: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// The skeleton in it: our own JSON, glTF, GLB, BVH, .tgf or .skel
    #[arg(long, value_name = "FILE")]
    skeleton: PathBuf,
    /// The file of weights to write (`plumbline schema weights` describes it)
    #[arg(short, long, value_name = "FILE.json")]
    output: PathBuf,
    /// How weights are found
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    method: BindingWish,
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

/// Options of `plumbline skin train`.
#[derive(Debug, Args)]
struct TrainArgs {
    /// The mesh at rest: OBJ, PLY, OFF or STL with --skeleton, glTF or GLB also with a skin of its own
    #[arg(value_name = "REST")]
    input: PathBuf,
    /// Meshes of the same vertices and faces in other poses: files, globs or folders
    #[arg(long, required = true, num_args = 1.., value_name = "FILES")]
    examples: Vec<String>,
    /// The skeleton in the mesh: our own JSON, glTF, GLB, BVH, .tgf or .skel; that of REST, with its weights, if left out
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// The file of the model to write, for `plumbline pose --skinning regression --model`
    #[arg(short, long, value_name = "FILE.skin")]
    output: PathBuf,

    /// Meshes that are not learnt from, also where they are among the examples, but tell how well the model does
    #[arg(long, num_args = 1.., value_name = "FILES", help_heading = "Examples")]
    held_out: Vec<String>,
    /// Pose files called as the meshes, that say how the joints stand; from the meshes themselves if left out
    #[arg(long, num_args = 1.., value_name = "FILES", help_heading = "Examples")]
    poses: Vec<String>,
    /// How the mesh is bound to --skeleton: heat, biharmonic, distance, or a file of weights
    #[arg(long, default_value_t, value_name = "HOW|FILE", help_heading = "Examples", requires = "skeleton")]
    weights: WeightsArg,

    /// Ridge on what is learnt of the joints' turns, rad²: larger trusts the examples less; found by leaving examples out if left
    /// out
    #[arg(long, value_name = "NUMBER", help_heading = "Learning")]
    #[arg(value_parser = |text: &str| number_for::<SkinTrainSettings>("ridge", text))]
    ridge: Option<f64>,
    /// How much linear blending is believed beside what triangles have learnt; found by leaving examples out if left out
    #[arg(long, value_name = "NUMBER", help_heading = "Learning")]
    #[arg(value_parser = |text: &str| number_for::<SkinTrainSettings>("hold", text))]
    hold: Option<f64>,
    /// Keep N shapes for each joint in the mean, where they are needed most, in place of all triangles: poses without a solve
    #[arg(long, value_name = "N", help_heading = "Learning", value_parser = clap::value_parser!(u32).range(1..=32))]
    prototypes: Option<u32>,

    /// Also write how it went, as JSON
    #[arg(long, value_name = "FILE.json")]
    report: Option<PathBuf>,
    #[command(flatten)]
    job: JobArgs,
}

impl SkinArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job().print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> PipelineFile {
        match &self.command {
            SkinCommand::Weights(args) => args.pipeline(),
            SkinCommand::Train(args) => args.pipeline(),
        }
    }

    fn job(&self) -> &JobArgs {
        match &self.command {
            SkinCommand::Weights(args) => &args.job,
            SkinCommand::Train(args) => &args.job,
        }
    }
}

impl TrainArgs {
    fn pipeline(&self) -> PipelineFile {
        let patterns = |list: &[String]| list.iter().map(|pattern| escape(pattern)).collect();
        let train = SkinTrainSettings {
            examples: patterns(&self.examples),
            held_out: patterns(&self.held_out),
            poses: patterns(&self.poses),
            binding: self.weights.binding(),
            weights: self.weights.file(),
            ridge: self.ridge,
            hold: self.hold,
            prototypes: self.prototypes,
            path: literal_path(&self.output),
            report: self.report.as_ref().map(|path| literal_path(path)),
        };
        of_mesh_and_skeleton(&self.input, self.skeleton.as_deref(), StageEntry::built("model", &train), &self.job)
    }
}

impl WeightsArgs {
    fn pipeline(&self) -> PipelineFile {
        let weights = SkinWeightsSettings {
            method: self.method,
            influences: self.influences,
            smooth: self.smooth,
            path: literal_path(&self.output),
        };
        of_mesh_and_skeleton(&self.input, Some(&self.skeleton), StageEntry::built("weights", &weights), &self.job)
    }
}

/// Loads the mesh, and the skeleton where one is given, and hands them to the stage that does the work.
fn of_mesh_and_skeleton(mesh: &Path, skeleton: Option<&Path>, works: StageEntry, job: &JobArgs) -> PipelineFile {
    let mesh = MeshLoadSettings { path: literal_path(mesh), ..MeshLoadSettings::default() };
    let mut works = works.input("mesh", "mesh");
    let mut stages = vec![StageEntry::built("mesh", &mesh)];
    if let Some(path) = skeleton {
        stages.push(StageEntry::built("skeleton", &SkeletonLoadSettings { path: literal_path(path) }));
        works = works.input("skeleton", "skeleton");
    }
    stages.push(works);
    PipelineFile { name: Some("skin".to_owned()), run: job.run(), stages, ..PipelineFile::default() }
}
