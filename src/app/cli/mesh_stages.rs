//! Stages that several commands on meshes build.

use std::path::{Path, PathBuf};

use super::job::path_text;
use super::prelude::*;
use super::render::RenderView;
use super::target::{Names, TargetArgs};
use crate::stages::{ImageSaveSettings, MeshLoadSettings, MeshRenderSettings, MeshSaveSettings, SkeletonLoadSettings};

/// Options of commands that do the same with each of many meshes.
#[derive(Debug, Args)]
pub(super) struct MeshesArgs {
    /// Meshes (obj ply off stl gltf glb fbx): files, globs, or folders
    #[arg(required = true, value_parser = path_text(), value_name = "MESH")]
    inputs: Vec<String>,
    #[command(flatten)]
    target: TargetArgs,
    /// Meshes at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    jobs: u32,
}

impl MeshesArgs {
    /// `mesh`, which opens each mesh and mends its vertices, before the stages that write the path that they get; results that are named
    /// after their meshes have this extension.
    pub(super) fn pipeline(
        &self,
        name: &str,
        extension: &str,
        stages: impl FnOnce(String) -> Vec<StageEntry>,
    ) -> Result<PipelineFile, Failure> {
        let Names { source, output } = self.target.names(&self.inputs, "meshes", extension)?;
        let load = MeshLoadSettings { path: source, mend_vertices: true, ..MeshLoadSettings::default() };
        let mut all = vec![StageEntry::built("mesh", &load)];
        all.extend(stages(output));
        Ok(PipelineFile { batch: self.target.batch(&self.inputs, self.jobs), ..PipelineFile::built(name, all) })
    }
}

/// The stage `name` that opens the mesh `path`, a template.
pub(super) fn mesh(name: &str, path: String) -> StageEntry {
    StageEntry::built(name, &MeshLoadSettings { path, ..MeshLoadSettings::default() })
}

/// `mesh`, which opens the mesh, and `skeleton` where one is given, before the stage `works` that takes them.
pub(super) fn with_skeleton(input: &Path, skeleton: Option<&Path>, works: StageEntry) -> Vec<StageEntry> {
    let (mut stages, mut works) = (vec![mesh("mesh", literal_path(input))], works.input("mesh", "mesh"));
    if let Some(path) = skeleton {
        stages.push(StageEntry::built("skeleton", &SkeletonLoadSettings { path: literal_path(path) }));
        works = works.input("skeleton", "skeleton");
    }
    stages.push(works);
    stages
}

/// `out`, which writes so many poses of the mesh that stage `from` gives.
pub(super) fn saved(path: &Path, frames: u32, from: &str) -> StageEntry {
    let save = MeshSaveSettings { path: literal_path(path), frames, ..MeshSaveSettings::default() };
    StageEntry::built("out", &save).input("mesh", from)
}

/// `picture`, which writes what `drawn` gives to `path`, a template.
pub(super) fn picture(path: String) -> StageEntry {
    StageEntry::built("picture", &ImageSaveSettings { path, ..ImageSaveSettings::default() }).input("image", "drawn")
}

/// `drawn` and `picture`, where the mesh of stage `posed` is to be drawn too.
pub(super) fn also_drawn(path: Option<&PathBuf>, view: &Given<RenderView>) -> Vec<StageEntry> {
    let Some(path) = path else { return Vec::new() };
    let render = MeshRenderSettings { view: view.settings.view, ..MeshRenderSettings::default() };
    vec![StageEntry::built("drawn", &render).input("mesh", "posed"), picture(literal_path(path))]
}
