//! `compose`: one mesh made of parts of two.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `compose`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ComposeSettings {
    /// Where both are cut and how they are joined: a file of seams (`plumbline schema seam`)
    #[schemars(extend("format" = "path"))]
    pub seam: String,
    /// Also write how it went, as JSON
    #[schemars(extend("format" = "path"))]
    pub report: Option<String>,
}

impl StageSettings for ComposeSettings {
    const KIND: &'static str = "compose";
    const SUMMARY: &'static str = "cuts two meshes and makes one of the parts, with a smooth transition";
    const INPUTS: &'static [Port] = &[
        Port::one("base", PortType::Mesh, "the mesh that stays where it is"),
        Port::one("part", PortType::Mesh, "the mesh of which a part is added"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the composed mesh")];
    const REQUIRED: &'static [&'static str] = &["seam"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.seam]
    }

    fn writes(&self) -> Vec<String> {
        self.report.iter().cloned().collect()
    }
}
