//! `plumbline rectify`: wide-angle pictures with straight lines, clips without their lens. For pictures, builds the same graph as `pipeline/rectify.toml`.

use clap::Args;

use super::failure::Failure;
use super::photo::PhotoArgs;
use super::photo_clip::{ClipWishes, analysis, are_clips};
use super::run::run_or_print;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{
    Border, FovAxis, ImageRenderSettings, ImportanceSettings, Interpolation, LensUndistortSettings,
    LinesDetectSettings, PhotoBorder, PhotoRectangleSettings, PhotoRectifySettings, RenderSettings,
};
use crate::pipeline::sizes::{CropWish, PixelSize, ProjectionWish, TargetSize, ViewAngles, ViewField};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, number_for};

/// Options of `plumbline rectify`.
#[derive(Debug, Args)]
pub struct RectifyArgs {
    #[command(flatten)]
    photo: PhotoArgs,
    #[command(flatten)]
    clips: ClipWishes,

    /// The lens: auto (EXIF, profiles, the lines themselves), a file (lensfun XML, OpenCV or Kalibr YAML, Gyroflow JSON, COLMAP
    /// cameras.txt, OCam, our own JSON), or a model such as equidistant, to be given with --fov
    #[arg(long, default_value = "auto", value_name = "auto|FILE|MODEL", help_heading = "Lens")]
    lens: String,
    /// Field of view, degrees, 1 to 360
    #[arg(long, value_name = "DEG", help_heading = "Lens")]
    #[arg(value_parser = |text: &str| number_for::<PhotoRectifySettings>("fov", text))]
    fov: Option<f64>,
    /// Along which way the field of view is measured
    #[arg(long, value_enum, default_value_t, value_name = "h|v|d", requires = "fov", help_heading = "Lens")]
    fov_axis: FovAxis,

    /// Make a stitched picture with an irregular border, transparent, black or white, a rectangle by warping; found by itself
    /// where no lens is known
    #[arg(long, help_heading = "Result", conflicts_with_all = ["fov", "to", "view_field"])]
    rectangle: bool,
    /// What to make: optimized, perspective, stereographic, panini[:D], mercator, cylindrical or equirectangular;
    /// if left out, optimized for pictures and perspective for clips
    #[arg(long, value_name = "PROJECTION", help_heading = "Result")]
    to: Option<ProjectionWish>,
    /// Where the viewer looks, degrees from where the camera looked
    #[arg(long, default_value_t, value_name = "YAW,PITCH,ROLL", allow_hyphen_values = true, help_heading = "Result")]
    view: ViewAngles,
    /// How much the view shows, degrees; all that the picture has if left out, and of panoramas 100,75
    #[arg(long, value_name = "WIDTH,HEIGHT", help_heading = "Result")]
    view_field: Option<ViewField>,
    /// What is cut away: auto makes the border straight where it can and takes the largest full rectangle otherwise, W:H is the
    /// largest of this shape of it, rectangle leaves the border as it falls, none keeps it curved
    #[arg(long, default_value_t, value_name = "auto|rectangle|W:H|none", help_heading = "Result")]
    crop: CropWish,
    /// Size of the result, px; if left out, pictures stay as wide as they are, and clips keep their size
    #[arg(long, value_name = "WxH", help_heading = "Result")]
    size: Option<PixelSize>,
    /// What stands where the picture shows nothing
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Result")]
    border: PhotoBorder,
    /// How pixels are interpolated
    #[arg(long, value_enum, default_value_t, value_name = "HOW", help_heading = "Result")]
    interpolation: Interpolation,
}

