//! `lines.load`: reads marked lines.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `lines.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesLoadSettings {
    /// The lines file, usually NAME.lines.json beside the picture
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// A missing file means that no lines are marked, and is no error
    pub optional: bool,
}

impl StageSettings for LinesLoadSettings {
    const KIND: &'static str = "lines.load";
    const SUMMARY: &'static str = "reads lines that were marked in a picture";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture that the lines are of")];
    const OUTPUTS: &'static [Port] = &[Port::one("lines", PortType::Lines, "the lines")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }
}
