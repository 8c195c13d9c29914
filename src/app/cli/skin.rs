//! `plumbline skin`: skinning weights, and skins learned from examples.

use std::path::PathBuf;

use clap::Subcommand;

use super::job::{JobArgs, JobCommand, WeightsArg};
use super::mesh_stages::with_skeleton;
use super::prelude::*;
use crate::stages::{SkinTrainSettings, SkinWeightsSettings};

/// Options of `plumbline skin`.
#[derive(Debug, Args)]
pub(super) struct SkinArgs {
    #[command(subcommand)]
    command: SkinCommand,
}

#[derive(Debug, Subcommand)]
enum SkinCommand {
    /// Compute the skinning weights of a mesh for a skeleton
    Weights(Box<JobCommand<WeightsArgs>>),
    /// Learn a skin from poses of a mesh (rotational regression)
    Train(Box<JobCommand<TrainArgs>>),
}

/// Options of `plumbline skin weights`.
#[derive(Debug, Args)]
struct WeightsArgs {
    /// The mesh at rest: OBJ, PLY, OFF, STL, glTF, GLB or FBX
    #[arg(value_name = "MESH")]
    input: PathBuf,
    /// The skeleton in it: our own JSON, glTF, GLB, FBX, BVH, .tgf or .skel
    #[arg(long, value_name = "FILE")]
    skeleton: PathBuf,
    #[command(flatten)]
    weights: Given<Weights>,
}

/// Options of `plumbline skin train`.
#[derive(Debug, Args)]
struct TrainArgs {
    /// The mesh at rest: OBJ, PLY, OFF or STL with --skeleton, glTF, GLB or FBX also with a skin of its own
    #[arg(value_name = "REST")]
    input: PathBuf,
    /// The skeleton in the mesh: our own JSON, glTF, GLB, FBX, BVH, .tgf or .skel; that of REST, with its weights, if left out
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    #[command(flatten)]
    train: Given<Train>,
    /// How the mesh is bound to --skeleton: heat, biharmonic, distance, or a file of weights
    #[arg(long, default_value_t, value_name = "HOW|FILE", help_heading = "Examples", requires = "skeleton")]
    weights: WeightsArg,
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
    /// The options of the subcommand, and how the job runs.
    pub(super) fn parts(&self) -> (&dyn BuildsPipeline, &JobArgs) {
        match &self.command {
            SkinCommand::Weights(command) => command.parts(),
            SkinCommand::Train(command) => command.parts(),
        }
    }
}

impl BuildsPipeline for TrainArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let train = SkinTrainSettings {
            binding: self.weights.binding(),
            weights: self.weights.file(),
            ..self.train.settings.clone()
        };
        let stages = with_skeleton(&self.input, self.skeleton.as_deref(), StageEntry::built("model", &train));
        Ok(PipelineFile::built("skin", stages))
    }
}

impl BuildsPipeline for WeightsArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let weights = StageEntry::built("weights", &self.weights.settings);
        Ok(PipelineFile::built("skin", with_skeleton(&self.input, Some(&self.skeleton), weights)))
    }
}
