//! `mesh.load`: a file as a mesh.

use std::path::Path;

use super::{Posed, mesh_error};
use crate::pipeline::kinds::MeshLoadSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::summary::SurfaceSummary;
use plumbline_shape::mesh::{Model, ReadLimits, read_model};

/// Reads the mesh.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &MeshLoadSettings) -> Result<(), RunError> {
    let path = Path::new(&settings.path);
    let limits = ReadLimits { max_bytes: settings.max_bytes.0, ..ReadLimits::default() };
    let model = read_model(path, &limits, &context.job.run()).map_err(|e| mesh_error(path, &e))?;
    for warning in model.warnings() {
        context.warn(format!("{}: {warning}", path.display()));
    }
    context.summary.surface.get_or_insert_with(|| summary(&settings.path, &model));
    context.values.put(stage, "mesh", Posed::at_rest(model));
    Ok(())
}

fn summary(name: &str, model: &Model) -> SurfaceSummary {
    let bounds = model.mesh().bounding_box().map_or([[0.0; 3]; 2], |(low, high)| [low, high].map(|p| p.coords.into()));
    let (vertices, faces) = (model.mesh().vertex_count(), model.faces().len());
    SurfaceSummary { name: name.to_owned(), vertices, faces, bounds, ..SurfaceSummary::default() }
}
