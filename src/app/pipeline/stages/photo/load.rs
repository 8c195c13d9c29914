//! `image.load`: a file as a picture.

use std::path::Path;
use std::sync::Arc;

use super::{heif, still_error};
use crate::pipeline::kinds::ImageLoadSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::summary::InputSummary;
use plumbline_image::still::{self, LoadOptions, StillError};

/// Reads the picture.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ImageLoadSettings) -> Result<(), RunError> {
    let path = Path::new(&settings.path);
    let options = LoadOptions { max_pixels: settings.max_pixels };
    let photo = match still::load(path, options) {
        Err(StillError::Heif) => heif::load(path, options, context.job.threads)?,
        read => read.map_err(|e| still_error(path, &e))?,
    };
    for warning in &photo.warnings {
        context.warn(format!("{}: {warning}", path.display()));
    }
    let size = (photo.frame.width as u32, photo.frame.height as u32);
    let name = settings.path.clone();
    context.summary.input.get_or_insert(InputSummary { name, size, fps: None, fps_assumed: false });
    context.values.put(stage, "image", Arc::new(photo));
    Ok(())
}
