//! `skin.weights`: how much each vertex of a mesh follows each joint of a skeleton.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::BindingWish;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use plumbline_shape::character::weights::WeightOptions;

/// Settings of `skin.weights`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkinWeightsSettings {
    /// How weights are found
    pub method: BindingWish,
    /// Joints per vertex at most
    #[schemars(range(min = 1, max = 64))]
    pub influences: u32,
    /// Rounds of smoothing over neighbors
    #[schemars(range(min = 0, max = 1000))]
    pub smooth: u32,
    /// The file of weights to write (JSON; `plumbline schema weights` describes it)
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Default for SkinWeightsSettings {
    fn default() -> Self {
        Self {
            method: BindingWish::default(),
            influences: WeightOptions::default().influences as u32,
            smooth: WeightOptions::default().smooth as u32,
            path: String::new(),
        }
    }
}

impl StageSettings for SkinWeightsSettings {
    const KIND: &'static str = "skin.weights";
    const SUMMARY: &'static str = "finds how much each vertex of a mesh follows each joint of a skeleton";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at rest"),
        Port::one("skeleton", PortType::Skeleton, "the skeleton in it"),
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
