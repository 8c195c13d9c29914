//! `skin.weights`: how much each vertex of a mesh follows each joint of a skeleton.

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::character::weights::{WeightMethod, WeightOptions};
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// How weights are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum WeightWish {
    /// As heat that comes from the nearest visible bones and spreads along the surface
    #[default]
    Heat,
    /// As smoothly as bounds of 0 and 1 allow, rigid about the middles of bones
    Bbw,
    /// By distance alone, through the surface
    Distance,
}

impl WeightWish {
    /// The method it means.
    pub fn method(self) -> WeightMethod {
        match self {
            Self::Heat => WeightMethod::Heat,
            Self::Bbw => WeightMethod::BoundedBiharmonic,
            Self::Distance => WeightMethod::Distance,
        }
    }
}

/// Settings of `skin.weights`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkinWeightsSettings {
    /// The skeleton in the mesh (JSON; `plumbline schema skeleton` describes it)
    #[schemars(extend("format" = "path"))]
    pub skeleton: String,
    /// How weights are found
    pub method: WeightWish,
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
            skeleton: String::new(),
            method: WeightWish::default(),
            influences: WeightOptions::default().influences as u32,
            smooth: WeightOptions::default().smooth as u32,
            path: String::new(),
        }
    }
}

impl StageSettings for SkinWeightsSettings {
    const KIND: &'static str = "skin.weights";
    const SUMMARY: &'static str = "finds how much each vertex of a mesh follows each joint of a skeleton";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh at rest")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["skeleton", "path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.skeleton]
    }

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }
}
