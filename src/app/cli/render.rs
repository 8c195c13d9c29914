//! `plumbline render`: pictures of meshes.

use clap::Args;

use super::failure::Failure;
use super::job::{JobArgs, batch};
use super::options::{Given, Offer, Setting};
use super::run::run_or_print;
use super::session::Session;
use super::target::{Names, TargetArgs};
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{ImageSaveSettings, MeshLoadSettings, MeshRenderSettings};

/// Options of `plumbline render`.
#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    /// Meshes (obj ply off stl gltf glb): files, globs, or folders
    #[arg(required = true, value_name = "MESH")]
    inputs: Vec<String>,
    #[command(flatten)]
    target: TargetArgs,

    #[command(flatten)]
    render: Given<Render>,

    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
    #[command(flatten)]
    job: JobArgs,
}

/// What commands that also draw their result offer of `mesh.render`.
pub(super) struct RenderView;

impl Offer for RenderView {
    type Kind = MeshRenderSettings;
    const SETTINGS: &'static [Setting] =
        &[Setting::of("view").value("VIEW").signed().requires("render").under("Writing")];
}

/// Options for `mesh.render`.
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
        Setting::of("opacity").value("FRACTION").under("Look"),
        Setting::of("background").value("COLOR").under("Look"),
    ];
}

impl RenderArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let Names { source, output } = self.target.names(&self.inputs, "meshes", "png")?;
        let load = MeshLoadSettings { path: source, ..MeshLoadSettings::default() };
        let save = ImageSaveSettings { path: output, ..ImageSaveSettings::default() };
        Ok(PipelineFile {
            name: Some("render".to_owned()),
            run: self.job.run(),
            batch: self.target.is_batch().then(|| batch(&self.inputs, self.jobs)),
            stages: vec![
                StageEntry::built("mesh", &load),
                StageEntry::built("drawn", &self.render.settings).input("mesh", "mesh"),
                StageEntry::built("picture", &save).input("image", "drawn"),
            ],
            ..PipelineFile::default()
        })
    }
}
