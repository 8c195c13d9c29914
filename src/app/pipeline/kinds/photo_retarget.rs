//! `photo.retarget`: the map to another shape that spares what matters.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::memory::Held;
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::sizes::TargetSize;

/// Settings of `photo.retarget`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRetargetSettings {
    /// The new size, such as 1080x1920, or the new shape, such as 9:16
    pub size: Option<TargetSize>,
}

impl StageSettings for PhotoRetargetSettings {
    const KIND: &'static str = "photo.retarget";
    const SUMMARY: &'static str = "finds the map to another shape that spares what matters";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional("importance", PortType::Importance, "how much each place matters"),
        Port::any("lines", PortType::Lines, "lines to keep straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    const REQUIRED: &'static [&'static str] = &["size"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn held(&self) -> Vec<Held> {
        vec![Held { what: "grid and factor", bytes: 16 << 20, ..Held::default() }]
    }
}
