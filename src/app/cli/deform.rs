//! `plumbline deform`: a mesh in another pose. Builds the same graph as `pipeline/deform-mesh.toml`.

use std::path::PathBuf;

use super::mesh_stages::{also_drawn, mesh};
use super::prelude::*;
use super::render::RenderView;
use crate::pipeline::number_for;
use crate::stages::{MeshDeformSettings, MeshSaveSettings};
use plumbline_shape::mesh::MeshFormat;

/// Options of `plumbline deform`.
#[derive(Debug, Args)]
pub(super) struct DeformArgs {
    /// The mesh: OBJ, PLY, OFF, STL, glTF, GLB or FBX
    #[arg(value_name = "MESH")]
    input: PathBuf,
    #[command(flatten)]
    deform: Given<Deform>,
    /// The file to write; its extension chooses the format. Of several poses a .glb or .gltf has all as morph targets
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,
    /// Duration of poses as morph targets, in seconds
    #[arg(long, default_value_t = 2.0, value_name = "S", help_heading = "Writing")]
    #[arg(value_parser = |text: &str| number_for::<MeshSaveSettings>("seconds", text))]
    seconds: f64,

    /// Also draw the last pose, with the handles as dots
    #[arg(long, value_name = "FILE.png", help_heading = "Writing")]
    render: Option<PathBuf>,
    #[command(flatten)]
    view: Given<RenderView>,
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

impl BuildsPipeline for DeformArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let deform = &self.deform.settings;
        let moves = matches!(MeshFormat::of_name(&self.output), Some(MeshFormat::Glb | MeshFormat::Gltf));
        let seconds = (moves && deform.frames > 1).then_some(self.seconds);
        let (path, frames) = (literal_path(&self.output), deform.frames);
        let save = MeshSaveSettings { path, frames, seconds, ..MeshSaveSettings::default() };
        let mut stages = vec![
            mesh("mesh", literal_path(&self.input)),
            StageEntry::built("posed", deform).input("mesh", "mesh"),
            StageEntry::built("out", &save).input("mesh", "posed"),
        ];
        stages.extend(also_drawn(self.render.as_ref(), &self.view));
        Ok(PipelineFile::built("deform", stages))
    }
}
