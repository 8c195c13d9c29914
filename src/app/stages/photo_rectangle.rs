//! `photo.rectangle`: the map that makes a stitched panorama with an irregular border a rectangle.

use std::sync::Arc;

use super::photo::{rectangle, rects};
use super::prelude::*;
use super::values::{LineSet, PhotoMap};
use crate::pipeline::sizes::TargetSize;
use plumbline_image::feature::Face;
use plumbline_image::still::Photo;

/// Settings of `photo.rectangle`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PhotoRectangleSettings {
    /// Size of the result, 1600x900, 800x, x600 or 60%, or its shape, such as 16:9; the shape that stretches least if left out
    pub size: Option<TargetSize>,
}

impl Stage for PhotoRectangleSettings {
    const KIND: &'static str = "photo.rectangle";
    const SUMMARY: &'static str = "finds the map that makes a stitched panorama with an irregular border a rectangle";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture, with a border that is transparent, black or white"),
        Port::any("lines", PortType::Lines, "lines to keep straight"),
        Port::optional("faces", PortType::Faces, "faces to keep in shape"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("warp", PortType::Warp, "the map")];
    type Input = (Arc<Photo>, Vec<LineSet>, Option<Arc<[Face]>>);
    type Output = (Arc<PhotoMap>,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "grid and factor", bytes: 32 << 20, ..MemoryCost::default() }]
    }

    fn run(&self, (photo, lines, faces): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let lines = LineSet::all(lines).lines;
        let faces = rects(faces.as_deref());
        let map = rectangle::make(context, &photo, &lines, &faces, self.size)?;
        Ok((Arc::new(map),))
    }
}
