//! `lines.save`: writes lines as a file of marked lines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `lines.save`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesSaveSettings {
    /// The lines file to write; `"off": true` in it switches a line off
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl StageSettings for LinesSaveSettings {
    const KIND: &'static str = "lines.save";
    const SUMMARY: &'static str =
        "writes lines as a file in which each can be switched off, and which lines.load reads";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the lines are of"),
        Port::one("lines", PortType::Lines, "the lines"),
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
