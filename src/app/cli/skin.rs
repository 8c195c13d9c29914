//! `plumbline skin`: skinning weights, and skins learned from examples.

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::job::{JobArgs, WeightsArg};
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{MeshLoadSettings, SkeletonLoadSettings, SkinTrainSettings, SkinWeightsSettings};

/// Options of `plumbline skin`.
#[derive(Debug, Args)]
pub(super) struct SkinArgs {
    #[command(subcommand)]
    command: SkinCommand,
}

#[derive(Debug, Subcommand)]
enum SkinCommand {
    /// Compute the skinning weights of a mesh for a skeleton
    Weights(WeightsArgs),
    /// Learn a skin from poses of a mesh (rotational regression)
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
    #[command(flatten)]
    weights: Given<Weights>,
    #[command(flatten)]
    job: JobArgs,
}

/// Options of `plumbline skin train`.
#[derive(Debug, Args)]
struct TrainArgs {
    /// The mesh at rest: OBJ, PLY, OFF or STL with --skeleton, glTF or GLB also with a skin of its own
    #[arg(value_name = "REST")]
    input: PathBuf,
    /// The skeleton in the mesh: our own JSON, glTF, GLB, BVH, .tgf or .skel; that of REST, with its weights, if left out
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    #[command(flatten)]
    train: Given<Train>,
    /// How the mesh is bound to --skeleton: heat, biharmonic, distance, or a file of weights
    #[arg(long, default_value_t, value_name = "HOW|FILE", help_heading = "Examples", requires = "skeleton")]
    weights: WeightsArg,
    #[command(flatten)]
    job: JobArgs,
}

/// What `plumbline skin weights` says of `skin.weights`.
struct Weights;

impl Offer for Weights {
    type Kind = SkinWeightsSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("path").named("output").short('o').value("FILE.json"),
        Setting::of("method").aliases(&[("biharmonic", "bbw")]),
        Setting::of("influences"),
        Setting::of("smooth"),
    ];
}

/// What `plumbline skin train` says of `skin.train`.
struct Train;

impl Offer for Train {
    type Kind = SkinTrainSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("examples").value("FILES"),
        Setting::of("path").named("output").short('o').value("FILE.skin"),
        Setting::of("held_out").value("FILES").under("Examples"),
        Setting::of("poses").value("FILES").under("Examples"),
        Setting::of("ridge").value("NUMBER").under("Learning"),
        Setting::of("hold").value("NUMBER").under("Learning"),
        Setting::of("prototypes").under("Learning"),
        Setting::of("report").value("FILE.html|FILE.json"),
    ];
}

impl SkinArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline(), self.job().print_pipeline, session)
    }

    /// The pipeline that the options stand for.
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
        let train = SkinTrainSettings {
            binding: self.weights.binding(),
            weights: self.weights.file(),
            ..self.train.settings.clone()
        };
        of_mesh_and_skeleton(&self.input, self.skeleton.as_deref(), StageEntry::built("model", &train), &self.job)
    }
}

impl WeightsArgs {
    fn pipeline(&self) -> PipelineFile {
        let weights = &self.weights.settings;
        of_mesh_and_skeleton(&self.input, Some(&self.skeleton), StageEntry::built("weights", weights), &self.job)
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