impl RectifyArgs {
    pub(super) fn run(self, backend: &dyn Backend) -> Result<Exit, Failure> {
        run_or_print(self.pipeline()?, self.photo.job.print_pipeline, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        if are_clips(&self.photo.inputs)? { self.of_clips() } else { self.of_photos() }
    }

    fn of_clips(&self) -> Result<PipelineFile, Failure> {
        if self.rectangle {
            return Err(Failure::usage("--rectangle is for stitched pictures, but the input is a clip; leave it out"));
        }
        if matches!(self.border, PhotoBorder::Transparent | PhotoBorder::Fill) {
            let help = "give black, mirror or replicate";
            return Err(Failure::usage(format!("borders of clips are neither transparent nor filled; {help}")));
        }
        let settings = LensUndistortSettings {
            lens: literal_path(std::path::Path::new(&self.lens)),
            fov: self.fov,
            fov_axis: self.fov_axis,
            to: self.to.unwrap_or(ProjectionWish::Perspective),
            view: self.view,
            crop: self.crop,
            size: self.size,
        };
        let border = match (self.crop, self.border) {
            (CropWish::None, PhotoBorder::Black) => Border::Black,
            (CropWish::None, PhotoBorder::Mirror) => Border::Mirror,
            (CropWish::None, PhotoBorder::Replicate) => Border::Replicate,
            _ => Border::Crop,
        };
        let render = RenderSettings { interpolation: self.interpolation, border, ..RenderSettings::default() };
        let mut stages = vec![StageEntry::built("lens", &settings).input("frames", "source")];
        if self.clips.stabilize {
            stages.extend(analysis(Some("lens")));
            stages.extend(ClipWishes::steady());
            self.clips.pipeline("rectify", &self.photo, &render, &["lens", "warp"], stages)
        } else {
            self.clips.pipeline("rectify", &self.photo, &render, &["lens"], stages)
        }
    }

    fn of_photos(&self) -> Result<PipelineFile, Failure> {
        self.clips.refuse_for_photos()?;
        let render =
            ImageRenderSettings { interpolation: self.interpolation, border: self.border, ..Default::default() };
        if self.rectangle {
            return self.of_stitched(&render);
        }
        let to = self.to.unwrap_or_default();
        let settings = PhotoRectifySettings {
            to,
            lens: literal_path(std::path::Path::new(&self.lens)),
            fov: self.fov,
            fov_axis: self.fov_axis,
            view: self.view,
            view_field: self.view_field,
            crop: self.crop,
            size: self.size,
        };
        let detect = LinesDetectSettings {
            lens: settings.lens.clone(),
            fov: self.fov,
            fov_axis: self.fov_axis,
            ..LinesDetectSettings::default()
        };
        self.photo.pipeline("rectify", &render, &detect, |wanted| {
            let stage = wanted.connect(StageEntry::built("map", &settings).input("image", "photo"));
            if to != ProjectionWish::Optimized {
                return vec![stage];
            }
            let judged = StageEntry::built("salience", &ImportanceSettings::default()).input("image", "photo");
            vec![judged, stage.input("importance", "salience")]
        })
    }

    /// Lines are those of the picture: no lens took it.
    fn of_stitched(&self, render: &ImageRenderSettings) -> Result<PipelineFile, Failure> {
        let given = [
            (self.lens != "auto", "--lens"),
            (self.view != ViewAngles::default(), "--view"),
            (matches!(self.crop, CropWish::Rectangle | CropWish::None), "--crop rectangle or none"),
        ];
        if let Some((_, option)) = given.iter().find(|(given, _)| *given) {
            let help = "a stitched picture is warped as it is, without a lens";
            return Err(Failure::usage(format!("{option} does not go with --rectangle: {help}")));
        }
        let shape = match (self.size, self.crop) {
            (Some(size), _) => Some(TargetSize::Pixels(size)),
            (None, CropWish::Shape(ratio)) => Some(TargetSize::Shape(ratio)),
            (None, _) => None,
        };
        let settings = PhotoRectangleSettings { size: shape };
        self.photo.pipeline("rectangle", render, &LinesDetectSettings::default(), |wanted| {
            vec![wanted.connect(StageEntry::built("map", &settings).input("image", "photo"))]
        })
    }
}
