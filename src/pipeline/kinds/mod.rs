//! The registry of stage kinds: one file per kind with its typed settings.

mod decode;
mod encode;
mod image_grid;
mod image_load;
mod image_render;
mod image_save;
mod map_export;
mod motion;
mod motion_export;
mod motion_import;
mod photo_report;
mod render;
mod report;
mod smooth;
mod stmap;
mod track;
mod warp;

pub use crate::media::{Codec, EncoderWish};
pub use decode::{DecodeSettings, Deinterlace};
pub use encode::EncodeSettings;
pub use image_grid::ImageGridSettings;
pub use image_load::ImageLoadSettings;
pub use image_render::{ImageRenderSettings, PhotoBorder};
pub use image_save::ImageSaveSettings;
pub use map_export::MapExportSettings;
pub use motion::{MotionSettings, RollingShutter};
pub use motion_export::MotionExportSettings;
pub use motion_import::MotionImportSettings;
pub use photo_report::PhotoReportSettings;
pub use render::{Border, Interpolation, RenderSettings};
pub use report::ReportSettings;
pub use smooth::{InSpace, PathMethod, SmoothSettings, Zoom};
pub use stmap::StMapSettings;
pub use track::TrackSettings;
pub use warp::{WarpMode, WarpSettings};

use super::kind::StageKind;

/// Every stage kind, in the order of the data's way.
pub static KINDS: [StageKind; 17] = [
    StageKind::of::<DecodeSettings>(),
    StageKind::of::<TrackSettings>(),
    StageKind::of::<MotionSettings>(),
    StageKind::of::<MotionImportSettings>(),
    StageKind::of::<MotionExportSettings>(),
    StageKind::of::<SmoothSettings>(),
    StageKind::of::<WarpSettings>(),
    StageKind::of::<StMapSettings>(),
    StageKind::of::<RenderSettings>(),
    StageKind::of::<EncodeSettings>(),
    StageKind::of::<ReportSettings>(),
    StageKind::of::<ImageLoadSettings>(),
    StageKind::of::<ImageRenderSettings>(),
    StageKind::of::<ImageGridSettings>(),
    StageKind::of::<ImageSaveSettings>(),
    StageKind::of::<MapExportSettings>(),
    StageKind::of::<PhotoReportSettings>(),
];

/// The kind called `name`.
pub fn find(name: &str) -> Option<&'static StageKind> {
    KINDS.iter().find(|k| k.name == name)
}
