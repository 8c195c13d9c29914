//! `skin.weights`: weights of the vertices of the file, written by the names of the joints.

use std::path::Path;
use std::sync::Arc;

use super::mesh_at;
use crate::pipeline::kinds::SkinWeightsSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::stages::photo::{begin, cannot};
use plumbline_shape::character::WeightsFile;
use plumbline_shape::character::io::Rig;
use plumbline_shape::character::weights::{WeightMethod, WeightOptions, WeightReport, bone_weights};

/// Finds and writes them.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &SkinWeightsSettings) -> Result<(), RunError> {
    let skeleton = context.values.get::<Arc<Rig>>(context.required(stage, "skeleton")?)?.skeleton.clone();
    let posed = mesh_at(context, stage)?;
    let rest = posed.last().to_vec();
    let mesh = posed.model.mesh().with_positions(rest).map_err(|e| RunError::Internal(e.to_string()))?;
    let options = WeightOptions {
        method: settings.method.method(),
        influences: settings.influences as usize,
        smooth: settings.smooth as usize,
        ..WeightOptions::default()
    };
    context.job.check_cancel()?;
    let (weights, report) =
        bone_weights(&mesh, &skeleton, &options, &context.job.run()).map_err(|e| RunError::Input(e.to_string()))?;
    warn(context, &report, &options, |j| skeleton.joints()[j as usize].name.clone());
    if let Some(surface) = &mut context.summary.surface {
        let joints = skeleton.joint_count();
        surface.weights = Some(format!("{joints} joints, {} at most for a vertex", weights.most_influences()));
    }
    let file = WeightsFile::of(&skeleton, &weights).map_err(|e| RunError::Internal(e.to_string()))?;
    let path = Path::new(&settings.path);
    let unfinished = begin(path)?;
    std::fs::write(unfinished.path(), file.to_json()).map_err(|e| cannot(path, &e))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))?;
    context.summary.outputs.push(path.to_owned());
    Ok(())
}

/// What the user should know.
fn warn(context: &mut Context<'_, '_>, report: &WeightReport, options: &WeightOptions, name: impl Fn(u32) -> String) {
    if report.by_distance {
        context.warn("no vertex sees a bone: weighted by distance; is the skeleton inside the mesh?".to_owned());
    }
    if report.borrowed_vertices > 0 {
        let WeightReport { borrowed_components: pieces, borrowed_vertices: vertices, .. } = report;
        context.warn(format!(
            "{pieces} pieces with {vertices} vertices see no bone and took the weights of what is nearest"
        ));
    }
    if !report.idle_joints.is_empty() {
        let names: Vec<String> = report.idle_joints.iter().map(|&j| name(j)).collect();
        context.warn(format!("no vertex follows {}", names.join(", ")));
    }
    if options.method == WeightMethod::BoundedBiharmonic && report.residual > 1e-3 {
        context.warn(format!("weights are exact to {:.0e} only after {} rounds", report.residual, report.iterations));
    }
}
