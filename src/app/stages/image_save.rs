//! `image.save`: writes a still picture.

use std::io;
use std::sync::Arc;

use super::files::{cannot, filled, try_begin};
use super::photo::still_error;
use super::prelude::*;
use crate::pipeline::paths::to_path;
use plumbline_image::still::Photo;
use plumbline_image::still::{SaveOptions, Saved, StillFormat, encode};

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

impl Stage for ImageSaveSettings {
    const KIND: &'static str = "image.save";
    const SUMMARY: &'static str = "writes a still picture with its metadata and color profile";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>,);
    type Output = (Written,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "packed samples", frames: 1.0, ..MemoryCost::default() }]
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn preflight(&self) -> Result<(), RunError> {
        let path = &to_path(&self.path);
        StillFormat::of_name(path).map_err(|e| still_error(path, &e))?;
        try_begin(path)
    }

    fn run(&self, (photo,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let format = StillFormat::of_name(path).map_err(|e| still_error(path, &e))?;
        let (options, if_exists) = (SaveOptions { quality: self.quality }, context.job.if_exists());
        let mut saved = Ok(Saved::default());
        let unfinished = filled(path, if_exists, |out| {
            saved = encode(&photo, format, options, out);
            Ok::<_, io::Error>(())
        })?;
        let saved = saved.map_err(|e| still_error(path, &e))?;
        context.job.check_cancel()?;
        context.job.publishing(unfinished.path(), path)?;
        unfinished.publish(path, if_exists).map_err(|e| cannot(path, &e))?;
        for warning in saved.warnings {
            context.warn(format!("{}: {warning}", path.display()));
        }
        context.summary.outputs.push(path.to_owned());
        context.summary.size = Some((photo.frame.width as u32, photo.frame.height as u32));
        Ok((Written,))
    }
}
