//! `image.load`: opens a still picture.

use std::path::Path;
use std::sync::Arc;

use super::photo::{heif, still_error};
use super::prelude::*;
use crate::pipeline::paths::to_path;
use crate::pipeline::summary::InputSummary;
use plumbline_image::still::{self, LoadOptions, Photo, StillError};

/// Settings of `image.load`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageLoadSettings {
    /// The picture: JPEG, PNG, TIFF, WebP, HEIC or AVIF
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Most pixels; larger pictures are refused before memory is taken for them
    #[schemars(range(min = 1))]
    pub max_pixels: u64,
}

impl Default for ImageLoadSettings {
    fn default() -> Self {
        Self { path: String::new(), max_pixels: LoadOptions::default().max_pixels }
    }
}

/// Reads a picture, HEIC and AVIF through FFmpeg on so many threads.
pub(super) fn read(path: &Path, max_pixels: u64, threads: usize) -> Result<Photo, RunError> {
    let options = LoadOptions { max_pixels };
    match still::load(path, options) {
        Err(StillError::Heif) => heif::load(path, options, threads),
        read => read.map_err(|e| still_error(path, &e)),
    }
}

impl Stage for ImageLoadSettings {
    const KIND: &'static str = "image.load";
    const SUMMARY: &'static str = "opens a still picture, upright, with its metadata and color profile";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = ();
    type Output = (Arc<Photo>,);

    fn memory(&self) -> Vec<MemoryCost> {
        // Packed as it is decoded, then in planes; 16 bit with alpha is the worst case at 16 bytes.
        vec![MemoryCost { what: "the picture, packed and in planes", frames: 2.0, ..MemoryCost::default() }]
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, (): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let photo = read(path, self.max_pixels, context.job.threads)?;
        for warning in &photo.warnings {
            context.warn(format!("{}: {warning}", path.display()));
        }
        let size = (photo.frame.width as u32, photo.frame.height as u32);
        let name = self.path.clone();
        context.summary.input.get_or_insert(InputSummary { name, size, ..InputSummary::default() });
        Ok((Arc::new(photo),))
    }
}
