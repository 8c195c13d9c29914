//! `compose`: one mesh made of parts of two.

use serde_json::json;

use super::{mesh_at, morph_error, of_file, tell, write_report};
use crate::pipeline::kinds::ComposeSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::stages::mesh::Posed;
use plumbline_shape::mesh::{Model, RepairOptions, Repaired, TriMesh, repair};
use plumbline_shape::morph::composition::{Cut, SeamFile, compose};

/// Composes them.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ComposeSettings) -> Result<(), RunError> {
    let [base, part] = ["base", "part"].map(|port| mesh_at(context, stage, port));
    let (base, part) = (pose_of(&base?)?, pose_of(&part?)?);
    let in_seam = of_file(&settings.seam);
    let file = SeamFile::read(settings.seam.as_ref()).map_err(&in_seam)?;
    let mut options = file.of_meshes(&base, &part).map_err(&in_seam)?;
    let [base, part] = [&base, &part].map(|mesh| repair(mesh, &RepairOptions::default(), &context.job.run()));
    let (base, part) = (base?, part?);
    if let Some(surface) = &mut context.summary.surface {
        surface.repairs = base.report.changes().chain(part.report.changes()).collect();
    }
    renumber(&mut options.base, &base, "base").map_err(&in_seam)?;
    renumber(&mut options.part, &part, "part").map_err(&in_seam)?;
    options.landmarks = options
        .landmarks
        .iter()
        .filter_map(|&(a, b)| base.vertex_of_source[a as usize].zip(part.vertex_of_source[b as usize]))
        .collect();
    let composed = compose(&base.mesh, &part.mesh, &options, &context.job.run()).map_err(morph_error)?;
    let degrees = composed.crease.to_degrees();
    tell(
        context,
        format!(
            "a seam of {} vertices; the cuts were {:.2} % of the base's size apart; faces meet there at {degrees:.0}° at most",
            composed.seam.len(),
            100.0 * composed.gap
        ),
    );
    let report = json!({
        "version": 1,
        "seam": settings.seam,
        "seam_vertices": composed.seam,
        "gap": composed.gap,
        "crease_deg": degrees,
        "scale": composed.base_from_part.scaling(),
    });
    write_report(context, settings.report.as_ref(), &report)?;
    context.values.put(stage, "mesh", Posed::at_rest(Model::of_mesh(composed.mesh)));
    Ok(())
}

fn pose_of(posed: &Posed) -> Result<TriMesh, RunError> {
    let moved = posed.model.mesh().with_positions(posed.last().to_vec());
    moved.map_err(|e| RunError::Internal(e.to_string()))
}

/// Vertices of the file become those of the repaired mesh.
fn renumber(cut: &mut Cut, repaired: &Repaired, which: &'static str) -> Result<(), plumbline_shape::morph::MorphError> {
    let (Cut::Lasso { vertices, keep } | Cut::Loop { vertices, keep }) = cut else { return Ok(()) };
    for v in vertices.iter_mut().chain([keep]) {
        *v = repaired.vertex_of_source[*v as usize].ok_or_else(|| plumbline_shape::morph::MorphError::Seam {
            which,
            fault: format!("names vertex {v}, of which repair left nothing; name another"),
        })?;
    }
    Ok(())
}
