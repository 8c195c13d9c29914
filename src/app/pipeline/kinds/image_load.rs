//! `image.load`: opens a still picture.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use plumbline_image::still::LoadOptions;

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

impl StageSettings for ImageLoadSettings {
    const KIND: &'static str = "image.load";
    const SUMMARY: &'static str = "opens a still picture, upright, with its EXIF and color profile";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        // Packed as it is decoded, then in planes; 16 bit with alpha is the worst case at 16 bytes.
        vec![Held { what: "the picture, packed and in planes", frames: 2.0, ..Held::default() }]
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }
}
