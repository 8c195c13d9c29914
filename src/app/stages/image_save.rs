//! `image.save`: writes a still picture.

use std::io;

use super::files::{cannot, filled, try_begin};
use super::image_render::render_error;
use super::photo::still_error;
use super::prelude::*;
use super::values::Picture;
use crate::pipeline::paths::to_path;
use plumbline_image::still::{SaveOptions, Saved, StillError, StillFormat, encode};

/// Settings of `image.save`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageSaveSettings {
    /// The file to write; its extension chooses the format: .jpg, .png, .tif or .webp
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// JPEG quality; from 90 on colors keep their full resolution
    #[schemars(range(min = 1, max = 100))]
    pub quality: u8,
}

impl Default for ImageSaveSettings {
    fn default() -> Self {
        Self { path: String::new(), quality: SaveOptions::default().quality }
    }
}

impl ImageSaveSettings {
    /// The kind of the file, and how it is written.
    pub(super) fn file(&self) -> Result<(StillFormat, SaveOptions), StillError> {
        Ok((StillFormat::of_name(&to_path(&self.path))?, SaveOptions { quality: self.quality }))
    }
}

impl Stage for ImageSaveSettings {
    const KIND: &'static str = "image.save";
    const SUMMARY: &'static str = "writes a still picture with its metadata and color profile";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Picture,);
    type Output = (Written,);

    fn memory(&self) -> Vec<MemoryCost> {
        if !matches!(self.file(), Ok((StillFormat::WebP, _))) {
            return Vec::new();
        }
        // The encoder takes all samples at once, and copies them with an alpha channel; the others take bands.
        vec![MemoryCost { what: "packed samples", frames: 2.5, ..MemoryCost::default() }]
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn preflight(&self) -> Result<(), RunError> {
        let path = &to_path(&self.path);
        self.file().map_err(|e| still_error(path, &e))?;
        try_begin(path)
    }

    fn run(&self, (picture,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let (format, options) = self.file().map_err(|e| still_error(path, &e))?;
        let if_exists = context.job.if_exists();
        let mut saved = Ok(Ok(Saved::default()));
        let unfinished = filled(path, if_exists, |out| {
            saved = match &picture {
                Picture::Made(photo) => Ok(encode(photo, format, options, out)),
                Picture::Unsampled(unsampled) => unsampled.encode(format, options, out),
            };
            Ok::<_, io::Error>(())
        })?;
        let saved = saved.map_err(|e| render_error(context, &e))?.map_err(|e| still_error(path, &e))?;
        context.job.check_cancel()?;
        context.job.publishing(unfinished.path(), path)?;
        unfinished.publish(path, if_exists).map_err(|e| cannot(path, &e))?;
        for warning in saved.warnings {
            context.warn(format!("{}: {warning}", path.display()));
        }
        context.summary.outputs.push(path.to_owned());
        let (width, height) = match &picture {
            Picture::Made(photo) => (photo.frame.width, photo.frame.height),
            Picture::Unsampled(unsampled) => unsampled.size(),
        };
        context.summary.size = Some((width as u32, height as u32));
        Ok((Written,))
    }
}
