//! `skeleton.load`: opens a skeleton.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::pipeline::kind::{OverTime, StageSettings};
use crate::pipeline::port::{Port, PortType};

/// Settings of `skeleton.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonLoadSettings {
    /// The skeleton: our own JSON, glTF, GLB, BVH, .tgf or .skel
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl StageSettings for SkeletonLoadSettings {
    const KIND: &'static str = "skeleton.load";
    const SUMMARY: &'static str = "opens a skeleton, with the movements of its file";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("skeleton", PortType::Skeleton, "the skeleton")];
    const REQUIRED: &'static [&'static str] = &["path"];

    fn over_time(&self) -> OverTime {
        OverTime::Once
    }

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }
}
