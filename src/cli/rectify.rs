//! `plumbline rectify`: wide-angle pictures with straight lines. Builds the same graph as `pipeline/rectify.toml`.

use clap::Args;

use super::failure::Failure;
use super::photo::PhotoArgs;
use super::run::run_pipeline;
use super::tell;
use crate::pipeline::file::literal_path;
use crate::pipeline::kinds::{
    FovAxis, ImageRenderSettings, ImportanceSettings, Interpolation, LinesDetectSettings, PhotoBorder,
    PhotoRectifySettings,
};
use crate::pipeline::sizes::{CropWish, PixelSize, ProjectionWish, ViewAngles, ViewField};
use crate::pipeline::{Backend, Exit, PipelineFile, StageEntry, check, number_for, print};

/// Options of `plumbline rectify`.
#[derive(Debug, Args)]
pub struct RectifyArgs {
    #[command(flatten)]
    photo: PhotoArgs,

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

    /// What to make: optimized, perspective, stereographic, panini[:D], mercator, cylindrical or equirectangular
    #[arg(long, default_value_t, value_name = "PROJECTION", help_heading = "Result")]
    to: ProjectionWish,
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
    /// Size of the result, px; as wide as the picture if left out
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
        let file = self.pipeline()?;
        if self.photo.print_pipeline {
            tell(&print(&file));
            return Ok(Exit::Done);
        }
        run_pipeline(&check(file)?, backend)
    }

    /// The pipeline that the options mean.
    pub(super) fn pipeline(&self) -> Result<PipelineFile, Failure> {
        let render =
            ImageRenderSettings { interpolation: self.interpolation, border: self.border, ..Default::default() };
        let settings = PhotoRectifySettings {
            to: self.to,
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
            if self.to != ProjectionWish::Optimized {
                return vec![stage];
            }
            let judged = StageEntry::built("salience", &ImportanceSettings::default()).input("image", "photo");
            vec![judged, stage.input("importance", "salience")]
        })
    }
}
