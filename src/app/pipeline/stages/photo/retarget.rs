//! `photo.retarget`: importance, lines and faces to a map.

use std::sync::Arc;

use serde_json::{Map, json};

use super::{PhotoMap, all_lines, picture, tell_lines};
use crate::pipeline::kinds::PhotoRetargetSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::feature::{Face, Importance};
use plumbline_photo::retarget::{RetargetError, RetargetOptions, retarget};

/// Finds the map.
pub(super) fn run(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &PhotoRetargetSettings,
) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let lines = all_lines(context, stage)?.lines;
    let faces = match context.edge(stage, "faces") {
        Some(edge) => context.values.get::<Vec<Face>>(edge)?.clone(),
        None => Vec::new(),
    };
    let importance = match context.edge(stage, "importance") {
        Some(edge) => context.values.get::<Importance>(edge)?.clone(),
        None => Importance::even(),
    };
    let source = (photo.frame.width, photo.frame.height);
    let size = settings.size.ok_or_else(|| RunError::Internal("a size is required".to_owned()))?;
    let out = size.pixels(source);
    let options = RetargetOptions::default();
    let made = retarget(source, out, &importance, &lines, &faces, &options, &context.job.run())
        .map_err(|e| retarget_error(&e))?;
    for name in &made.released {
        context.warn(format!("line `{name}` could not stay straight with the others and was let go"));
    }
    tell_lines(context, &made.warp.lines);
    let mut told = Map::new();
    let (min, max) = (made.window.min, made.window.max);
    told.insert("window_px".into(), json!([min.x, min.y, max.x, max.y]));
    told.insert("released".into(), json!(made.released));
    told.insert("faces".into(), faces.len().into());
    context.values.put(stage, "warp", Arc::new(PhotoMap { warp: made.warp, told }));
    Ok(())
}

fn retarget_error(error: &RetargetError) -> RunError {
    match error {
        RetargetError::Interrupted(stopped) => (*stopped).into(),
        RetargetError::TargetSize { .. } | RetargetError::Option { .. } => RunError::Usage(error.to_string()),
        other => RunError::Input(other.to_string()),
    }
}
