//! Two meshes: shapes between them, blends of them, and one made of parts of both.

mod between;
mod compose;
mod pair;

use std::path::Path;

use serde_json::Value as Json;

use super::context::Context;
use super::mesh::Posed;
use super::photo::{begin, cannot};
use crate::pipeline::kinds::{BlendSettings, ComposeSettings, MorphSettings};
use crate::pipeline::run_error::RunError;
use plumbline_shape::morph::MorphError;

/// Runs a stage of a kind that joins two meshes; `None` for one of another kind.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize) -> Option<Result<(), RunError>> {
    let settings = context.stage(stage).settings.clone();
    Some(if let Some(settings) = settings.get::<MorphSettings>() {
        between::morph(context, stage, settings)
    } else if let Some(settings) = settings.get::<BlendSettings>() {
        between::blend(context, stage, settings)
    } else if let Some(settings) = settings.get::<ComposeSettings>() {
        compose::run(context, stage, settings)
    } else {
        return None;
    })
}

fn mesh_at(context: &Context<'_, '_>, stage: usize, port: &'static str) -> Result<Posed, RunError> {
    context.values.get::<Posed>(context.required(stage, port)?).cloned()
}

/// An error of a method in the terms of a run.
fn morph_error(error: MorphError) -> RunError {
    match error {
        MorphError::Interrupted(stopped) => stopped.into(),
        error => RunError::Input(error.to_string()),
    }
}

/// The same, of a file.
fn of_file(path: &str) -> impl Fn(MorphError) -> RunError + use<'_> {
    move |error| RunError::Input(format!("{path}: {error}"))
}

/// Writes a report where one is wanted.
fn write_report(context: &mut Context<'_, '_>, path: Option<&String>, report: &Json) -> Result<(), RunError> {
    let Some(path) = path.map(Path::new) else { return Ok(()) };
    let unfinished = begin(path)?;
    std::fs::write(unfinished.path(), format!("{report:#}\n")).map_err(|e| cannot(path, &e))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))?;
    context.summary.outputs.push(path.to_owned());
    Ok(())
}

/// Adds a line to what is told of the first mesh.
fn tell(context: &mut Context<'_, '_>, line: String) {
    if let Some(surface) = &mut context.summary.surface {
        surface.morph.push(line);
    }
}
