//! `photo.rectangle`: the map that makes a stitched panorama with an irregular border a rectangle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::sizes::TargetSize;

/// Settings of `photo.rectangle`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRectangleSettings {
    /// Size of the result, such as 1600x900, or its shape, such as 16:9; the shape that stretches least if left out
    pub size: Option<TargetSize>,
}

impl StageSettings for PhotoRectangleSettings {
    const KIND: &'static str = "photo.rectangle";
    const SUMMARY: &'static str = "finds the map that makes a stitched panorama with an irregular border a rectangle";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture, with a border that is transparent, black or white"),
        Port::any("lines", PortType::Lines, "lines to keep straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "grid and factor", bytes: 32 << 20, ..Held::default() }]
    }
}
