//! `photo.report`: how a still picture's map fared, for programs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `photo.report`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoReportSettings {
    /// The JSON file to write
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl StageSettings for PhotoReportSettings {
    const KIND: &'static str = "photo.report";
    const SUMMARY: &'static str = "writes how straight each line became, and what else the map does, as JSON";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the map is of, before it is sampled"),
        Port::one("warp", PortType::Warp, "the map"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }
}
