//! `plumbline deform`: a mesh in another pose. Builds the same graph as `pipeline/deform-mesh.toml`.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::job::JobArgs;
use super::options::{Given, Offer, Setting};
use super::render::RenderView;
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{ImageSaveSettings, MeshDeformSettings, MeshLoadSettings, MeshRenderSettings, MeshSaveSettings};

/// Options of `plumbline deform`.
#[derive(Debug, Args)]
pub(super) struct DeformArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF or GLB
    #[arg(value_name = "MESH")]
    input: PathBuf,
    #[command(flatten)]
    deform: Given<Deform>,
    /// The file to write; its extension chooses the format
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    /// Also draw the last pose, with the handles as dots
    #[arg(long, value_name = "FILE.png", help_heading = "Writing")]
    render: Option<PathBuf>,
    #[command(flatten)]
    view: Given<RenderView>,

    #[command(flatten)]
    job: JobArgs,
}

/// Options for `mesh.deform`.
struct Deform;

impl Offer for Deform {
    type Kind = MeshDeformSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("handles").value("FILE.json"),
        Setting::of("method").value("METHOD").under("Method"),
        Setting::of("roi").value("DISTANCE").under("Method"),
        Setting::of("iterations").under("Method"),
        Setting::of("tolerance").value("FRACTION").under("Method"),
        Setting::of("cotangents").under("Method"),
        Setting::of("solver").under("Method"),
        Setting::of("init").value("FROM").under("Method"),
        Setting::of("laplacian").value("WHAT").under("Method"),
        Setting::of("rotation_estimation").value("HOW").under("Method"),
        Setting::of("unconstrained").under("Method"),
        Setting::of("frames").under("Writing"),
        Setting::of("report").value("FILE.html|FILE.json").under("Writing"),
    ];
}

impl DeformArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    #[expect(clippy::unnecessary_wraps, reason = "as every command that builds a pipeline")]
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let deform = &self.deform.settings;
        let save = MeshSaveSettings { path: literal_path(&self.output), frames: deform.frames, ..Default::default() };
        let mut stages = vec![
            StageEntry::built("mesh", &load),
            StageEntry::built("posed", deform).input("mesh", "mesh"),
            StageEntry::built("out", &save).input("mesh", "posed"),
        ];
        if let Some(path) = &self.render {
            let render = MeshRenderSettings { view: self.view.settings.view, ..MeshRenderSettings::default() };
            let picture = ImageSaveSettings { path: literal_path(path), ..ImageSaveSettings::default() };
            stages.push(StageEntry::built("drawn", &render).input("mesh", "posed"));
            stages.push(StageEntry::built("picture", &picture).input("image", "drawn"));
        }
        Ok(PipelineFile { name: Some("deform".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() })
    }
}
