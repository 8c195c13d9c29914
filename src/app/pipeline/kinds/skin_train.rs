//! `skin.train`: how a surface follows a skeleton, learnt from poses that it is known in.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::BindingWish;
use crate::pipeline::items::is_glob;
use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `skin.train`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkinTrainSettings {
    /// Meshes of the same vertices and faces in other poses: files, globs or folders; those held out are left out of them
    #[schemars(extend("format" = "path"))]
    pub examples: Vec<String>,
    /// Meshes that are not learnt from, but tell how well the model does on what it has never seen
    #[schemars(extend("format" = "path"))]
    pub held_out: Vec<String>,
    /// Pose files called as the meshes, that say how the joints stand; from the meshes themselves if left out
    #[schemars(extend("format" = "path"))]
    pub poses: Vec<String>,
    /// How the surface is bound to the skeleton, which says which joint each triangle belongs to; a mesh with a skin of its own
    /// stays bound as it is, unless a skeleton is given
    pub binding: BindingWish,
    /// A file of weights in place of `binding`
    #[schemars(extend("format" = "path"))]
    pub weights: Option<String>,
    /// Ridge on what is learnt of the joints' turns, rad²: larger trusts the examples less; found by leaving examples out if left
    /// out
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub ridge: Option<f64>,
    /// How much linear blending is believed beside what triangles have learnt: what is longer than √(area / hold) follows it; found
    /// by leaving examples out if left out
    #[schemars(range(min = 1e-3, max = 1e9))]
    pub hold: Option<f64>,
    /// Keep so many shapes for each joint in the mean, where they are needed most, in place of all triangles: poses without a
    /// solve
    #[schemars(range(min = 1, max = 32))]
    pub prototypes: Option<u32>,
    /// The file of the model to write, .skin
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Also write how it went, as JSON
    #[schemars(extend("format" = "path"))]
    pub report: Option<String>,
}

impl StageSettings for SkinTrainSettings {
    const KIND: &'static str = "skin.train";
    const SUMMARY: &'static str = "learns from poses of a surface how it follows a skeleton";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at rest"),
        Port::optional("skeleton", PortType::Skeleton, "the skeleton in it, where the file of the mesh has none"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["examples", "path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        let lists = self.examples.iter().chain(&self.held_out).chain(&self.poses);
        // What folders and globs mean is found when it is read.
        let files = lists.filter(|name| !is_glob(name) && !std::path::Path::new(name).is_dir());
        files.chain(&self.weights).map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        std::iter::once(&self.path).chain(&self.report).cloned().collect()
    }
}
