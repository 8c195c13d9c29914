//! `plumbline skeleton`: the skeletons of meshes.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::job::{JobArgs, batch, only_input};
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{MeshLoadSettings, SkeletonExtractSettings};
use crate::pipeline::reference::escape;
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, number_for};

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
#[command(group = clap::ArgGroup::new("target").required(true).args(["output", "out_dir"]))]
pub(super) struct SkeletonArgs {
    /// Meshes (obj ply off stl gltf glb): files, globs, or folders
    #[arg(required = true, value_name = "MESH")]
    inputs: Vec<String>,
    /// The file to write, for one mesh; its extension chooses the format: json (with the curve), glb (bound to the mesh), tgf,
    /// skel or bvh
    #[arg(short, long, value_name = "OUTPUT")]
    output: Option<PathBuf>,
    /// The folder to write to; skeletons are called as their meshes
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,
    /// The format of files in `--out-dir`
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT", requires = "out_dir")]
    format: SkeletonFormat,

    /// About how many joints; as many as bends, ends and junctions need if left out
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), help_heading = "Skeleton")]
    joints: Option<u32>,
    /// Branches whose end sticks out of the rest of the shape by less than this share of its own half-width are taken away
    #[arg(long, default_value_t = SkeletonExtractSettings::default().prune, value_name = "SHARE", help_heading = "Skeleton")]
    #[arg(value_parser = |text: &str| number_for::<SkeletonExtractSettings>("prune", text))]
    prune: f64,
    /// Ends that stay: auto, the tips of the surface, or a file with numbers of vertices, from 0
    #[arg(long, value_name = "FILE|auto", help_heading = "Skeleton")]
    keep: Option<String>,
    /// A skeleton whose joints are fitted to the curve (json glb gltf bvh tgf skel); its names, parents and limits stay
    #[arg(long, value_name = "FILE", conflicts_with = "joints", help_heading = "Skeleton")]
    template: Option<PathBuf>,
    /// A folder for the surface after each round of contraction, as .obj
    #[arg(long, value_name = "DIR", requires = "output", help_heading = "Skeleton")]
    contraction_frames: Option<PathBuf>,

    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    #[command(flatten)]
    job: JobArgs,
}

impl SkeletonArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (source, target) = self.names()?;
        let extract = SkeletonExtractSettings {
            path: Some(target),
            joints: self.joints,
            prune: self.prune,
            keep: self.keep.as_ref().map(|s| escape(s)),
            template: self.template.as_ref().map(|path| literal_path(path)),
            contraction_frames: self.contraction_frames.as_ref().map(|path| literal_path(path)),
        };
        let load = MeshLoadSettings { path: source, ..MeshLoadSettings::default() };
        Ok(PipelineFile {
            name: Some("skeleton".to_owned()),
            run: self.job.run(),
            batch: self.output.is_none().then(|| batch(&self.inputs, self.jobs)),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("skeleton", &extract).input("mesh", "mesh"),
            ],
            ..PipelineFile::default()
        })
    }

    /// What is read and what is written.
    fn names(&self) -> Result<(String, String), Failure> {
        let Some(output) = &self.output else {
            let folder = literal_path(self.out_dir.as_deref().unwrap_or(Path::new(".")));
            let extension = match self.format {
                SkeletonFormat::Json => "json",
                SkeletonFormat::Glb => "glb",
                SkeletonFormat::Tgf => "tgf",
                SkeletonFormat::Skel => "skel",
                SkeletonFormat::Bvh => "bvh",
            };
            let target = format!("{}/${{item.stem}}.{extension}", folder.trim_end_matches('/'));
            return Ok(("${item.path}".to_owned(), target));
        };
        Ok((escape(only_input(&self.inputs, "meshes")?), literal_path(output)))
    }
}
