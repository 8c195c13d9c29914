//! `mesh.modes`: how a surface gives way most easily, and its near-rigid parts.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::CotangentWish;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `mesh.modes`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshModesSettings {
    /// How many modes beside the rigid motions
    #[schemars(range(min = 1, max = 1000))]
    pub count: u32,
    /// Weights of edges
    pub cotangents: CotangentWish,
    /// Number of parts; as many as the motion needs if left out
    #[schemars(range(min = 1, max = 10_000))]
    pub part_count: Option<u32>,
    /// The NumPy archive of modes to write: values, vectors, residuals
    #[schemars(extend("format" = "path"))]
    pub modes: Option<String>,
    /// The JSON file of parts to write
    #[schemars(extend("format" = "path"))]
    pub parts: Option<String>,
}

impl Default for MeshModesSettings {
    fn default() -> Self {
        Self { count: 20, cotangents: CotangentWish::default(), part_count: None, modes: None, parts: None }
    }
}

impl StageSettings for MeshModesSettings {
    const KIND: &'static str = "mesh.modes";
    const SUMMARY: &'static str = "finds how a surface bends most easily, and the parts that stay almost rigid in that";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh at rest")];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the files")];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn writes(&self) -> Vec<String> {
        self.modes.iter().chain(&self.parts).cloned().collect()
    }
}
