//! `faces.load`, `faces.detect`: boxes around faces.

use std::path::Path;

use super::picture;
use crate::pipeline::kinds::{FacesDetectSettings, FacesLoadSettings};
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::feature::{Face, FaceDetector, FaceOptions};
use plumbline_photo::marks::FacesFile;

/// Reads boxes that were marked.
pub(super) fn load(context: &mut Context<'_, '_>, stage: usize, settings: &FacesLoadSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let path = Path::new(&settings.path);
    let size = (photo.frame.width as u32, photo.frame.height as u32);
    let file = FacesFile::read(path, size).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
    let faces: Vec<Face> = file.in_use().map(|f| Face { rect: f.rect, score: f64::INFINITY }).collect();
    context.values.put(stage, "faces", faces);
    Ok(())
}

/// Finds faces.
pub(super) fn detect(
    context: &mut Context<'_, '_>,
    stage: usize,
    settings: &FacesDetectSettings,
) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let options = FaceOptions { least_score: settings.least_score, ..FaceOptions::default() };
    let faces = FaceDetector::new(options).detect(&photo.frame, &context.job.run())?;
    context.values.put(stage, "faces", faces);
    Ok(())
}
