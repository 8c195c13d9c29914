//! `photo.report`: what a map does, as JSON.

use std::path::Path;

use serde_json::{Map, Value as Json, json};

use super::{PhotoMap, begin, cannot, picture, required_map};
use crate::pipeline::kinds::PhotoReportSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_photo::LineReport;

/// Writes the report.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &PhotoReportSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let map = required_map(context, stage, "warp")?;
    let name = context.summary.input.as_ref().map_or("", |i| i.name.as_str());
    let report = told(&map, name, (photo.frame.width, photo.frame.height));
    let path = Path::new(&settings.path);
    let unfinished = begin(path)?;
    std::fs::write(unfinished.path(), format!("{report:#}\n")).map_err(|e| cannot(path, &e))?;
    unfinished.publish(path).map_err(|e| cannot(path, &e))?;
    context.summary.outputs.push(path.to_owned());
    Ok(())
}

/// Everything that is told of a map. Lengths are in px of the output, angles in degrees.
fn told(map: &PhotoMap, name: &str, source: (usize, usize)) -> Json {
    let warp = &map.warp;
    let lines: Vec<Json> = warp.lines.iter().map(line).collect();
    let worst = warp.lines.iter().map(|l| l.max_px).fold(0.0, f64::max);
    let mut all = Map::new();
    all.insert("version".into(), 1.into());
    all.insert("input".into(), json!({"name": name, "size": [source.0, source.1]}));
    all.insert("output".into(), json!({"size": [warp.size.0, warp.size.1]}));
    let grid = json!({"columns": warp.mesh.cols, "rows": warp.mesh.rows, "folds": warp.mesh.folded_cells()});
    all.insert("grid".into(), grid);
    all.insert("solves".into(), warp.iterations.into());
    all.insert("worst_line_px".into(), json!(worst));
    all.insert("lines".into(), lines.into());
    all.extend(map.told.clone());
    Json::Object(all)
}

fn line(line: &LineReport) -> Json {
    json!({
        "name": line.name,
        "max_px": line.max_px,
        "rms_px": line.rms_px,
        "length_px": line.length_px,
        "angle_deg": line.angle.to_degrees(),
        "angle_error_deg": line.angle_error.map(f64::to_degrees),
        "off_lens_px": line.off_lens_px,
        "shown": line.shown,
        "bent": line.is_bent(),
    })
}
