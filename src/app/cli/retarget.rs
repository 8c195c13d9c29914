//! `plumbline retarget`: pictures and clips in another shape. Builds the same graph as `pipeline/retarget.toml`, and for clips
//! with `--stabilize` as `pipeline/vertical-video.toml`.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::photo::PhotoArgs;
use super::photo_clip::{ClipWishes, analysis, are_clips};
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{
    ClipFaces, ImageRenderSettings, ImportanceSettings, Interpolation, LinesDetectSettings, PhotoBorder,
    PhotoRetargetSettings, RenderSettings, VideoImportanceSettings, VideoRetargetSettings,
};
use crate::pipeline::sizes::TargetSize;
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry};

/// Options of `plumbline retarget`.
#[derive(Debug, Args)]
pub struct RetargetArgs {
    #[command(flatten)]
    photo: PhotoArgs,
    #[command(flatten)]
    clips: ClipWishes,

    /// The new size in pixels, or the new shape: the largest of it inside the picture
    #[arg(long, value_name = "WxH|W:H", help_heading = "Result")]
    size: TargetSize,
    /// A picture of the same size, painted by hand: white matters, black does not, mid-gray leaves what was found
    #[arg(long, value_name = "FILE", help_heading = "What to spare")]
    importance: Option<PathBuf>,
    /// How pixels are interpolated
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Result")]
    interpolation: Interpolation,
}

impl RetargetArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.photo.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        if are_clips(&self.photo.inputs)? { self.of_clips() } else { self.of_photos() }
    }

    fn of_clips(&self) -> Result<PipelineFile, Failure> {
        let faces = if self.photo.faces == "off" { ClipFaces::Off } else { ClipFaces::Auto };
        let judged = VideoImportanceSettings { faces, mask: self.importance.as_ref().map(|path| literal_path(path)) };
        let settings = VideoRetargetSettings { size: Some(self.size), ..VideoRetargetSettings::default() };
        let map = StageEntry::built("map", &settings).input("importance", "importance").input("motion", "motion");
        let mut stages = analysis(None);
        stages.push(StageEntry::built("importance", &judged).input("frames", "source"));
        let render = RenderSettings { interpolation: self.interpolation, ..RenderSettings::default() };
        if self.clips.stabilize {
            stages.extend(ClipWishes::steady());
            stages.push(map.input("path", "path"));
            self.clips.pipeline("retarget", &self.photo, &render, &["warp", "map"], stages)
        } else {
            stages.push(map);
            self.clips.pipeline("retarget", &self.photo, &render, &["map"], stages)
        }
    }

    fn of_photos(&self) -> Result<PipelineFile, Failure> {
        self.clips.refuse_for_photos()?;
        // The map covers its output, but kernels reach over the edge: black would darken the outermost pixels.
        let border = PhotoBorder::Replicate;
        let render = ImageRenderSettings { interpolation: self.interpolation, border, ..Default::default() };
        let mask = self.importance.as_ref().map(|path| literal_path(path));
        let settings = PhotoRetargetSettings { size: Some(self.size) };
        self.photo.pipeline("retarget", &render, &LinesDetectSettings::default(), |wanted| {
            let judged = StageEntry::built("importance", &ImportanceSettings { mask }).input("image", "photo");
            let judged = match wanted.faces {
                Some(faces) => judged.input("faces", faces),
                None => judged,
            };
            let stage = StageEntry::built("map", &settings).input("image", "photo").input("importance", "importance");
            vec![judged, wanted.connect(stage)]
        })
    }
}
