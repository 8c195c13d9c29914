//! `plumbline rectify`: wide-angle pictures with straight lines, clips without lens distortion. For pictures, builds the same graph as `pipeline/rectify.toml`.

use super::photo::PhotoArgs;
use super::photo_clip::{PhotoClipArgs, analysis, are_clips, refuse};
use super::prelude::*;
use crate::pipeline::sizes::ViewAngles;
use crate::stages::{
    Border, ImageRenderSettings, ImportanceSettings, LensUndistortSettings, LinesDetectSettings, PhotoBorder,
    PhotoRectangleSettings, PhotoRectifySettings, RenderSettings,
};
use plumbline_camera::Projection;
use plumbline_photo::rectify::{Crop, Target};

/// Options of `plumbline rectify`.
#[derive(Debug, Args)]
pub(super) struct RectifyArgs {
    #[command(flatten)]
    photo: PhotoArgs,
    #[command(flatten)]
    clips: PhotoClipArgs,

    #[command(flatten)]
    lens: Given<Lens>,

    /// Make a stitched picture with an irregular border, transparent, black or white, a rectangle by warping; found by itself
    /// where no lens is known
    #[arg(long, help_heading = "Result", conflicts_with_all = ["fov", "to", "view_field"])]
    rectangle: bool,
    /// What to make: optimized, perspective, stereographic, panini[:D], mercator, cylindrical or equirectangular;
    /// if left out, optimized for pictures and perspective for clips
    #[arg(long, value_name = "PROJECTION", help_heading = "Result")]
    to: Option<Target>,
    #[command(flatten)]
    view: Given<View>,
    #[command(flatten)]
    render: Given<Render>,
}

/// Options for `photo.rectify`: the lens.
struct Lens;

impl Offer for Lens {
    type Kind = PhotoRectifySettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("lens").value("auto|FILE|MODEL").under("Lens"),
        Setting::of("fov").value("DEG").ranged().under("Lens"),
        Setting::of("fov_axis").value("h|v|d").aliases(&FOV_ALIASES).requires("fov").under("Lens"),
    ];
}

/// Longer words for the axes of a field of view.
const FOV_ALIASES: [(&str, &str); 3] = [("h", "horizontal"), ("v", "vertical"), ("d", "diagonal")];

/// Options for `photo.rectify`: the result.
struct View;

impl Offer for View {
    type Kind = PhotoRectifySettings;
    const SETTINGS: &'static [Setting] = &[
        Setting::of("view").value("YAW,PITCH,ROLL").signed().under("Result"),
        Setting::of("view_field").value("WIDTH,HEIGHT").under("Result"),
        Setting::of("crop").value("auto|rectangle|W:H|none").under("Result"),
        Setting::of("size").value("SIZE").under("Result"),
    ];
}

/// Options for `image.render`.
struct Render;

impl Offer for Render {
    type Kind = ImageRenderSettings;
    const SETTINGS: &'static [Setting] =
        &[Setting::of("border").under("Result"), Setting::of("interpolation").under("Result")];
}

impl BuildsPipeline for RectifyArgs {
    fn pipeline(&self) -> Result<PipelineFile, Failure> {
        if are_clips(&self.photo)? { self.of_clips() } else { self.of_photos() }
    }
}

impl RectifyArgs {
    /// What the options say of lens and result.
    fn settings(&self) -> PhotoRectifySettings {
        let (lens, view) = (&self.lens.settings, &self.view.settings);
        PhotoRectifySettings { lens: lens.lens.clone(), fov: lens.fov, fov_axis: lens.fov_axis, ..view.clone() }
    }

    fn of_clips(&self) -> Result<PipelineFile, Failure> {
        if self.rectangle {
            return Err(Failure::usage("--rectangle is for stitched pictures, but the input is a clip; leave it out"));
        }
        if matches!(self.render.settings.border, PhotoBorder::Transparent | PhotoBorder::Fill) {
            let help = "give black, mirror or replicate";
            return Err(Failure::usage(format!("borders of clips are neither transparent nor filled; {help}")));
        }
        let wanted = self.settings();
        let settings = LensUndistortSettings {
            lens: wanted.lens,
            fov: wanted.fov,
            fov_axis: wanted.fov_axis,
            to: self.to.clone().unwrap_or(Target::Fixed(Projection::Rectilinear)),
            view: wanted.view,
            crop: wanted.crop,
            size: wanted.size,
        };
        let border = match (wanted.crop, self.render.settings.border) {
            (Crop::None, PhotoBorder::Black) => Border::Black,
            (Crop::None, PhotoBorder::Mirror) => Border::Mirror,
            (Crop::None, PhotoBorder::Replicate) => Border::Replicate,
            _ => Border::Crop,
        };
        let render =
            RenderSettings { interpolation: self.render.settings.interpolation, border, ..RenderSettings::default() };
        let mut stages = vec![StageEntry::built("lens", &settings).input("frames", "source")];
        if self.clips.stabilize {
            stages.extend(analysis(Some("lens")));
            stages.extend(PhotoClipArgs::steady());
            self.clips.pipeline("rectify", &self.photo, &render, &["lens", "warp"], stages)
        } else {
            self.clips.pipeline("rectify", &self.photo, &render, &["lens"], stages)
        }
    }

    fn of_photos(&self) -> Result<PipelineFile, Failure> {
        self.clips.refuse_for_photos()?;
        if self.rectangle {
            return self.of_stitched();
        }
        let to = self.to.clone().unwrap_or_default();
        let settings = PhotoRectifySettings { to: to.clone(), ..self.settings() };
        let detect = LinesDetectSettings {
            lens: settings.lens.clone(),
            fov: settings.fov,
            fov_axis: settings.fov_axis,
            ..LinesDetectSettings::default()
        };
        self.photo.pipeline("rectify", &self.render.settings, &detect, |wanted| {
            let stage = wanted.connect(StageEntry::built("map", &settings).input("image", "photo"));
            if to != Target::Optimized {
                return vec![stage];
            }
            let judged = StageEntry::built("saliency", &ImportanceSettings::default()).input("image", "photo");
            vec![judged, stage.input("importance", "saliency")]
        })
    }

    /// Lines are those of the picture: no lens took it.
    fn of_stitched(&self) -> Result<PipelineFile, Failure> {
        let wanted = self.settings();
        let given = [
            (wanted.lens != "auto", "--lens"),
            (wanted.view != ViewAngles::default(), "--view"),
            (matches!(wanted.crop, Crop::Rectangle | Crop::None), "--crop rectangle or none"),
        ];
        refuse(&given, "does not go with --rectangle: a stitched picture is warped as it is, without a lens")?;
        let settings = PhotoRectangleSettings { size: wanted.rectangle_size() };
        self.photo.pipeline("rectangle", &self.render.settings, &LinesDetectSettings::default(), |wanted| {
            vec![wanted.connect(StageEntry::built("map", &settings).input("image", "photo"))]
        })
    }
}
