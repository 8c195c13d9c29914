//! `mesh.save`: a mesh as a file, or as one per pose.

use std::path::Path;

use super::animated::animated;
use super::{Posed, mesh_at, mesh_error};
use crate::pipeline::batch::Instance;
use crate::pipeline::kinds::MeshSaveSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use crate::pipeline::stages::photo::{begin, cannot};
use plumbline_shape::mesh::io::{WriteOptions, encode_model, losses};
use plumbline_shape::mesh::{MeshError, MeshFormat, Model};

/// Refuses names that ask for no format, and folders that cannot be written.
pub(in crate::pipeline::stages) fn rehearse(instance: &Instance) -> Result<(), RunError> {
    for stage in &instance.graph.stages {
        if let Some(settings) = stage.settings.get::<MeshSaveSettings>() {
            let format = format_of(Path::new(&settings.path))?;
            if settings.seconds.is_some() && !matches!(format, MeshFormat::Gltf | MeshFormat::Glb) {
                let name = &settings.path;
                return Err(RunError::Usage(format!("`{name}` holds no movement (`seconds` needs .glb or .gltf)")));
            }
            begin(Path::new(&settings.files()[0]))?;
        }
    }
    Ok(())
}

/// Writes the mesh.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &MeshSaveSettings) -> Result<(), RunError> {
    let posed = mesh_at(context, stage)?;
    let format = format_of(Path::new(&settings.path))?;
    let (files, poses) = (settings.files(), posed.poses.len().max(1));
    let wanted = settings.frames.max(1) as usize;
    if wanted != poses {
        let name = &context.stage(stage).name;
        let message = format!("`{name}` is to write {wanted} poses, but the mesh has {poses}");
        return Err(RunError::Usage(format!("{message}; set `frames` of both stages alike")));
    }
    let options = WriteOptions { ascii: settings.ascii };
    for lost in losses(&posed.model, format) {
        context.warn(format!("{format} does not hold {lost}"));
    }
    for (i, file) in files.iter().enumerate() {
        context.job.check_cancel()?;
        let path = Path::new(file);
        let moved = match settings.seconds {
            Some(seconds) => Some(moving(context, &posed, seconds, path)),
            None => posed.poses.get(i).map(|pose| posed.model.with_positions(pose.clone())),
        };
        let moved = moved.transpose().map_err(|e| RunError::Internal(e.to_string()))?;
        let model = moved.as_ref().unwrap_or(&posed.model);
        let bytes = encode_model(model, format, &options, &context.job.run()).map_err(|e| mesh_error(path, &e))?;
        let unfinished = begin(path)?;
        std::fs::write(unfinished.path(), bytes).map_err(|e| cannot(path, &e))?;
        unfinished.publish(path).map_err(|e| cannot(path, &e))?;
        context.summary.outputs.push(path.to_owned());
    }
    Ok(())
}

/// All poses as one model that goes through them.
fn moving(context: &mut Context<'_, '_>, posed: &Posed, seconds: f64, path: &Path) -> Result<Model, MeshError> {
    if posed.model.articulation().is_some() {
        context.warn(format!("{}: the movements that the mesh had give way to this one", path.display()));
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    animated(&posed.model, &posed.poses, seconds, &name)
}

fn format_of(path: &Path) -> Result<MeshFormat, RunError> {
    let format = MeshFormat::of_name(path).filter(|f| *f != MeshFormat::Medit);
    format.ok_or_else(|| {
        let name = path.display();
        RunError::Usage(format!(
            "the extension of `{name}` names no format to write (expected .obj, .ply, .off, .stl, .gltf or .glb)"
        ))
    })
}
