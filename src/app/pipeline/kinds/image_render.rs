//! `image.render`: samples a still picture once through its maps.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Interpolation;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::sizes::PixelSize;

/// What stands where the source has no picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum PhotoBorder {
    /// Black; transparent where the picture has transparency
    #[default]
    Black,
    /// The picture mirrored at its edge
    Mirror,
    /// The edge's pixels drawn out
    Replicate,
    /// Transparent: for PNG, TIFF and WebP
    Transparent,
    /// What the rest of the picture suggests: skies, walls and floors go on, things are not invented
    Fill,
}

/// Settings of `image.render`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageRenderSettings {
    /// How pixels are interpolated
    pub interpolation: Interpolation,
    /// What stands where the source has no picture
    pub border: PhotoBorder,
    /// Size of the result, such as 1600x1200; that of the maps if left out
    pub size: Option<PixelSize>,
}

impl StageSettings for ImageRenderSettings {
    const KIND: &'static str = "image.render";
    const SUMMARY: &'static str = "samples a still picture once through its map, as the mean where it shrinks";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::any("warps", PortType::Warp, "the map; without one the picture is only resized"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the sampled picture")];
    const RESAMPLES: bool = true;

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "the result", frames: 1.0, ..Held::default() }]
    }
}
