//! `plumbline stabilize`: the main job, as options. Builds the same graph as `pipeline/stabilize.toml`.

use std::path::{Path, PathBuf};

use super::clip::{ClipArgs, clip_extension};
use super::job::{only_input, path_text};
use super::prelude::*;
use super::target::TargetArgs;
use crate::pipeline::items::{is_picture, pictures};
use crate::pipeline::reference::escape;
use crate::stages::{
    Border, EncodeSettings, InSpace, ModelChoice, MotionExportSettings, RenderSettings, ReportSettings, SmoothSettings,
    StMapSettings, WarpSettings,
};

/// Options of `plumbline stabilize`.
#[derive(Debug, Args)]
#[allow(clippy::struct_excessive_bools)] // each is a flag of the command line
pub(super) struct StabilizeArgs {
    /// Clips: files, globs, or folders (3gp avi flv insv m2ts m4v mkv mov mp4 mpeg mpg mts mxf ogv ts vob webm wmv y4m);
    /// one image sequence (frames/%05d.png, a folder or a quoted glob of pictures); - for standard input
    #[arg(required = true, value_parser = path_text(), value_name = "INPUT")]
    inputs: Vec<String>,
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    clip: ClipArgs,

    #[command(flatten)]
    warp: Given<Warp>,
    #[command(flatten)]
    smooth: Given<Smooth>,
    #[command(flatten)]
    render: Given<Render>,
    #[command(flatten)]
    encode: Given<Encode>,

    /// Clips at work at once
    #[arg(long, default_value_t = 1, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    jobs: u32,
    /// Also write original and result side by side, to OUTPUT with .compare before its extension
    #[arg(long, help_heading = "Extras")]
    compare: bool,
    /// Also write motion and points as plumbline.motion JSON, so that another run with --motion need not track; of many clips,
    /// a folder
    #[arg(long, value_name = "FILE.json|DIR", help_heading = "Extras")]
    export_motion: Option<PathBuf>,
    /// Also write a report: a page with figures, plots of the path, and pictures before and after, or figures as JSON; of many
    /// clips, a folder of pages
    #[arg(long, value_name = "FILE.html|FILE.json|DIR", help_heading = "Extras")]
    report: Option<PathBuf>,
    /// Also write the map of every frame for compositors, as 32-bit EXR: R = x/W, G = 1 - y/H
    #[arg(long, value_name = "DIR", help_heading = "Extras")]
    export_stmap: Option<PathBuf>,
}

/// Options for `video.warp`.
struct Warp;

impl Offer for Warp {
    type Kind = WarpSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("mode").value("MODE").under("Stabilization")];
}

/// Options for `video.smooth`.
struct Smooth;

impl Offer for Smooth {
    type Kind = SmoothSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("path").value("METHOD").under("Stabilization"),
        Setting::of("path_file").value("FILE.json").conflicts("path").under("Stabilization"),
        Setting::of("horizon_lock").under("Stabilization"),
        Setting::of("smoothness").value("SECONDS").ranged().under("Stabilization"),
        Setting::of("keep").value("FRACTION").ranged().under("Stabilization"),
        Setting::of("zoom").under("Stabilization"),
    ];
}

/// Options for `video.render`.
struct Render;

impl Offer for Render {
    type Kind = RenderSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("border").under("Stabilization"),
        Setting::of("fill_memory").value("SIZE").under("Stabilization"),
        Setting::of("interpolation").under("Stabilization"),
    ];
}

/// Options for `video.encode`.
struct Encode;

impl Offer for Encode {
    type Kind = EncodeSettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("codec").value("CODEC").aliases(&[("hevc", "h265")]).under("Encoding"),
        Setting::of("encoder").value("WHICH").under("Encoding"),
        Setting::of("crf").value("Q").under("Encoding"),
        Setting::of("preset").value("NAME").under("Encoding"),
        Setting::of("bitrate").value("RATE").conflicts("crf").under("Encoding"),
        Setting::of("strict").under("Encoding"),
    ];
}

impl BuildsPipeline for StabilizeArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let (source, output) = match self.target.file() {
            Some(output) => (self.only_input()?, literal_path(output)),
            None => ("${item.path}".to_owned(), self.batch_output()?),
        };
        let mut stages = self.analysis(source);
        stages.extend(self.rendering(&output)?);
        let batch = self.target.batch(&self.inputs, self.jobs);
        Ok(PipelineFile { batch, ..PipelineFile::built("stabilize", stages) })
    }
}

