//! The report of a deformation: in a line or two, and as JSON.

use std::fmt::Write as _;

use serde_json::{Value as Json, json};

use crate::pipeline::run_error::RunError;
use crate::stages::context::Context;
use crate::stages::mesh_deform::{MeshDeformSettings, Solved};
use plumbline_shape::surface::{DeformReport, SolvableMesh, Unsuitable};

/// Reports the repair and of the last pose, and warns of what went wrong in any.
pub(crate) fn report_deformation(
    context: &mut Context<'_, '_>,
    solvable: &SolvableMesh,
    solved: &[Solved],
    settings: &MeshDeformSettings,
) {
    let Some(last) = solved.last() else { return };
    let report = &last.report;
    if let Some(surface) = &mut context.summary.surface {
        surface.repairs = solvable.report.changes().collect();
        surface.deformation = Some(line(report, settings.method.name(), solved.len()));
    }
    // Parts without a handle.
    for part in report.fixed_components.iter().take(3) {
        let first = solvable.source_of_vertex[part.vertex as usize];
        context.warn(format!("no handle is on the part of {} vertices around vertex {first}: it stays", part.vertices));
    }
    if report.fixed_components.len() > 3 {
        context.warn(format!("{} more parts without a handle stay", report.fixed_components.len() - 3));
    }
    // Poses that did not converge.
    let open = solved.iter().filter(|s| !s.report.stop.converged()).count();
    if open > 0 {
        let which = if solved.len() == 1 { "it".to_owned() } else { format!("{open} of {} poses", solved.len()) };
        let most = settings.iterations;
        context.warn(format!(
            "{which} had not converged after {most} iterations; --iterations allows more (`iterations`)"
        ));
    }
    // A method that does not suit the surface or the deformation: of the poses, the first for which that shows.
    let unsuitable = |s: &Solved| Unsuitable::of(settings.method, &settings.options, &s.report);
    if let Some(unsuitable) = solved.iter().find_map(unsuitable) {
        context.warn(unsuitable.to_string());
    }
}

fn line(report: &DeformReport, method: &str, poses: usize) -> String {
    let shape = &report.shape;
    let iterations =
        if report.iterations == 1 { "1 solve".to_owned() } else { format!("{} iterations", report.iterations) };
    let mut line = format!("{method}: {} in {iterations}", report.stop);
    if poses > 1 {
        line = format!("{poses} poses; the last by {line}");
    }
    if let [first, .., last] = report.energies.as_slice() {
        let _ = write!(line, ", energy {first:.4e} to {last:.4e}");
    }
    let _ = write!(line, ", edges stretched by {:.1} % at most", 100.0 * shape.worst_stretch);
    if let Some(ratio) = shape.volume_ratio {
        let _ = write!(line, ", volume {:.1} %", 100.0 * ratio);
    }
    if shape.flipped_faces > 0 {
        let _ = write!(line, ", {} faces flipped", shape.flipped_faces);
    }
    if report.constraint_error > 0.0 {
        let _ = write!(line, ", handles missed by {:.3e} at most", report.constraint_error);
    }
    line
}

/// Writes the report.
pub(crate) fn write(
    context: &mut Context<'_, '_>,
    path: &str,
    solvable: &SolvableMesh,
    solved: &[Solved],
    settings: &MeshDeformSettings,
) -> Result<(), RunError> {
    let poses: Vec<Json> = solved.iter().map(|s| pose(s, solvable)).collect();
    let name = context.summary.surface.as_ref().map(|s| s.name.clone()).unwrap_or_default();
    let report = json!({
        "version": 1,
        "input": name,
        "handles": settings.handles,
        "method": settings.method,
        "cotangents": settings.options.cotangents,
        "repair": solvable.report,
        "poses": poses,
    });
    context.write_report(path, &name, &report)
}

/// Vertices are those of the file; lengths are in units of the mesh.
fn pose(solved: &Solved, solvable: &SolvableMesh) -> Json {
    let report = &solved.report;
    let part = |p: &plumbline_shape::surface::Component| json!({"vertex": solvable.source_of_vertex[p.vertex as usize], "vertices": p.vertices});
    let still: Vec<Json> = report.fixed_components.iter().map(part).collect();
    json!({
        "time": solved.time,
        "stop": report.stop.to_string(),
        "converged": report.stop.converged(),
        "iterations": report.iterations,
        "energies": report.energies,
        "constraint_error": report.constraint_error,
        "worst_stretch": report.shape.worst_stretch,
        "rms_stretch": report.shape.rms_stretch,
        "flipped_faces": report.shape.flipped_faces,
        "volume_ratio": report.shape.volume_ratio,
        "negative_weights": report.negative_weights,
        "degenerate_faces": report.degenerate_faces,
        "held_still": still,
    })
}
