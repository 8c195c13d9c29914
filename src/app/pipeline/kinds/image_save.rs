//! `image.save`: writes a still picture.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use plumbline_image::still::SaveOptions;

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

impl StageSettings for ImageSaveSettings {
    const KIND: &'static str = "image.save";
    const SUMMARY: &'static str = "writes a still picture with its EXIF and color profile";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "packed samples", frames: 1.0, ..Held::default() }]
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }
}
