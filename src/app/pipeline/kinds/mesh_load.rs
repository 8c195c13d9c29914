//! `mesh.load`: opens a mesh.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};
use crate::pipeline::units::ByteSize;
use plumbline_shape::mesh::ReadLimits;

/// Settings of `mesh.load`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MeshLoadSettings {
    /// The mesh: OBJ, PLY, OFF, STL, glTF, GLB or Medit
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Most bytes of the file and of what it refers to; larger ones are refused before memory is taken for them
    pub max_bytes: ByteSize,
}

impl Default for MeshLoadSettings {
    fn default() -> Self {
        Self { path: String::new(), max_bytes: ByteSize(ReadLimits::default().max_bytes) }
    }
}

impl StageSettings for MeshLoadSettings {
    const KIND: &'static str = "mesh.load";
    const SUMMARY: &'static str =
        "opens a mesh with its polygons, texture coordinates, normals, colors, groups and materials";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the mesh")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }
}
