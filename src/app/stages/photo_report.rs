//! `photo.report`: a report on the map of a still picture.

use std::sync::Arc;

use serde_json::{Map, Value as Json, json};

use super::prelude::*;
use super::values::PhotoMap;
use plumbline_image::still::Photo;
use plumbline_photo::LineReport;

/// Settings of `photo.report`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoReportSettings {
    /// The report to write: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub path: String,
}

impl Stage for PhotoReportSettings {
    const KIND: &'static str = "photo.report";
    const SUMMARY: &'static str = "writes a report: how straight each line became, and the other figures of the map";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture that the map is of, before it is sampled"),
        Port::one("warp", PortType::Warp, "the map"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["path"];
    type Input = (Arc<Photo>, Arc<PhotoMap>);
    type Output = (Written,);

    fn writes(&self) -> Vec<String> {
        vec![self.path.clone()]
    }

    fn run(&self, (photo, map): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let name = context.summary.input.as_ref().map(|i| i.name.clone()).unwrap_or_default();
        let report = entries(&map, &name, (photo.frame.width, photo.frame.height));
        context.write_report(&self.path, &name, &report)?;
        Ok((Written,))
    }
}

/// The content of the report. Lengths are in px of the output, angles in degrees.
fn entries(map: &PhotoMap, name: &str, source: (usize, usize)) -> Json {
    let warp = &map.warp;
    let lines: Vec<Json> = warp.lines.iter().map(line).collect();
    let worst = warp.lines.iter().map(LineReport::off_px).fold(0.0, f64::max);
    let mut all = Map::new();
    all.insert("version".into(), 1.into());
    all.insert("input".into(), json!({"name": name, "size": [source.0, source.1]}));
    all.insert("output".into(), json!({"size": [warp.size.0, warp.size.1]}));
    let grid = json!({"columns": warp.mesh.cols, "rows": warp.mesh.rows, "folds": warp.mesh.folded_cells()});
    all.insert("grid".into(), grid);
    all.insert("solves".into(), warp.iterations.into());
    all.insert("worst_line_px".into(), json!(worst));
    all.insert("lines".into(), lines.into());
    all.extend(map.report.clone());
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
        "edge_max_px": line.edge.map(|edge| edge.max_px),
        "edge_length_px": line.edge.map(|edge| edge.length_px),
        "bent": line.is_bent(),
    })
}
