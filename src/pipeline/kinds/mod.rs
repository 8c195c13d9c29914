//! The registry of stage kinds: one file per kind with its typed settings.

mod decode;
mod encode;
mod motion;
mod motion_export;
mod motion_import;
mod render;
mod report;
mod smooth;
mod stmap;
mod track;
mod warp;

pub use crate::media::{Codec, EncoderWish};
pub use decode::{DecodeSettings, Deinterlace};
pub use encode::EncodeSettings;
pub use motion::{MotionSettings, RollingShutter};
pub use motion_export::MotionExportSettings;
pub use motion_import::MotionImportSettings;
pub use render::{Border, Interpolation, RenderSettings};
pub use report::ReportSettings;
pub use smooth::{InSpace, PathMethod, SmoothSettings, Zoom};
pub use stmap::StMapSettings;
pub use track::TrackSettings;
pub use warp::{WarpMode, WarpSettings};

use super::kind::StageKind;

/// Every stage kind, in the order of the data's way.
pub static KINDS: [StageKind; 11] = [
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
];

/// The kind called `name`.
pub fn find(name: &str) -> Option<&'static StageKind> {
    KINDS.iter().find(|k| k.name == name)
}
