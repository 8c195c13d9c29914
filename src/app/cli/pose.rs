//! `plumbline pose`: a character in a pose, or through a movement. Builds the same graph as `pipeline/rig-and-pose.toml`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::{JobArgs, WeightsArg};
use super::options::{Given, Offer, Setting};
use super::render::RenderView;
use super::run::run_or_print;
use super::session::Session;
use crate::pipeline::file::literal_path;
use crate::pipeline::{Exit, PipelineFile, StageEntry};
use crate::stages::{
    ImageSaveSettings, MeshLoadSettings, MeshRenderSettings, MeshSaveSettings, PoseSettings, SkeletonLoadSettings,
};

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

    #[command(flatten)]
    job: JobArgs,
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

impl PoseArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.job.print_pipeline, session)
    }

    /// The pipeline that the options stand for.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (output, frames) = self.files();
        if self.posing.settings.rig
            && !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb") || e.eq_ignore_ascii_case("gltf"))
        {
            return Err(Failure::usage("--rig needs an output that can hold a skeleton: NAME.glb or NAME.gltf"));
        }
        let load = MeshLoadSettings { path: literal_path(&self.input), ..MeshLoadSettings::default() };
        let pose = PoseSettings {
            binding: self.weights.binding(),
            weights: self.weights.file(),
            frames,
            ..self.posing.settings.clone()
        };
        let save = MeshSaveSettings { path: literal_path(&output), frames, ..MeshSaveSettings::default() };
        let mut stages = vec![StageEntry::built("mesh", &load)];
        let mut posed = StageEntry::built("posed", &pose).input("mesh", "mesh");
        if let Some(path) = &self.skeleton {
            let skeleton = SkeletonLoadSettings { path: literal_path(path) };
            stages.push(StageEntry::built("skeleton", &skeleton));
            posed = posed.input("skeleton", "skeleton");
        }
        stages.push(posed);
        stages.push(StageEntry::built("out", &save).input("mesh", "posed"));
        if let Some(path) = &self.render {
            let render = MeshRenderSettings { view: self.view.settings.view, ..MeshRenderSettings::default() };
            let picture = ImageSaveSettings { path: literal_path(path), ..ImageSaveSettings::default() };
            stages.push(StageEntry::built("drawn", &render).input("mesh", "posed"));
            stages.push(StageEntry::built("picture", &picture).input("image", "drawn"));
        }
        Ok(PipelineFile { name: Some("pose".to_owned()), run: self.job.run(), stages, ..PipelineFile::default() })
    }

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
