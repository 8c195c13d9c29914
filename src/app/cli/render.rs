//! `plumbline render`: pictures of meshes.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::{JobArgs, batch, only_input};
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::reference::escape;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{ImageSaveSettings, MeshLoadSettings, MeshRenderSettings};

/// Options of `plumbline render`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("target").required(true).args(["output", "out_dir"]))]
pub(super) struct RenderArgs {
    /// Meshes (obj ply off stl gltf glb): files, globs, or folders
    #[arg(required = true, value_name = "MESH")]
    inputs: Vec<String>,
    /// The picture to write, for one mesh; its extension chooses the format: png, jpg, tif or webp
    #[arg(short, long, value_name = "OUTPUT")]
    output: Option<PathBuf>,
    /// The folder to write to; pictures are called as their meshes
    #[arg(long, value_name = "DIR")]
    out_dir: Option<PathBuf>,

    #[command(flatten)]
    render: Given<Render>,

    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    #[command(flatten)]
    job: JobArgs,
}

/// What it says of `mesh.render`.
struct Render;

impl Offer for Render {
    type Kind = MeshRenderSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("size").value("WxH").under("View"),
        Setting::of("view").value("VIEW").signed().under("View"),
        Setting::of("up").value("AXIS").under("View"),
        Setting::of("wireframe").under("Look"),
        Setting::of("flat").under("Look"),
        Setting::of("colors").conflicts("scalar").under("Look"),
        Setting::of("scalar").value("FILE.npy|x|y|z").under("Look"),
        Setting::of("mark_back").under("Look"),
        Setting::of("skeleton").under("Look"),
        Setting::of("opacity").value("SHARE").under("Look"),
        Setting::of("background").value("COLOR").under("Look"),
    ];
}

impl RenderArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, session)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (source, target) = self.names()?;
        let load = MeshLoadSettings { path: source, ..MeshLoadSettings::default() };
        let save = ImageSaveSettings { path: target, ..ImageSaveSettings::default() };
        Ok(PipelineFile {
            name: Some("render".to_owned()),
            run: self.job.run(),
            batch: self.output.is_none().then(|| batch(&self.inputs, self.jobs)),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("drawn", &self.render.settings).input("mesh", "mesh"),
                StageEntry::built("picture", &save).input("image", "drawn"),
            ],
            ..PipelineFile::default()
        })
    }

    /// What is read and what is written.
    fn names(&self) -> Result<(String, String), Failure> {
        let Some(output) = &self.output else {
            let folder = literal_path(self.out_dir.as_deref().unwrap_or(Path::new(".")));
            let target = format!("{}/${{item.stem}}.png", folder.trim_end_matches('/'));
            return Ok(("${item.path}".to_owned(), target));
        };
        Ok((escape(only_input(&self.inputs, "meshes")?), literal_path(output)))
    }
}
