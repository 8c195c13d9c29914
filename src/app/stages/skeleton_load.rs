//! `skeleton.load`: opens a skeleton.

use std::sync::Arc;

use super::prelude::*;
use crate::pipeline::paths::to_path;
use plumbline_shape::character::io::{Rig, read_rig};

/// Settings of `skeleton.load`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkeletonLoadSettings {
    /// The skeleton: our own JSON, glTF, GLB, FBX, BVH, .tgf or .skel
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Stage for SkeletonLoadSettings {
    const KIND: &'static str = "skeleton.load";
    const SUMMARY: &'static str = "opens a skeleton, with the movements of its file";
    const INPUTS: &'static [Port] = &[];
    const OUTPUTS: &'static [Port] = &[Port::one("skeleton", PortType::Skeleton, "the skeleton")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = ();
    type Output = (Arc<Rig>,);

    fn reads(&self) -> Vec<&str> {
        vec![&self.path]
    }

    fn run(&self, (): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let path = &to_path(&self.path);
        let rig = read_rig(path, &context.job.read_limits(), &context.job.run())
            .map_err(|e| RunError::Input(e.to_string()))?;
        rig.warnings.iter().for_each(|w| context.warn(format!("{}: {w}", path.display())));
        Ok((Arc::new(rig),))
    }
}
