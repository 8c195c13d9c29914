//! What the kinds of meshes share.

pub(crate) mod animated;
pub(crate) mod binding;
pub(crate) mod report;

use std::path::Path;

use crate::pipeline::run_error::RunError;
use plumbline_shape::mesh::MeshError;

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
