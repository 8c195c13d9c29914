//! `plumbline pose`: a character in a pose, or through a movement. Builds the same graph as `pipeline/rig-and-pose.toml`.

use std::path::{Path, PathBuf};

use super::job::WeightsArg;
use super::mesh_stages::{also_drawn, saved, with_skeleton};
use super::prelude::*;
use super::render::RenderView;
use crate::stages::PoseSettings;

/// Frames of a folder where no number is given.
const FRAMES: u32 = 24;

/// Options of `plumbline pose`.
#[derive(Debug, Args)]
pub(super) struct PoseArgs {
    /// The character: a glTF or GLB file with a skin, or a mesh of any format with --skeleton
    #[arg(value_name = "CHARACTER")]
    input: PathBuf,
    /// The skeleton: our own JSON, glTF, GLB, BVH, .tgf or .skel; the mesh is bound to it
    #[arg(long, value_name = "FILE")]
    skeleton: Option<PathBuf>,
    /// How a mesh is bound to --skeleton: heat, biharmonic, distance, or a file of weights
    #[arg(long, default_value_t, value_name = "HOW|FILE", requires = "skeleton")]
    weights: WeightsArg,
    #[command(flatten)]
    posing: Given<Posing>,
    /// The file to write, its extension chooses the format; or a folder (`frames/`) for a sequence of OBJ files
    #[arg(short, long, value_name = "OUTPUT")]
    output: PathBuf,

    /// Number of poses of the animation, or from rest to the pose, as NAME_0000.EXT and so on; 24 in a folder
    #[arg(long, value_name = "N", help_heading = "Writing", value_parser = clap::value_parser!(u32).range(1..=9999))]
    frames: Option<u32>,
    /// Also draw the last pose
    #[arg(long, value_name = "FILE.png", help_heading = "Writing")]
    render: Option<PathBuf>,
    #[command(flatten)]
    view: Given<RenderView>,
}

/// Options for `character.pose`.
struct Posing;

impl Offer for Posing {
    type Kind = PoseSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("pose").value("FILE.json").conflicts("clip"),
        Setting::of("clip").value("NAME"),
        Setting::of("skinning").value("METHOD").under("Posing"),
        Setting::of("model").value("FILE.skin").conflicts("weights").under("Posing"),
        Setting::of("details").value("HOLD").under("Posing"),
        Setting::of("ik").value("METHOD").under("Posing"),
        Setting::of("iterations").under("Posing"),
        Setting::of("start").value("SECONDS").requires("clip").signed().under("Posing"),
        Setting::of("end").value("SECONDS").requires("clip").signed().under("Posing"),
        Setting::of("rig").under("Writing"),
    ];
}

impl BuildsPipeline for PoseArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (output, frames) = self.files();
        if self.posing.settings.rig
            && !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
        {
            return Err(Failure::usage("--rig needs an output that can hold a skeleton: NAME.glb or NAME.gltf"));
        }
        let pose = PoseSettings {
            binding: self.weights.binding(),
            weights: self.weights.file(),
            frames,
            ..self.posing.settings.clone()
        };
        let mut stages = with_skeleton(&self.input, self.skeleton.as_deref(), StageEntry::built("posed", &pose));
        stages.push(saved(&output, frames, "posed"));
        stages.extend(also_drawn(self.render.as_ref(), &self.view));
        Ok(PipelineFile::built("pose", stages))
    }
}

impl PoseArgs {
    /// The file to write and how many poses: a folder is meant by a name that ends with a separator, or by none with an
    /// extension.
    fn files(&self) -> (PathBuf, u32) {
        let ends = self.output.to_string_lossy().ends_with(['/', '\\']);
        if ends || self.output.extension().is_none() || self.output.is_dir() {
            let stem = self.input.file_stem().map_or(Path::new("pose"), Path::new);
            return (self.output.join(stem).with_extension("obj"), self.frames.unwrap_or(FRAMES));
        }
        (self.output.clone(), self.frames.unwrap_or(1))
    }
}
