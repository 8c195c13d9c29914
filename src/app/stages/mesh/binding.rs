//! Weights that bind a surface to a skeleton: from a file, or found.

use std::path::Path;

use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use crate::stages::context::Context;
use crate::stages::kept::weights_of;
use plumbline_shape::character::weights::{WeightMethod, WeightOptions};
use plumbline_shape::character::{CharacterError, Skeleton, SkinWeights, WeightsFile};
use plumbline_shape::mesh::TriMesh;

/// The weights of `file`, where one is named, or those that `binding` finds.
pub(crate) fn weights(
    context: &mut Context<'_, '_>,
    mesh: &TriMesh,
    skeleton: &Skeleton,
    binding: WeightMethod,
    file: Option<&String>,
) -> Result<SkinWeights, RunError> {
    if let Some(file) = file {
        return read(&to_path(file), mesh, skeleton);
    }
    let options = WeightOptions { method: binding, ..WeightOptions::default() };
    let (weights, report) = weights_of(context, mesh, skeleton, &options)?;
    if report.borrowed_vertices > 0 {
        let (vertices, pieces) = (report.borrowed_vertices, report.borrowed_components);
        context.warn(format!("{vertices} vertices in {pieces} pieces see no bone; they follow the nearest that do"));
    }
    Ok(weights)
}

/// The weights of a file, for a mesh and a skeleton.
fn read(path: &Path, mesh: &TriMesh, skeleton: &Skeleton) -> Result<SkinWeights, RunError> {
    let refused = |e: &dyn std::fmt::Display| RunError::Input(format!("{}: {e}", path.display()));
    let file = WeightsFile::read(path).map_err(|e| refused(&e))?;
    let (given, vertices) = (file.weights.vertex_count(), mesh.vertex_count());
    if given != vertices {
        return Err(refused(&CharacterError::PerVertex { what: "rows of weights", given, vertices }));
    }
    file.for_skeleton(skeleton).map_err(|e| refused(&e))
}
