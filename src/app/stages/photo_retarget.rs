//! `photo.retarget`: the map to another shape that spares what matters.

use std::sync::Arc;

use serde_json::{Map, json};

use super::photo::report_lines;
use super::prelude::*;
use super::values::{LineSet, PhotoMap};
use crate::pipeline::sizes::TargetSize;
use plumbline_image::feature::{Face, Importance};
use plumbline_image::still::Photo;
use plumbline_photo::retarget::{RetargetOptions, retarget};

/// Settings of `photo.retarget`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRetargetSettings {
    /// The new size: 1080x1920, 800x, x600 or 60%; or the new shape, such as 9:16: the largest of it inside the picture
    pub size: Option<TargetSize>,
}

impl Stage for PhotoRetargetSettings {
    const KIND: &'static str = "photo.retarget";
    const SUMMARY: &'static str = "finds the map to another shape that spares what matters";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional("importance", PortType::Importance, "the importance of each position"),
        Port::any("lines", PortType::Lines, "lines to keep straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    const REQUIRED: &'static [&'static str] = &["size"];
    const MAP: Option<MapStep> = Some(MapStep::Photo);
    type Input = (Arc<Photo>, Option<Arc<Importance>>, Vec<LineSet>, Option<Arc<[Face]>>);
    type Output = (Arc<PhotoMap>,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "grid and factor", bytes: 16 << 20, ..MemoryCost::default() }]
    }

    fn run(
        &self,
        (photo, importance, lines, faces): Self::Input,
        context: &mut Context<'_, '_>,
    ) -> Result<Self::Output, RunError> {
        let lines = LineSet::all(lines).lines;
        let faces = faces.unwrap_or_default();
        let importance = importance.unwrap_or_else(|| Arc::new(Importance::even()));
        let source = (photo.frame.width, photo.frame.height);
        let size = self.size.ok_or_else(|| RunError::Internal("a size is required".to_owned()))?;
        let out = size.pixels(source);
        let options = RetargetOptions::default();
        let made = retarget(source, out, &importance, &lines, &faces, &options, &context.job.run())?;
        report_lines(context, &made.warp.lines, &made.released);
        let mut report = Map::new();
        let (min, max) = (made.window.min, made.window.max);
        report.insert("window_px".into(), json!([min.x, min.y, max.x, max.y]));
        report.insert("released".into(), json!(made.released));
        report.insert("faces".into(), faces.len().into());
        Ok((Arc::new(PhotoMap { warp: made.warp, report }),))
    }
}
