//! What the kinds that join two meshes share.

pub(crate) mod pair;
pub(crate) mod shapes;

use serde_json::Value as Json;

use super::context::Context;
use crate::pipeline::run_error::RunError;
use plumbline_shape::morph::MorphError;

/// The same, of a file.
pub(crate) fn of_file(path: &str) -> impl Fn(MorphError) -> RunError + use<'_> {
    move |error| RunError::Input(format!("{path}: {error}"))
}

/// Writes a report where one is wanted.
pub(crate) fn write_report(
    context: &mut Context<'_, '_>,
    path: Option<&String>,
    report: &Json,
) -> Result<(), RunError> {
    let name = context.summary.surface.as_ref().map(|s| s.name.clone()).unwrap_or_default();
    path.map_or(Ok(()), |path| context.write_report(path, &name, report))
}

/// Adds a line to the summary of the first mesh.
pub(crate) fn report_line(context: &mut Context<'_, '_>, line: String) {
    if let Some(surface) = &mut context.summary.surface {
        surface.morph.push(line);
    }
}
