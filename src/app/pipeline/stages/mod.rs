//! Bodies of the stages of clips. Their kinds are in [`crate::stages`] and [`super::kinds`].

mod analysis;
mod chain;
mod encoding;
mod export;
mod filling;
mod import;
mod importance;
mod report;
mod retargeting;
mod sampling;
mod side_by_side;
mod sink;
mod smoothing;
mod stmap;
mod stream;
mod summary;
mod undistort;

use std::path::Path;

use super::kinds::{
    EncodeSettings, LensUndistortSettings, MotionExportSettings, MotionImportSettings, ReportSettings, SmoothSettings,
    StMapSettings, TrackSettings, VideoRetargetSettings,
};
use super::run_error::RunError;
use crate::stages::context::{self, Context, media_error};
use plumbline_media::{Output, check_encoder};

/// What clips take of the stages of photos.
mod photo {
    pub(super) use crate::stages::photo::lens::clip_lens;
    pub(super) use crate::stages::photo::{painted_mask as importance_mask, target, view};
}

// What the kinds of clips call: the modules above keep their bodies to themselves.

type Done = Result<(), RunError>;

pub(crate) fn track(context: &mut Context<'_, '_>, stage: usize, settings: &TrackSettings) -> Done {
    analysis::run(context, stage, settings)
}

pub(crate) fn lens_undistort(context: &mut Context<'_, '_>, stage: usize, settings: &LensUndistortSettings) -> Done {
    undistort::run(context, stage, settings)
}

pub(crate) fn video_importance(context: &mut Context<'_, '_>, stage: usize) -> Done {
    importance::run(context, stage)
}

pub(crate) fn video_retarget(context: &mut Context<'_, '_>, stage: usize, settings: &VideoRetargetSettings) -> Done {
    retargeting::run(context, stage, settings)
}

pub(crate) fn motion_import(context: &mut Context<'_, '_>, stage: usize, settings: &MotionImportSettings) -> Done {
    import::run(context, stage, settings)
}

pub(crate) fn motion_export(context: &mut Context<'_, '_>, stage: usize, settings: &MotionExportSettings) -> Done {
    export::run(context, stage, settings)
}

pub(crate) fn preflight_motion_export(settings: &MotionExportSettings) -> Done {
    export::preflight(settings)
}

pub(crate) fn smooth(context: &mut Context<'_, '_>, stage: usize, settings: &SmoothSettings) -> Done {
    smoothing::run(context, stage, settings)
}

pub(crate) fn stmap(context: &mut Context<'_, '_>, stage: usize, settings: &StMapSettings) -> Done {
    stmap::run(context, stage, settings)
}

pub(crate) fn preflight_stmap(settings: &StMapSettings) -> Done {
    stmap::preflight(settings)
}

pub(crate) fn encode(context: &mut Context<'_, '_>, stage: usize) -> Done {
    encoding::run(context, stage)
}

pub(crate) fn preflight_encode(settings: &EncodeSettings) -> Done {
    let output = Output::parse(&settings.path);
    output.preflight().map_err(media_error)?;
    if output.is_sequence() {
        return Ok(());
    }
    check_encoder(settings.codec, &settings.encoder).map_err(media_error)
}

pub(crate) fn report(context: &mut Context<'_, '_>, stage: usize, settings: &ReportSettings) -> Done {
    report::run(context, stage, settings)
}

pub(crate) fn preflight_report(settings: &ReportSettings) -> Done {
    report::begin(Path::new(&settings.path)).map(drop)
}
