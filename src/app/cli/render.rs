//! `plumbline render`: pictures of meshes.

use super::mesh_stages::{MeshesArgs, picture};
use super::prelude::*;
use crate::stages::MeshRenderSettings;

/// Options of `plumbline render`.
#[derive(Debug, Args)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    meshes: MeshesArgs,
    #[command(flatten)]
    render: Given<Render>,
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
        Setting::of("labels").under("Look"),
        Setting::of("opacity").value("FRACTION").under("Look"),
        Setting::of("background").value("COLOR").under("Look"),
    ];
}

impl BuildsPipeline for RenderArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let drawn = StageEntry::built("drawn", &self.render.settings).input("mesh", "mesh");
        self.meshes.pipeline("render", "png", |output| vec![drawn, picture(output)])
    }
}
