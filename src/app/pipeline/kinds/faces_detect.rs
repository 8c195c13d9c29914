//! `faces.detect`: finds faces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `faces.detect`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FacesDetectSettings {
    /// Least score of a face; real ones have 8 to about 30
    #[schemars(range(min = 1.0, max = 100.0))]
    pub least_score: f64,
}

impl Default for FacesDetectSettings {
    fn default() -> Self {
        Self { least_score: 8.0 }
    }
}

impl StageSettings for FacesDetectSettings {
    const KIND: &'static str = "faces.detect";
    const SUMMARY: &'static str = "finds faces that look at the camera";
    const INPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture")];
    const OUTPUTS: &'static [Port] = &[Port::one("faces", PortType::Faces, "boxes around the faces")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }
}
