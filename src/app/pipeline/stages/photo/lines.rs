//! `lines.load`, `lines.detect`: lines that are straight in the world.

use std::path::Path;
use std::sync::Arc;

use super::lens::{self, Found, Wish};
use super::{begin, cannot, picture};
use crate::pipeline::kinds::{LinesDetectSettings, LinesLoadSettings, LinesSaveSettings};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::still::Photo;
use plumbline_image::{Plane, analysis_luma};
use plumbline_num::math::Point2;
use plumbline_num::run::Run;
use plumbline_photo::Line;
use plumbline_photo::line_detection::{LineDetectionOptions, detect_lines};
use plumbline_photo::marks::LinesFile;

/// Longest side of the picture that is searched, px: views of it have half as many.
const MOST_PX: usize = 2800;

/// Lines, and the lens under which they were found.
#[derive(Clone, Debug, Default)]
pub(super) struct LineSet {
    pub(super) lines: Vec<Line>,
    /// `None` for lines that were marked: they may tell the lens themselves.
    pub(super) lens: Option<Arc<Found>>,
    /// They were found, not marked: each is two ends, and between them as straight as the lens says.
    pub(super) found: bool,
}

/// Reads marked lines.
pub(super) fn load(context: &mut Context<'_, '_>, stage: usize, settings: &LinesLoadSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let path = Path::new(&settings.path);
    if settings.optional && !path.exists() {
        context.values.put(stage, "lines", LineSet::default());
        return Ok(());
    }
    let size = (photo.frame.width as u32, photo.frame.height as u32);
    let file = LinesFile::read(path, size).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
    for note in &file.notes {
        context.warn(format!("{}: {note}", path.display()));
    }
    let lines = file.in_use().cloned().collect();
    context.values.put(stage, "lines", LineSet { lines, lens: None, found: false });
    Ok(())
}

/// Takes marked lines where there are any, and searches for others where there are none.
pub(super) fn detect(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &LinesDetectSettings,
) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let marked = match context.edge(stage, "marked") {
        Some(edge) => context.values.get::<LineSet>(edge)?.clone(),
        None => LineSet::default(),
    };
    let set = if marked.lines.is_empty() { found(&photo, settings, &context.job.run())? } else { marked };
    context.values.put(stage, "lines", set);
    Ok(())
}

/// Writes lines as marked ones, all in use.
pub(super) fn save(context: &mut Context<'_, '_>, stage: usize, settings: &LinesSaveSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let set = context.values.get::<LineSet>(context.required(stage, "lines")?)?;
    let size = (photo.frame.width as u32, photo.frame.height as u32);
    let text = LinesFile::new(size, set.lines.clone()).to_json();
    let path = Path::new(&settings.path);
    let unfinished = begin(path)?;
    std::fs::write(unfinished.path(), text).map_err(|e| cannot(path, &e))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))?;
    context.summary.outputs.push(path.to_owned());
    Ok(())
}

fn found(photo: &Photo, settings: &LinesDetectSettings, run: &Run) -> Result<LineSet, RunError> {
    let lens = match Wish::of_lines(settings) {
        Some(wish) => lens::find_unless_stitched(photo, &[], wish, run)?.map(Arc::new),
        None => None,
    };
    let mut luma = Plane::new(0, 0);
    if !analysis_luma(&photo.frame, MOST_PX, &mut luma) {
        return Ok(LineSet { lines: Vec::new(), lens, found: true });
    }
    let (width, height) = (luma.width(), luma.height());
    let levels = Plane::from_fn(width, height, |x, y| f32::from(luma.as_ref().row(y)[x]));
    drop(luma);
    let small = lens.as_ref().map(|found| found.lens.resized((width as f64, height as f64))).transpose();
    let small = small.map_err(|e| RunError::Internal(e.to_string()))?;
    let detection = detect_lines(levels.as_ref(), small.as_ref(), &LineDetectionOptions::default(), run)?;
    let scale = (photo.frame.width as f64 / width as f64, photo.frame.height as f64 / height as f64);
    let at = |p: &Point2| Point2::new(p.x * scale.0, p.y * scale.1);
    // Of what lies between the ends the lens tells all. More points would be taken for measurements of it, once they are
    // saved and read back.
    let ends = |points: &[Point2]| points.first().into_iter().chain(points.last()).map(at).collect();
    let line = |line: Line| Line { points: ends(&line.points), ..line };
    let wanted = |line: &Line| !settings.without.contains(&line.name);
    let lines = detection.lines.into_iter().map(|d| line(d.line)).filter(wanted).collect();
    Ok(LineSet { lines, lens, found: true })
}
