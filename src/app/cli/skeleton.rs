//! `plumbline skeleton`: the skeletons of meshes.

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::job::{JobArgs, batch};
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use super::target::{Names, TargetArgs};
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{MeshLoadSettings, SkeletonExtractSettings};

/// Formats of skeletons.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum SkeletonFormat {
    #[default]
    Json,
    Glb,
    Tgf,
    Skel,
    Bvh,
}

/// Options of `plumbline skeleton`.
#[derive(Debug, Args)]
pub(super) struct SkeletonArgs {
    /// Meshes (obj ply off stl gltf glb): files, globs, or folders
    #[arg(required = true, value_name = "MESH")]
    inputs: Vec<String>,
    #[command(flatten)]
    target: TargetArgs,
    /// The format of files that are named after their meshes: json (with the curve), glb (bound to the mesh), tgf, skel or bvh
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT", conflicts_with = "output")]
    format: SkeletonFormat,

    #[command(flatten)]
    extract: Given<Extract>,

    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    #[command(flatten)]
    job: JobArgs,
}

/// Options for `skeleton.extract`.
struct Extract;

impl Offer for Extract {
    type Kind = SkeletonExtractSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("joints").under("Skeleton"),
        Setting::of("prune").value("RADII").under("Skeleton"),
        Setting::of("keep").value("FILE|auto").under("Skeleton"),
        Setting::of("template").conflicts("joints").under("Skeleton"),
        Setting::of("contraction_frames").value("DIR").requires("output").under("Skeleton"),
    ];
}

impl SkeletonArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let extension = match self.format {
            SkeletonFormat::Json => "json",
            SkeletonFormat::Glb => "glb",
            SkeletonFormat::Tgf => "tgf",
            SkeletonFormat::Skel => "skel",
            SkeletonFormat::Bvh => "bvh",
        };
        let Names { source, output } = self.target.names(&self.inputs, "meshes", extension)?;
        let extract = SkeletonExtractSettings { path: Some(output), ..self.extract.settings.clone() };
        let load = MeshLoadSettings { path: source, ..MeshLoadSettings::default() };
        Ok(PipelineFile {
            name: Some("skeleton".to_owned()),
            run: self.job.run(),
            batch: self.target.is_batch().then(|| batch(&self.inputs, self.jobs)),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("skeleton", &extract).input("mesh", "mesh"),
            ],
            ..PipelineFile::default()
        })
    }
}
