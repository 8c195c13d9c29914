//! `skin.weights`: how much each vertex of a mesh follows each joint of a skeleton.

use std::sync::Arc;

use super::kept::weights_of;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_shape::character::WeightsFile;
use plumbline_shape::character::io::Rig;
use plumbline_shape::character::weights::{WeightOptions, WeightReport};

/// Settings of `skin.weights`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SkinWeightsSettings {
    /// What weights are like.
    #[serde(flatten)]
    pub options: WeightOptions,
    /// The file of weights to write (`plumbline schema weights` describes it)
    #[schemars(extend("format" = "path"))]
    pub path: String,
}

impl Stage for SkinWeightsSettings {
    const KIND: &'static str = "skin.weights";
    const SUMMARY: &'static str = "finds how much each vertex of a mesh follows each joint of a skeleton";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at rest"),
        Port::one("skeleton", PortType::Skeleton, "the skeleton in it"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Posed, Arc<Rig>);
    type Output = (Written,);

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, (posed, rig): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let skeleton = &rig.skeleton;
        let mesh = posed.mesh()?;
        let options = &self.options;
        context.job.check_cancel()?;
        let (weights, report) = weights_of(context, &mesh, skeleton, options)?;
        warn(context, &report, |j| skeleton.joints()[j as usize].name.clone());
        if let Some(surface) = &mut context.summary.surface {
            let joints = skeleton.joint_count();
            surface.weights = Some(format!("{joints} joints, {} at most for a vertex", weights.most_influences()));
        }
        let file = WeightsFile::of(skeleton, &weights).map_err(|e| RunError::Internal(e.to_string()))?;
        context.write_file(&to_path(&self.path), file.to_json())?;
        Ok((Written,))
    }
}

/// Names in one warning; a skeleton may have thousands of joints.
const MAX_LISTED: usize = 20;

/// What the user should know.
fn warn(context: &mut Context<'_, '_>, report: &WeightReport, name: impl Fn(u32) -> String) {
    if report.by_distance {
        context.warn("no vertex sees a bone: weighted by distance; is the skeleton inside the mesh?".to_owned());
    }
    if report.borrowed_vertices > 0 {
        let WeightReport { borrowed_components: pieces, borrowed_vertices: vertices, .. } = report;
        context.warn(format!(
            "{pieces} pieces with {vertices} vertices see no bone and took the weights of what is nearest"
        ));
    }
    if !report.unused_joints.is_empty() {
        let names: Vec<String> = report.unused_joints.iter().take(MAX_LISTED).map(|&j| name(j)).collect();
        let more = report.unused_joints.len() - names.len();
        let more = if more > 0 { format!(" and {more} others") } else { String::new() };
        context.warn(format!("no vertex follows {}{more}", names.join(", ")));
    }
}
