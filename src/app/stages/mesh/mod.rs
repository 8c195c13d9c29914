//! What the kinds of meshes share.

pub(crate) mod animated;
pub(crate) mod binding;
pub(crate) mod handles;
pub(crate) mod report;
pub(crate) mod solvable;

use std::path::Path;

use crate::pipeline::run_error::RunError;
use plumbline_shape::mesh::MeshError;
use plumbline_shape::surface::SurfaceError;

/// An error of a mesh file in the terms of a run.
pub(crate) fn mesh_error(path: &Path, error: &MeshError) -> RunError {
    if let MeshError::Interrupted(stopped) = error {
        return (*stopped).into();
    }
    let text = match error {
        MeshError::InFile { .. } => error.to_string(),
        _ => format!("{}: {error}", path.display()),
    };
    if error.is_output() { RunError::Output(text) } else { RunError::Input(text) }
}

/// An error of a method in the terms of a run.
#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err wants")]
pub(crate) fn surface_error(error: SurfaceError) -> RunError {
    match error {
        SurfaceError::Interrupted(stopped) => stopped.into(),
        SurfaceError::Option { .. } | SurfaceError::Convergence(_) => RunError::Usage(error.to_string()),
        SurfaceError::Pose { .. } | SurfaceError::PerVertex { .. } => RunError::Internal(error.to_string()),
        _ => RunError::Input(error.to_string()),
    }
}
