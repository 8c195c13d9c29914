//! `importance`: how much each place of a picture matters.

use std::path::Path;

use super::{picture, still_error};
use crate::pipeline::kinds::ImportanceSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::Frame;
use plumbline_image::feature::{Face, Importance, ImportanceOptions};
use plumbline_image::still::{self, LoadOptions, flattened};

/// Judges the picture.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ImportanceSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let faces = match context.edge(stage, "faces") {
        Some(edge) => context.values.get::<Vec<Face>>(edge)?.clone(),
        None => Vec::new(),
    };
    let mask = match settings.mask.as_deref().map(Path::new) {
        Some(path) => Some(mask(path)?),
        None => None,
    };
    let options = ImportanceOptions::default();
    let judged = Importance::of_frame(&photo.frame, &faces, mask.as_ref(), &options, &context.job.run());
    let importance = judged.map_err(|e| match &settings.mask {
        Some(mask) => RunError::Input(format!("{mask}: {e}")),
        None => RunError::Input(e.to_string()),
    })?;
    context.values.put(stage, "importance", importance);
    Ok(())
}

/// A mask painted by hand. Where it is transparent, nothing was painted: mid-gray, which leaves what was found.
pub(in crate::pipeline::stages) fn mask(path: &Path) -> Result<Frame, RunError> {
    let frame = still::load(path, LoadOptions::default()).map_err(|e| still_error(path, &e))?.frame;
    if !frame.format.alpha {
        return Ok(frame);
    }
    flattened(&frame, 0.5).map_err(|e| still_error(path, &e))
}
