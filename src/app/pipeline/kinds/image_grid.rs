//! `image.grid`: draws the grid of a map over its result.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};

/// Settings of `image.grid`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageGridSettings {
    /// Width of the lines, px; 0: a thousandth of the longer side, at least 1
    #[schemars(range(min = 0.0, max = 100.0))]
    pub thickness: f64,
}

impl StageSettings for ImageGridSettings {
    const KIND: &'static str = "image.grid";
    const SUMMARY: &'static str = "draws the grid of a map over the picture that was sampled through it";
    const INPUTS: &'static [Port] =
        &[Port::one("image", PortType::Image, "the sampled picture"), Port::one("warp", PortType::Warp, "its map")];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture with the grid, 8 bit")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "the picture with the grid", bytes_per_px: 6.0, ..Held::default() }]
    }
}
