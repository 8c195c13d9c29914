//! `lines.detect`: finds lines that are straight in the world.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FovAxis;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `lines.detect`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesDetectSettings {
    /// Names of lines that are found but not wanted, as the report calls them
    pub without: Vec<String>,
    /// The lens: none takes what is straight in the picture; else as in photo.rectify
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// Along which way the field of view is measured
    pub fov_axis: FovAxis,
}

impl Default for LinesDetectSettings {
    fn default() -> Self {
        Self { without: Vec::new(), lens: "none".to_owned(), fov: None, fov_axis: FovAxis::default() }
    }
}

impl StageSettings for LinesDetectSettings {
    const KIND: &'static str = "lines.detect";
    const SUMMARY: &'static str = "finds lines that are straight in the world";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional(
            "marked",
            PortType::Lines,
            "marked lines: where there are any, they are taken and none are searched",
        ),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("lines", PortType::Lines, "the lines")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }
}
