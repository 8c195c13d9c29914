//! `plumbline pose`: a character in a pose, or through a movement. Builds the same graph as `pipeline/rig-and-pose.toml`.

use std::path::{Path, PathBuf};

use super::job::WeightsArg;
use super::mesh_stages::{also_drawn, with_skeleton};
use super::prelude::*;
use super::render::RenderView;
use crate::pipeline::number_for;
use crate::stages::posing::clip_span;
use crate::stages::{MeshSaveSettings, PoseSettings};
use plumbline_shape::mesh::MeshFormat;

/// Frames of a folder where no number is given.
const FRAMES: u32 = 24;

/// Options of `plumbline pose`.
#[derive(Debug, Args)]
pub(super) struct PoseArgs {
    /// The character: a glTF, GLB or FBX file with a skin, or a mesh of any format with --skeleton
    #[arg(value_name = "CHARACTER")]
    input: PathBuf,
    /// The skeleton: our own JSON, glTF, GLB, FBX, BVH, .tgf or .skel; the mesh is bound to it
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

    /// Number of poses of the animation, or from rest to the pose: morph targets of a .glb or .gltf, of other formats
    /// NAME_0000.EXT and so on; 24 in a folder
    #[arg(long, value_name = "N", help_heading = "Writing", value_parser = clap::value_parser!(u32).range(1..=9999))]
    frames: Option<u32>,
    /// Poses per second of the animation, instead of their number
    #[arg(long, value_name = "RATE", help_heading = "Writing", conflicts_with_all = ["frames", "pose", "rig"])]
    #[arg(value_parser = rate)]
    fps: Option<f64>,
    /// Duration of poses as morph targets, in seconds; of an animation its own if left out, else 2
    #[arg(long, value_name = "S", help_heading = "Writing")]
    #[arg(value_parser = |text: &str| number_for::<MeshSaveSettings>("seconds", text))]
    seconds: Option<f64>,
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
        Setting::of("motion_from").value("FILE").conflicts("pose"),
        Setting::of("map").value("FILE.json").requires("motion_from"),
        Setting::of("skinning").value("METHOD").under("Posing"),
        Setting::of("model").value("FILE.skin").conflicts("weights").under("Posing"),
        Setting::of("details").value("HOLD").under("Posing"),
        Setting::of("pin").value("JOINT").requires("pose").under("Posing"),
        Setting::of("ik").value("METHOD").under("Posing"),
        Setting::of("iterations").under("Posing"),
        Setting::of("start").value("SECONDS").conflicts("pose").signed().under("Posing"),
        Setting::of("end").value("SECONDS").conflicts("pose").signed().under("Posing"),
        Setting::of("rig").under("Writing"),
    ];
}

impl BuildsPipeline for PoseArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let Written { path, mut frames, numbered } = self.written();
        let holds_skeleton = matches!(MeshFormat::of_name(&path), Some(MeshFormat::Glb | MeshFormat::Gltf));
        let settings = &self.posing.settings;
        // A motion of another character belongs to a skeleton; poses of it are asked for.
        let moved = settings.motion_from.is_some() && self.frames.is_none() && self.fps.is_none() && !numbered;
        let rig = settings.rig || moved && holds_skeleton;
        if rig && !holds_skeleton {
            return Err(Failure::usage("--rig needs an output that can hold a skeleton: NAME.glb or NAME.gltf"));
        }
        let mut pose =
            PoseSettings { binding: self.weights.binding(), weights: self.weights.file(), rig, ..settings.clone() };
        let sequence = !rig && holds_skeleton && !numbered && (frames > 1 || self.fps.is_some());
        let mut seconds = self.seconds.unwrap_or(SECONDS);
        if pose.pose.is_none() && (self.fps.is_some() || sequence && self.seconds.is_none()) {
            let (start, end) = self.span()?;
            if let Some(fps) = self.fps {
                frames = sampled(start, end, fps)?;
                let end = start + f64::from(frames - 1) / fps;
                (pose.start, pose.end) = (Some(start), Some(end));
                seconds = self.seconds.unwrap_or(end - start);
            } else {
                seconds = end - start;
            }
        }
        pose.frames = frames;
        let mut stages = with_skeleton(&self.input, self.skeleton.as_deref(), StageEntry::built("posed", &pose));
        let seconds = (sequence && frames > 1).then_some(seconds.clamp(MIN_SECONDS, MAX_SECONDS));
        let save = MeshSaveSettings { path: literal_path(&path), frames, seconds, ..MeshSaveSettings::default() };
        stages.push(StageEntry::built("out", &save).input("mesh", "posed"));
        stages.extend(also_drawn(self.render.as_ref(), &self.view));
        Ok(PipelineFile::built("pose", stages))
    }
}

/// A file to write, with how many poses.
struct Written {
    path: PathBuf,
    frames: u32,
    /// Every pose is a file, of whatever format.
    numbered: bool,
}

/// Duration of poses that no animation times, s.
const SECONDS: f64 = 2.0;
/// Range of `seconds` of `mesh.save`.
const MIN_SECONDS: f64 = 0.001;
const MAX_SECONDS: f64 = 86_400.0;
/// Largest number of poses.
const MAX_FRAMES: f64 = 9999.0;

/// Poses at this rate between two times, both included where they are a whole number of frames apart.
fn sampled(start: f64, end: f64, fps: f64) -> Result<u32, Failure> {
    // Key times in single precision are off by a millionth of a frame.
    let frames = ((end - start) * fps + 1e-3).floor() + 1.0;
    if (1.0..=MAX_FRAMES).contains(&frames) {
        return Ok(frames as u32);
    }
    let fault = format!("{} s at {fps} poses per second are {frames} poses (at most {MAX_FRAMES})", end - start);
    Err(Failure::usage(format!("{fault}; give a lower --fps, or --start and --end")))
}

/// Reads `--fps`.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse::<f64>().map_err(|e| e.to_string())?;
    if (0.01..=1000.0).contains(&rate) { Ok(rate) } else { Err("expected 0.01 to 1000 poses per second".to_owned()) }
}

impl PoseArgs {
    /// The file to write and how many poses: a folder is meant by a name that ends with a separator, or by none with an
    /// extension.
    fn written(&self) -> Written {
        let ends = self.output.to_string_lossy().ends_with(['/', '\\']);
        if ends || self.output.extension().is_none() || self.output.is_dir() {
            let stem = self.input.file_stem().map_or(Path::new("pose"), Path::new);
            let path = self.output.join(stem).with_extension("obj");
            return Written { path, frames: self.frames.unwrap_or(FRAMES), numbered: true };
        }
        Written { path: self.output.clone(), frames: self.frames.unwrap_or(1), numbered: false }
    }

    /// Begin and end of the animation, s: as given, else those of the file that has it.
    fn span(&self) -> Result<(f64, f64), Failure> {
        let settings = &self.posing.settings;
        if let (Some(start), Some(end)) = (settings.start, settings.end) {
            return Ok((start, end));
        }
        let file = settings.motion_from.as_deref().map(Path::new).or(self.skeleton.as_deref()).unwrap_or(&self.input);
        if settings.clip.is_none() && settings.motion_from.is_none() {
            return Ok((0.0, SECONDS));
        }
        let (first, last) = clip_span(file, settings.clip.as_deref())?;
        Ok((settings.start.unwrap_or(first), settings.end.unwrap_or(last)))
    }
}
