//! The registry of stage kinds: one file per kind with its typed settings.

mod blend;
mod compose;
mod decode;
mod encode;
mod faces_detect;
mod faces_load;
mod image_grid;
mod image_load;
mod image_render;
mod image_save;
mod importance;
mod lens_undistort;
mod lines_detect;
mod lines_load;
mod lines_save;
mod map_export;
mod mesh_deform;
mod mesh_load;
mod mesh_modes;
mod mesh_render;
mod mesh_save;
mod morph;
mod motion;
mod motion_export;
mod motion_import;
mod photo_rectangle;
mod photo_rectify;
mod photo_report;
mod photo_retarget;
mod pose;
mod render;
mod report;
mod skeleton_extract;
mod skeleton_load;
mod skin_train;
mod skin_weights;
mod smooth;
mod stmap;
mod track;
mod video_importance;
mod video_retarget;
mod warp;

pub use blend::BlendSettings;
pub use compose::ComposeSettings;
pub use decode::{DecodeSettings, Deinterlace};
pub use encode::EncodeSettings;
pub use faces_detect::FacesDetectSettings;
pub use faces_load::FacesLoadSettings;
pub use image_grid::ImageGridSettings;
pub use image_load::ImageLoadSettings;
pub use image_render::{ImageRenderSettings, PhotoBorder};
pub use image_save::ImageSaveSettings;
pub use importance::ImportanceSettings;
pub use lens_undistort::LensUndistortSettings;
pub use lines_detect::LinesDetectSettings;
pub use lines_load::LinesLoadSettings;
pub use lines_save::LinesSaveSettings;
pub use map_export::MapExportSettings;
pub use mesh_deform::{
    CotangentWish, LaplacianWish, MeshDeformSettings, SolverWish, StartWish, TurningWish, UnheldWish,
};
pub use mesh_load::MeshLoadSettings;
pub use mesh_modes::MeshModesSettings;
pub use mesh_render::{MeshRenderSettings, UpWish};
pub use mesh_save::MeshSaveSettings;
pub use morph::{MorphSettings, OverWish};
pub use motion::{MotionSettings, RollingShutter};
pub use motion_export::MotionExportSettings;
pub use motion_import::MotionImportSettings;
pub use photo_rectangle::PhotoRectangleSettings;
pub use photo_rectify::{FovAxis, PhotoRectifySettings};
pub use photo_report::PhotoReportSettings;
pub use photo_retarget::PhotoRetargetSettings;
pub use plumbline_media::{Codec, EncoderWish};
pub use pose::{BindingWish, PoseSettings, SkinningWish};
pub use render::{Border, Interpolation, RenderSettings};
pub use report::ReportSettings;
pub use skeleton_extract::SkeletonExtractSettings;
pub use skeleton_load::SkeletonLoadSettings;
pub use skin_train::SkinTrainSettings;
pub use skin_weights::SkinWeightsSettings;
pub use smooth::{InSpace, PathMethod, SmoothSettings, Zoom};
pub use stmap::StMapSettings;
pub use track::TrackSettings;
pub use video_importance::{ClipFaces, VideoImportanceSettings};
pub use video_retarget::VideoRetargetSettings;
pub use warp::{ModelChoice, WarpSettings};

use super::kind::StageKind;

/// Every stage kind, in the order of the data's way.
pub static KINDS: [StageKind; 42] = [
    StageKind::of::<DecodeSettings>(),
    StageKind::of::<LensUndistortSettings>(),
    StageKind::of::<TrackSettings>(),
    StageKind::of::<MotionSettings>(),
    StageKind::of::<MotionImportSettings>(),
    StageKind::of::<MotionExportSettings>(),
    StageKind::of::<SmoothSettings>(),
    StageKind::of::<WarpSettings>(),
    StageKind::of::<VideoImportanceSettings>(),
    StageKind::of::<VideoRetargetSettings>(),
    StageKind::of::<StMapSettings>(),
    StageKind::of::<RenderSettings>(),
    StageKind::of::<EncodeSettings>(),
    StageKind::of::<ReportSettings>(),
    StageKind::of::<ImageLoadSettings>(),
    StageKind::of::<LinesLoadSettings>(),
    StageKind::of::<LinesDetectSettings>(),
    StageKind::of::<LinesSaveSettings>(),
    StageKind::of::<FacesLoadSettings>(),
    StageKind::of::<FacesDetectSettings>(),
    StageKind::of::<ImportanceSettings>(),
    StageKind::of::<PhotoRectifySettings>(),
    StageKind::of::<PhotoRectangleSettings>(),
    StageKind::of::<PhotoRetargetSettings>(),
    StageKind::of::<ImageRenderSettings>(),
    StageKind::of::<ImageGridSettings>(),
    StageKind::of::<ImageSaveSettings>(),
    StageKind::of::<MapExportSettings>(),
    StageKind::of::<PhotoReportSettings>(),
    StageKind::of::<MeshLoadSettings>(),
    StageKind::of::<MeshDeformSettings>(),
    StageKind::of::<MeshModesSettings>(),
    StageKind::of::<SkinWeightsSettings>(),
    StageKind::of::<SkeletonLoadSettings>(),
    StageKind::of::<SkeletonExtractSettings>(),
    StageKind::of::<SkinTrainSettings>(),
    StageKind::of::<PoseSettings>(),
    StageKind::of::<MorphSettings>(),
    StageKind::of::<BlendSettings>(),
    StageKind::of::<ComposeSettings>(),
    StageKind::of::<MeshRenderSettings>(),
    StageKind::of::<MeshSaveSettings>(),
];

/// The kind called `name`.
pub fn find(name: &str) -> Option<&'static StageKind> {
    KINDS.iter().find(|k| k.name == name)
}