impl StabilizeArgs {
    fn only_input(&self) -> Result<String, Failure> {
        let many = self.inputs.len();
        if many > 1 && self.inputs.iter().all(|i| is_picture(Path::new(i))) {
            let help = "name their folder, or put the glob in quotes";
            return Err(Failure::usage(format!("{many} pictures do not say that they are one clip; {help}")));
        }
        match self.inputs.as_slice() {
            [sequence] if pictures(sequence).is_some() => Ok(escape(sequence)),
            inputs => Ok(escape(only_input(inputs, "clips")?)),
        }
    }

    /// The name of each result.
    fn batch_output(&self) -> Result<String, Failure> {
        if self.inputs.iter().any(|i| i == "-") {
            return Err(Failure::usage("standard input has no name to keep; use --output"));
        }
        if self.clip.motion.is_some() && self.target.is_many(&self.inputs) {
            let help = "use --output, or a pipeline file with ${item.stem} in the path";
            return Err(Failure::usage(format!("--motion is for one clip, but there may be many; {help}")));
        }
        Ok(self.target.template(clip_extension(self.encode.settings.codec, &self.inputs)))
    }

    fn analysis(&self, source: String) -> Vec<StageEntry> {
        let smooth = &self.smooth.settings;
        let in_space = match self.warp.settings.mode {
            ModelChoice::Auto => Some(InSpace::Auto),
            ModelChoice::ThreeD => Some(InSpace::Always),
            ModelChoice::Rotation => Some(InSpace::Rotation),
            _ => smooth.path_file.is_some().then_some(InSpace::Always),
        };
        let smooth = SmoothSettings {
            keep_inside: self.render.settings.border == Border::Crop,
            filled: self.render.settings.border == Border::Fill,
            in_space: in_space.unwrap_or_default(),
            ..smooth.clone()
        };
        let mut stages = self.clip.analysis(source, in_space.is_some());
        if let Some(given) = &self.export_motion {
            let path = Some(self.target.beside(given, &self.inputs, "motion.json"));
            let export = MotionExportSettings { path, ..Default::default() };
            let export = StageEntry::built("saved", &export);
            stages.push(export.input("motion", "motion").input("tracks", self.clip.tracks()));
        }
        let planned = StageEntry::built("path", &smooth).input("motion", "motion");
        stages.push(if in_space.is_some() || smooth.filled {
            planned.input("tracks", self.clip.tracks())
        } else {
            planned
        });
        stages
    }

    fn rendering(&self, output: &str) -> Result<Vec<StageEntry>, Failure> {
        let render = &self.render.settings;
        let mut stages = vec![
            StageEntry::built("warp", &self.warp.settings)
                .input("tracks", self.clip.tracks())
                .input("path", "path")
                .input("motion", "motion"),
            StageEntry::built("steady", render).input("frames", "source").inputs("warps", &["warp"]),
            StageEntry::built("out", &self.encode(output.to_owned()))
                .input("frames", "steady")
                .input("audio", "source.audio"),
        ];
        if let Some(folder) = &self.export_stmap {
            let maps = StMapSettings {
                path: self.target.beside(folder, &self.inputs, ""),
                keep_inside: self.render.settings.border == Border::Crop,
            };
            let maps = StageEntry::built("maps", &maps);
            stages.push(maps.input("frames", "source").inputs("warps", &["warp"]));
        }
        if self.compare {
            let encode = self.encode(compare_path(output)?);
            let compare = StageEntry::built("compare", &encode);
            stages
                .push(compare.input("frames", "steady").input("audio", "source.audio").input("side_by_side", "source"));
        }
        if let Some(path) = &self.report {
            let report =
                StageEntry::built("report", &ReportSettings { path: self.target.beside(path, &self.inputs, "html") });
            stages.push(report.input("frames", "steady").input("path", "path").input("motion", "motion"));
        }
        Ok(stages)
    }

    fn encode(&self, path: String) -> EncodeSettings {
        EncodeSettings { path, ..self.encode.settings.clone() }
    }
}

/// `dir/name.mp4` → `dir/name.compare.mp4`; works on templates too, since references hold no `/` before their last dot.
fn compare_path(output: &str) -> Result<String, Failure> {
    let file_at = output.rfind('/').map_or(0, |i| i + 1);
    let extension_at = match output.rfind(".${item.ext}") {
        Some(at) => Some(at),
        None => output.rfind('.'),
    };
    match extension_at {
        Some(at) if at > file_at && output != "-" => Ok(format!("{}.compare{}", &output[..at], &output[at..])),
        _ => Err(Failure::usage(format!("--compare needs a file name with an extension, not `{output}`"))),
    }
}
