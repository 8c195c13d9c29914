//! Options of the commands on still pictures: inputs and outputs, lines and faces to keep in shape.

use std::path::{Path, PathBuf};

use clap::Args;

use super::failure::Failure;
use super::job::{only_input, path_text};
use super::options::{Given, Offer, Setting};
use super::target::TargetArgs;
use crate::pipeline::file::literal_path;
use crate::pipeline::items::has_extension;
use crate::pipeline::paths::to_path;
use crate::pipeline::reference::escape;
use crate::pipeline::{PipelineFile, StageEntry};
use crate::stages::{
    FacesDetectSettings, FacesLoadSettings, ImageGridSettings, ImageLoadSettings, ImageRenderSettings,
    ImageSaveSettings, LinesDetectSettings, LinesLoadSettings, LinesSaveSettings, MapExportSettings,
    PhotoReportSettings,
};

/// Extensions that results keep; of other inputs they are PNG.
const KEPT_FORMATS: [&str; 8] = ["jpg", "jpeg", "jpe", "jfif", "png", "tif", "tiff", "webp"];

/// Options that `rectify` and `retarget` share.
#[derive(Debug, Args)]
pub(super) struct PhotoArgs {
    /// Pictures (jpg png tif webp heic avif) or clips (mp4 mov mkv and others): files, globs, or folders
    #[arg(required = true, value_parser = path_text(), value_name = "INPUT")]
    pub(super) inputs: Vec<String>,
    #[command(flatten)]
    pub(super) target: TargetArgs,

    /// Lines to make straight: auto finds them, off uses none; if left out, NAME.lines.json beside the picture, or auto where
    /// there is no such file
    #[arg(long, value_parser = path_text(), value_name = "auto|off|FILE", help_heading = "What to keep in shape")]
    lines: Option<String>,
    /// Faces to keep in shape: auto finds them
    #[arg(long, default_value = "auto", value_parser = path_text(), value_name = "auto|off|FILE", help_heading = "What to keep in shape")]
    pub(super) faces: String,

    #[command(flatten)]
    save: Given<Save>,
    /// Draw the grid of the map over the result
    #[arg(long, help_heading = "Writing")]
    grid: bool,
    /// Also write the map: PREFIX_x.npy, PREFIX_y.npy, PREFIX_mesh.npy (pixel centers at integers), PREFIX.exr
    #[arg(long, value_name = "PREFIX", help_heading = "Writing")]
    export_map: Option<PathBuf>,
    /// Also write the lines, found or marked, as a file for --lines in which each can be switched off with "off": true
    #[arg(long, value_name = "FILE.json", help_heading = "Writing")]
    save_lines: Option<PathBuf>,
    /// Also write a report: how straight each line became, and the other figures; of many pictures, a folder of pages
    #[arg(long, value_name = "FILE.html|FILE.json|DIR", help_heading = "Writing")]
    report: Option<PathBuf>,

    #[command(flatten)]
    load: Given<Load>,
    /// Pictures at work at once; 0 = as many as processors and memory allow
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=256))]
    pub(super) jobs: u32,
}

/// Options for `image.save`.
struct Save;

impl Offer for Save {
    type Kind = ImageSaveSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("quality").value("Q").ranged().under("Writing")];
}

/// Options for `image.load`.
struct Load;

impl Offer for Load {
    type Kind = ImageLoadSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("max_pixels")];
}

/// Where the names of one job come from: the options, or the item of the batch.
struct Names {
    /// The picture.
    source: String,
    /// The lines file beside it.
    lines: String,
    /// The result.
    output: String,
}

impl PhotoArgs {
    /// The pipeline of a command: the shared stages around those that make the map, the last of which is called `map`. `stages`
    /// gets the stages that give lines and faces.
    pub(super) fn pipeline(
        &self,
        name: &str,
        render: &ImageRenderSettings,
        detect: &LinesDetectSettings,
        stages: impl FnOnce(Wanted) -> Vec<StageEntry>,
    ) -> Result<PipelineFile, Failure> {
        let names = self.names()?;
        let load = ImageLoadSettings { path: names.source.clone(), ..self.load.settings.clone() };
        let mut all = vec![StageEntry::built("photo", &load)];
        let wanted = Wanted { lines: self.push_lines(&names, detect, &mut all), faces: self.push_faces(&mut all) };
        all.extend(self.saved_lines(wanted)?);
        all.extend(stages(wanted));
        all.extend(self.writing(&names, render));
        Ok(PipelineFile { batch: self.target.batch(&self.inputs, self.jobs), ..PipelineFile::built(name, all) })
    }

