//! `faces.load`: reads boxes around faces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `faces.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FacesLoadSettings {
    /// The faces file: JSON with a list of boxes {"x", "y", "w", "h"}
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl StageSettings for FacesLoadSettings {
    const KIND: &'static str = "faces.load";
    const SUMMARY: &'static str = "reads boxes around faces that were marked in a picture";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture that the boxes are of")];
    const OUTPUTS: &'static [Port] = &[Port::one("faces", PortType::Faces, "the boxes")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }
}
