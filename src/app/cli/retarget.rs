//! `plumbline retarget`: pictures and clips in another shape. Builds the same graph as `pipeline/retarget.toml`, and for clips
//! with `--stabilize` as `pipeline/vertical-video.toml`.

use super::photo::PhotoArgs;
use super::photo_clip::{PhotoClipArgs, analysis, are_clips};
use super::prelude::*;
use crate::stages::{
    ClipFaces, ImageRenderSettings, ImportanceSettings, LinesDetectSettings, PhotoBorder, PhotoRetargetSettings,
    RenderSettings, VideoImportanceSettings, VideoRetargetSettings,
};

/// Options of `plumbline retarget`.
#[derive(Debug, Args)]
pub(super) struct RetargetArgs {
    #[command(flatten)]
    photo: PhotoArgs,
    #[command(flatten)]
    clips: PhotoClipArgs,

    #[command(flatten)]
    shape: Given<Shape>,
    #[command(flatten)]
    importance: Given<Painted>,
    #[command(flatten)]
    render: Given<Render>,
}

/// Options for `photo.retarget`.
struct Shape;

impl Offer for Shape {
    type Kind = PhotoRetargetSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("size").value("SIZE|W:H").under("Result")];
}

/// Options for `image.importance`.
struct Painted;

impl Offer for Painted {
    type Kind = ImportanceSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("mask").named("importance").under("What to keep in shape")];
}

/// Options for `image.render`.
struct Render;

impl Offer for Render {
    type Kind = ImageRenderSettings;
    const SETTINGS: &'static [Setting] = &[Setting::of("interpolation").under("Result")];
}

impl BuildsPipeline for RetargetArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        if are_clips(&self.photo)? { self.of_clips() } else { self.of_photos() }
    }
}

impl RetargetArgs {
    fn of_clips(&self) -> Result<PipelineFile, Failure> {
        let faces = if self.photo.faces == "off" { ClipFaces::Off } else { ClipFaces::Auto };
        let judged = VideoImportanceSettings { faces, mask: self.importance.settings.mask.clone() };
        let settings = VideoRetargetSettings { size: self.shape.settings.size, ..VideoRetargetSettings::default() };
        let map = StageEntry::built("map", &settings).input("importance", "importance").input("motion", "motion");
        let mut stages = analysis(None);
        stages.push(StageEntry::built("importance", &judged).input("frames", "source"));
        let render = RenderSettings { interpolation: self.render.settings.interpolation, ..RenderSettings::default() };
        if self.clips.stabilize {
            stages.extend(PhotoClipArgs::steady());
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
        let render = ImageRenderSettings { border, ..self.render.settings.clone() };
        self.photo.pipeline("retarget", &render, &LinesDetectSettings::default(), |wanted| {
            let judged = StageEntry::built("importance", &self.importance.settings).input("image", "photo");
            let judged = match wanted.faces {
                Some(faces) => judged.input("faces", faces),
                None => judged,
            };
            let stage = StageEntry::built("map", &self.shape.settings)
                .input("image", "photo")
                .input("importance", "importance");
            vec![judged, wanted.connect(stage)]
        })
    }
}
