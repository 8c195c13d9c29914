//! Still pictures: each stage is evaluated once, in the order of the graph.
//!
//! What flows is held by reference count and let go after the last stage that takes it, so that a job holds the source only
//! until it is sampled. Files are written beside their targets and renamed when they are whole.

mod faces;
mod grid;
mod heif;
mod importance;
mod lens;
mod lines;
mod load;
mod map_export;
mod rectangle;
mod rectify;
mod render;
mod report;
mod retarget;
mod save;
mod transparency;

use std::path::Path;
use std::sync::Arc;

use super::context::Context;
use crate::pipeline::graph::Graph;
use crate::pipeline::job::Values;
use crate::pipeline::kinds::{
    FacesDetectSettings, FacesLoadSettings, ImageGridSettings, ImageLoadSettings, ImageRenderSettings,
    ImageSaveSettings, ImportanceSettings, LinesDetectSettings, LinesLoadSettings, LinesSaveSettings,
    MapExportSettings, PhotoRectangleSettings, PhotoRectifySettings, PhotoReportSettings, PhotoRetargetSettings,
};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::LinesSummary;
pub(super) use importance::mask as importance_mask;
pub(super) use lens::clip_lens;
use lines::LineSet;
use plumbline_image::Frame;
use plumbline_image::still::{Photo, StillError};
use plumbline_media::Unfinished;
use plumbline_photo::{LineReport, PhotoWarp};
pub(super) use rectify::{target, view};
pub(super) use save::rehearse;

/// A map of a picture, and what is told of it.
pub(super) struct PhotoMap {
    pub(super) warp: PhotoWarp,
    /// What else a report tells.
    pub(super) told: serde_json::Map<String, serde_json::Value>,
}

/// Runs a stage of a kind that works on still pictures; `None` for one of another kind.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize) -> Option<Result<(), RunError>> {
    let settings = context.stage(stage).settings.clone();
    Some(if let Some(settings) = settings.get::<ImageLoadSettings>() {
        load::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<LinesLoadSettings>() {
        lines::load(context, stage, settings)
    } else if let Some(settings) = settings.get::<LinesDetectSettings>() {
        lines::detect(context, stage, settings)
    } else if let Some(settings) = settings.get::<LinesSaveSettings>() {
        lines::save(context, stage, settings)
    } else if let Some(settings) = settings.get::<FacesLoadSettings>() {
        faces::load(context, stage, settings)
    } else if let Some(settings) = settings.get::<FacesDetectSettings>() {
        faces::detect(context, stage, settings)
    } else if let Some(settings) = settings.get::<ImportanceSettings>() {
        importance::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<PhotoRectifySettings>() {
        rectify::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<PhotoRectangleSettings>() {
        rectangle::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<PhotoRetargetSettings>() {
        retarget::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<ImageRenderSettings>() {
        render::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<ImageGridSettings>() {
        grid::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<ImageSaveSettings>() {
        save::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MapExportSettings>() {
        map_export::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<PhotoReportSettings>() {
        report::run(context, stage, settings)
    } else {
        return None;
    })
}

/// Drops the results that no stage of `stages` after position `done` takes.
pub(super) fn let_go(graph: &Graph, stages: &[usize], done: usize, values: &mut Values) {
    for &from in &stages[..=done] {
        let later = stages[done + 1..].iter().any(|&s| graph.stages[s].edges.iter().any(|e| e.from == from));
        if !later {
            values.forget(from);
        }
    }
}

/// The picture at an input port.
fn picture(context: &Context<'_, '_>, stage: usize, port: &str) -> Result<Arc<Photo>, RunError> {
    context.values.get::<Arc<Photo>>(context.required(stage, port)?).cloned()
}

/// Other pixels with what the file said of the picture.
fn with_pixels(photo: &Photo, frame: Frame) -> Photo {
    let (exif, icc, tags) = (photo.exif.clone(), photo.icc.clone(), photo.tags.clone());
    Photo { frame, exif, tags, icc, format: photo.format, warnings: Vec::new() }
}

/// The map at an input port, if it is connected.
fn map_at(context: &Context<'_, '_>, stage: usize, port: &str) -> Result<Option<Arc<PhotoMap>>, RunError> {
    context.edge(stage, port).map(|edge| context.values.get::<Arc<PhotoMap>>(edge).cloned()).transpose()
}

/// The map at an input port that must be connected.
fn required_map(context: &Context<'_, '_>, stage: usize, port: &str) -> Result<Arc<PhotoMap>, RunError> {
    let missing = || RunError::Internal(format!("`{}` has no {port}", context.stage(stage).name));
    map_at(context, stage, port)?.ok_or_else(missing)
}

/// The lines of every edge into the port `lines`, and the lens under which they were found, if they were.
fn all_lines(context: &Context<'_, '_>, stage: usize) -> Result<LineSet, RunError> {
    let mut all = LineSet::default();
    for edge in context.stage(stage).edges.iter().filter(|e| e.port.name == "lines") {
        let set = context.values.get::<LineSet>(edge)?;
        all.lines.extend(set.lines.iter().cloned());
        all.lens = all.lens.or_else(|| set.lens.clone());
    }
    Ok(all)
}

/// Tells how straight lines became, and names those that did not.
fn tell_lines(context: &mut Context<'_, '_>, lines: &[LineReport]) {
    let worst = lines.iter().max_by(|a, b| a.max_px.total_cmp(&b.max_px)).map(|l| (l.name.clone(), l.max_px));
    context.summary.lines = Some(LinesSummary { count: lines.len(), worst });
    for line in lines.iter().filter(|l| l.is_bent()) {
        let (name, off) = (&line.name, line.max_px);
        context.warn(format!("line `{name}` could not be made straight: it is off by {off:.1} px"));
    }
}

/// An error of a picture's file in the terms of a run.
fn still_error(path: &Path, error: &StillError) -> RunError {
    let text = format!("{}: {error}", path.display());
    match error {
        StillError::Extension(_) => RunError::Usage(error.to_string()),
        StillError::Layout => RunError::Internal(text),
        e if e.is_about_output() => RunError::Output(text),
        _ => RunError::Input(text),
    }
}

/// Starts the file that is to become `path`; dropped, it is removed.
pub(super) fn begin(path: &Path) -> Result<Unfinished, RunError> {
    Unfinished::beside(path).map_err(|e| cannot(path, &e))
}

pub(super) fn cannot(path: &Path, why: &dyn std::fmt::Display) -> RunError {
    RunError::Output(format!("{}: cannot be written: {why}", path.display()))
}
