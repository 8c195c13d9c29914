//! The weights that bind a surface to a skeleton.

use serde_json::json;

use super::surface::{digest_of_mesh, digest_of_skeleton};
use super::{Kept, Slot, WEIGHTS, kept};
use crate::pipeline::RunError;
use crate::stages::context::Context;
use plumbline_shape::character::weights::{WeightOptions, WeightReport, bone_weights};
use plumbline_shape::character::{Skeleton, SkinWeights, WeightsFile};
use plumbline_shape::mesh::TriMesh;

/// Vertices of the smallest surface whose weights are kept: those of fewer are computed in 0.03 s, about as fast as they are read.
const MIN_VERTICES: usize = 5_000;

#[derive(PartialEq)]
struct Weighted(SkinWeights, WeightReport);

impl Kept for Weighted {
    const FILES: &'static [&'static str] = &["weights.json", "report.json"];

    fn to_files(&self) -> Option<Vec<Vec<u8>>> {
        // Joints are known by their numbers: the key has the skeleton.
        let joints = (0..self.0.joint_count()).map(|joint| joint.to_string()).collect();
        let file = WeightsFile { joints, weights: self.0.clone() };
        Some(vec![file.to_json().into_bytes(), serde_json::to_vec(&self.1).ok()?])
    }

    fn of_files(files: &[Vec<u8>]) -> Result<Self, String> {
        let text = str::from_utf8(&files[0]).map_err(|e| e.to_string())?;
        let weights = WeightsFile::parse(text).map_err(|e| e.to_string())?.weights;
        Ok(Self(weights, serde_json::from_slice(&files[1]).map_err(|e| e.to_string())?))
    }
}

/// [`bone_weights`], unless they are kept.
pub(crate) fn weights_of(
    context: &mut Context<'_, '_>,
    mesh: &TriMesh,
    skeleton: &Skeleton,
    options: &WeightOptions,
) -> Result<(SkinWeights, WeightReport), RunError> {
    if mesh.vertex_count() < MIN_VERTICES {
        return Ok(bone_weights(mesh, skeleton, options, &context.job.run())?);
    }
    let slot = Slot::of(context, context.at, &WEIGHTS, |_| {
        let min_weight = json!(options.min_weight);
        let (mesh, skeleton) = (digest_of_mesh(mesh)?, digest_of_skeleton(skeleton));
        Ok([
            ("mesh", json!(mesh)),
            ("skeleton", json!(skeleton)),
            ("options", json!(options)),
            ("min_weight", min_weight),
        ])
    });
    let (vertices, joints) = (mesh.vertex_count(), skeleton.joint_count());
    let fits = |Weighted(weights, report): &Weighted| {
        let known = report.unused_joints.iter().all(|joint| (*joint as usize) < joints);
        weights.vertex_count() == vertices && weights.joint_count() == joints && known
    };
    let found = kept(slot.as_ref(), context, fits, |context| {
        let (weights, report) = bone_weights(mesh, skeleton, options, &context.job.run())?;
        Ok(Weighted(weights, report))
    })?;
    Ok((found.0, found.1))
}
