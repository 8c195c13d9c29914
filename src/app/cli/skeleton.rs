//! `plumbline skeleton`: the skeletons of meshes.

use super::mesh_stages::MeshesArgs;
use super::prelude::*;
use crate::stages::SkeletonExtractSettings;

/// Options of `plumbline skeleton`.
#[derive(Debug, Args)]
pub(super) struct SkeletonArgs {
    #[command(flatten)]
    meshes: MeshesArgs,
    /// The format of files that are named after their meshes: json (with the curve), glb (bound to the mesh), tgf, skel or bvh
    #[arg(long, default_value = "json", value_name = "FORMAT", conflicts_with = "output")]
    #[arg(value_parser = ["json", "glb", "tgf", "skel", "bvh"])]
    format: String,
    #[command(flatten)]
    extract: Given<Extract>,
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

impl BuildsPipeline for SkeletonArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        self.meshes.pipeline("skeleton", &self.format, |output| {
            let extract = SkeletonExtractSettings { path: Some(output), ..self.extract.settings.clone() };
            vec![StageEntry::built("skeleton", &extract).input("mesh", "mesh")]
        })
    }
}
