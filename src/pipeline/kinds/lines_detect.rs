//! `lines.detect`: finds lines that are straight in the world.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `lines.detect`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesDetectSettings {
    /// Names of lines that are found but not wanted, as the report calls them
    pub without: Vec<String>,
}

impl StageSettings for LinesDetectSettings {
    const KIND: &'static str = "lines.detect";
    const SUMMARY: &'static str = "finds lines that are straight in the world";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional("marked", PortType::Lines, "marked lines: where there are any, they are taken and none are searched"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("lines", PortType::Lines, "the lines")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }
}
