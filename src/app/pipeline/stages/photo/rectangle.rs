//! `photo.rectangle`: outline, lines and faces to a map.

use std::sync::Arc;

use serde_json::{Map, json};

use super::{PhotoMap, all_lines, picture, tell_lines};
use crate::pipeline::kinds::PhotoRectangleSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::TargetSize;
use crate::pipeline::stages::context::Context;
use plumbline_image::feature::Face;
use plumbline_image::{Plane, analysis_luma};
use plumbline_num::math::Rect;
use plumbline_photo::Line;
use plumbline_photo::rectangle::{
    Outline, RectangleError, RectangleInput, RectangleOptions, RectangleShape, rectangle,
};

/// Longest side of the gray levels that seams are laid in, px.
const LUMA_SIDE: usize = 960;

/// Finds the map.
pub(super) fn run(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &PhotoRectangleSettings,
) -> Result<(), RunError> {
    let lines = all_lines(context, stage)?.lines;
    let faces: Vec<Rect> = match context.edge(stage, "faces") {
        Some(edge) => context.values.get::<Vec<Face>>(edge)?.iter().map(|f| f.rect).collect(),
        None => Vec::new(),
    };
    let shape = match settings.size {
        None => RectangleShape::Natural,
        Some(TargetSize::Pixels(size)) => RectangleShape::Exact(size.width as usize, size.height as usize),
        Some(TargetSize::Shape(ratio)) => RectangleShape::Aspect(ratio.value()),
    };
    make(context, stage, &lines, &faces, shape)
}

/// The map of a stage whose port `image` has the picture.
pub(super) fn make(
    context: &mut Context<'_, '_>,
    stage: usize,
    lines: &[Line],
    faces: &[Rect],
    shape: RectangleShape,
) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let outline = Outline::of_frame(&photo.frame).ok_or_else(|| rectangle_error(&RectangleError::NoBorder))?;
    context.job.check_cancel()?;
    let mut luma = Plane::new(0, 0);
    if !analysis_luma(&photo.frame, LUMA_SIDE, &mut luma) {
        return Err(RunError::Internal("the memory of the picture does not hold its planes".to_owned()));
    }
    let size = (photo.frame.width, photo.frame.height);
    let input = RectangleInput { size, outline: &outline, luma: luma.as_ref(), lines, faces };
    let options = RectangleOptions { shape, ..RectangleOptions::default() };
    let made = rectangle(&input, &options, &context.job.run()).map_err(|e| rectangle_error(&e))?;
    tell_lines(context, &made.warp.lines);
    let mut told = Map::new();
    told.insert("inside".into(), json!(outline.share()));
    told.insert("stretch".into(), json!(made.stretch));
    told.insert("outside_shown".into(), json!(made.outside));
    told.insert("faces".into(), faces.len().into());
    context.values.put(stage, "warp", Arc::new(PhotoMap { warp: made.warp, told }));
    Ok(())
}

fn rectangle_error(error: &RectangleError) -> RunError {
    match error {
        RectangleError::Interrupted(stopped) => (*stopped).into(),
        RectangleError::Option { .. } => RunError::Usage(error.to_string()),
        other => RunError::Input(other.to_string()),
    }
}