    /// Options that clips do not have, and whether they were given.
    pub(super) fn for_pictures_only(&self) -> [(bool, &'static str); 7] {
        [
            (self.lines.is_some(), "--lines"),
            (is_file(&self.faces), "--faces FILE"),
            (self.save.settings != ImageSaveSettings::default(), "--quality"),
            (self.grid, "--grid"),
            (self.export_map.is_some(), "--export-map"),
            (self.save_lines.is_some(), "--save-lines"),
            (self.report.is_some(), "--report"),
        ]
    }

    fn names(&self) -> Result<Names, Failure> {
        if self.inputs.iter().any(|i| i == "-") {
            return Err(Failure::usage("pictures are not read from standard input; give the path of a file"));
        }
        let Some(output) = self.target.file() else { return self.batch_names() };
        let input = only_input(&self.inputs, "pictures")?;
        let lines = to_path(input).with_extension("lines.json");
        Ok(Names { source: escape(input), lines: literal_path(&lines), output: literal_path(output) })
    }

    fn batch_names(&self) -> Result<Names, Failure> {
        let files = [self.lines.as_deref(), Some(&self.faces)].into_iter().flatten();
        if let Some(file) = files.filter(|_| self.target.is_many(&self.inputs)).find(|t| is_file(t)) {
            let help = "leave --lines out to take NAME.lines.json beside each picture";
            let message = format!("`{file}` is for one picture, but there may be many; {help}");
            return Err(Failure::usage(message));
        }
        let kept = |input: &String| has_extension(Path::new(input), &KEPT_FORMATS);
        let extension = if self.inputs.iter().all(kept) { "${item.ext}" } else { "png" };
        Ok(Names {
            source: "${item.path}".to_owned(),
            lines: "${item.dir}/${item.stem}.lines.json".to_owned(),
            output: self.target.template(extension),
        })
    }

    /// Appends the stages that give lines; the name of the last.
    fn push_lines(
        &self,
        names: &Names,
        detect: &LinesDetectSettings,
        stages: &mut Vec<StageEntry>,
    ) -> Option<&'static str> {
        let detect = || StageEntry::built("found", detect).input("image", "photo");
        let load = |path: String, optional| {
            StageEntry::built("lines", &LinesLoadSettings { path, optional }).input("image", "photo")
        };
        match self.lines.as_deref() {
            Some("off") => None,
            Some("auto") => {
                stages.push(detect());
                Some("found")
            }
            Some(file) => {
                stages.push(load(escape(file), false));
                Some("lines")
            }
            None => {
                stages.push(load(names.lines.clone(), true));
                stages.push(detect().input("marked", "lines"));
                Some("found")
            }
        }
    }

    /// The stage that writes lines, where they are wanted.
    fn saved_lines(&self, wanted: Wanted) -> Result<Option<StageEntry>, Failure> {
        let Some(path) = &self.save_lines else { return Ok(None) };
        let Some(lines) = wanted.lines else {
            return Err(Failure::usage("--save-lines has nothing to write with --lines off; leave one of them out"));
        };
        let save = LinesSaveSettings { path: self.target.beside(path, &self.inputs, "lines.json") };
        Ok(Some(StageEntry::built("saved_lines", &save).input("image", "photo").input("lines", lines)))
    }

    /// Appends the stage that gives faces; its name.
    fn push_faces(&self, stages: &mut Vec<StageEntry>) -> Option<&'static str> {
        let stage = match self.faces.as_str() {
            "off" => return None,
            "auto" => StageEntry::built("faces", &FacesDetectSettings::default()),
            file => StageEntry::built("faces", &FacesLoadSettings { path: escape(file) }),
        };
        stages.push(stage.input("image", "photo"));
        Some("faces")
    }

    fn writing(&self, names: &Names, render: &ImageRenderSettings) -> Vec<StageEntry> {
        let mut stages = vec![StageEntry::built("drawn", render).input("image", "photo").inputs("warps", &["map"])];
        let mut shown = "drawn";
        if self.grid {
            let grid = StageEntry::built("grid", &ImageGridSettings::default());
            stages.push(grid.input("image", "drawn").input("warp", "map"));
            shown = "grid";
        }
        let save = ImageSaveSettings { path: names.output.clone(), ..self.save.settings.clone() };
        stages.push(StageEntry::built("out", &save).input("image", shown));
        if let Some(prefix) = &self.export_map {
            let export = MapExportSettings {
                path: self.target.beside(prefix, &self.inputs, ""),
                ..MapExportSettings::default()
            };
            stages.push(StageEntry::built("exported", &export).input("image", "photo").input("warp", "map"));
        }
        if let Some(path) = &self.report {
            let report = PhotoReportSettings { path: self.target.beside(path, &self.inputs, "html") };
            stages.push(StageEntry::built("report", &report).input("image", "photo").input("warp", "map"));
        }
        stages
    }
}

/// Stages that give the lines and faces to keep in shape, by name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wanted {
    pub(super) lines: Option<&'static str>,
    pub(super) faces: Option<&'static str>,
}

impl Wanted {
    /// Connects them to a stage that has ports for both.
    pub(super) fn connect(self, stage: StageEntry) -> StageEntry {
        let stage = match self.lines {
            Some(name) => stage.inputs("lines", &[name]),
            None => stage,
        };
        match self.faces {
            Some(name) => stage.input("faces", name),
            None => stage,
        }
    }
}

/// The text is neither `auto` nor `off`.
fn is_file(text: &str) -> bool {
    !matches!(text, "auto" | "off")
}
