//! `lines.load`, `lines.detect`: lines that are straight in the world.

use std::path::Path;

use super::picture;
use crate::feature::{Segment, SegmentOptions, segments};
use crate::image::still::Photo;
use crate::image::{Plane, analysis_luma};
use crate::math::Point2;
use crate::photo::marks::LinesFile;
use crate::photo::{Line, Orientation};
use crate::pipeline::kinds::{LinesDetectSettings, LinesLoadSettings};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;

/// Longest side of the picture that is searched, px.
const MOST_PX: usize = 1600;
/// Least length of a line, as a share of the picture's diagonal. Shorter ones hardly show a bend.
const LEAST_SHARE: f64 = 0.06;
/// Most lines that are kept, the longest first.
const MOST_LINES: usize = 60;

/// Reads marked lines.
pub(super) fn load(context: &mut Context<'_, '_>, stage: usize, settings: &LinesLoadSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let path = Path::new(&settings.path);
    if settings.optional && !path.exists() {
        context.values.put(stage, "lines", Vec::<Line>::new());
        return Ok(());
    }
    let size = (photo.frame.width as u32, photo.frame.height as u32);
    let file = LinesFile::read(path, size).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
    for note in &file.notes {
        context.warn(format!("{}: {note}", path.display()));
    }
    let lines: Vec<Line> = file.in_use().cloned().collect();
    context.values.put(stage, "lines", lines);
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
        Some(edge) => context.values.get::<Vec<Line>>(edge)?.clone(),
        None => Vec::new(),
    };
    let lines = if marked.is_empty() { found(&photo, settings) } else { marked };
    context.values.put(stage, "lines", lines);
    Ok(())
}

/// The longest straight edges, as lines of two points.
fn found(photo: &Photo, settings: &LinesDetectSettings) -> Vec<Line> {
    let mut luma = Plane::new(0, 0);
    if !analysis_luma(&photo.frame, MOST_PX, &mut luma) {
        return Vec::new();
    }
    let (width, height) = (luma.width(), luma.height());
    let levels = Plane::from_fn(width, height, |x, y| f32::from(luma.as_ref().row(y)[x]));
    let min_length = LEAST_SHARE * (width as f64).hypot(height as f64);
    let mut edges = segments(levels.as_ref(), &SegmentOptions { min_length, ..SegmentOptions::default() });
    edges.sort_by(|a, b| b.length().total_cmp(&a.length()));
    let scale = (photo.frame.width as f64 / width as f64, photo.frame.height as f64 / height as f64);
    let at = |p: Point2| Point2::new(p.x * scale.0, p.y * scale.1);
    let line = |(i, edge): (usize, &Segment)| Line {
        name: format!("found {}", i + 1),
        points: vec![at(edge.start), at(edge.end)],
        orientation: Orientation::Free,
    };
    let lines = edges.iter().take(MOST_LINES).enumerate().map(line);
    lines.filter(|l| !settings.without.contains(&l.name)).collect()
}
