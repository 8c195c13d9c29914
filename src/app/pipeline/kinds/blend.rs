//! `blend`: two meshes mixed as painted.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::MorphSettings;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `blend`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BlendSettings {
    /// Where the first mesh is to be like which: a file of painted times (`plumbline schema paint`)
    #[schemars(extend("format" = "path"))]
    pub paint: String,
    /// Places of both meshes that belong together, for meshes that are not two poses of one (`plumbline schema landmarks`, .cons
    /// or .yml)
    #[schemars(extend("format" = "path"))]
    pub landmarks: Option<String>,
    /// Rounds in which the shape is made more rigid towards both meshes
    #[schemars(range(min = 0, max = 10_000))]
    pub rounds: u32,
    /// Shapes on the way from the first mesh to the blend; 1: the blend alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Also write how it went, as JSON
    #[schemars(extend("format" = "path"))]
    pub report: Option<String>,
}

impl Default for BlendSettings {
    fn default() -> Self {
        Self { paint: String::new(), landmarks: None, rounds: MorphSettings::default().rounds, frames: 1, report: None }
    }
}

impl StageSettings for BlendSettings {
    const KIND: &'static str = "blend";
    const SUMMARY: &'static str = "mixes two meshes, each place as far from one to the other as is painted there";
    const INPUTS: &'static [Port] = MorphSettings::INPUTS;
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the blend")];
    const REQUIRED: &'static [&'static str] = &["paint"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        std::iter::once(&self.paint).chain(&self.landmarks).map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }
}
