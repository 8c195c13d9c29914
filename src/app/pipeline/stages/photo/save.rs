//! `image.save`: a picture as a file.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use super::{begin, cannot, picture, still_error};
use crate::pipeline::batch::Instance;
use crate::pipeline::kinds::ImageSaveSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::still::{SaveOptions, StillFormat, encode};

/// Bytes gathered before they go to the disk.
const BUFFER: usize = 1 << 20;

/// Refuses names that ask for no format, and folders that cannot be written.
pub(in crate::pipeline::stages) fn rehearse(instance: &Instance) -> Result<(), RunError> {
    for stage in &instance.graph.stages {
        if let Some(settings) = stage.settings.get::<ImageSaveSettings>() {
            let path = Path::new(&settings.path);
            StillFormat::of_name(path).map_err(|e| still_error(path, &e))?;
            begin(path)?;
        }
    }
    Ok(())
}

/// Writes the picture.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ImageSaveSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let path = Path::new(&settings.path);
    let format = StillFormat::of_name(path).map_err(|e| still_error(path, &e))?;
    let unfinished = begin(path)?;
    let file = File::options().write(true).open(unfinished.path()).map_err(|e| cannot(path, &e))?;
    let mut out = BufWriter::with_capacity(BUFFER, file);
    let options = SaveOptions { quality: settings.quality };
    let saved = encode(&photo, format, options, &mut out).map_err(|e| still_error(path, &e))?;
    out.flush().map_err(|e| cannot(path, &e))?;
    context.job.check_cancel()?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))?;
    for warning in saved.warnings {
        context.warn(format!("{}: {warning}", path.display()));
    }
    context.summary.outputs.push(path.to_owned());
    context.summary.size = Some((photo.frame.width as u32, photo.frame.height as u32));
    Ok(())
}
