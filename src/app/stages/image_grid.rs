//! `image.grid`: draws the grid of a map over its result.

use std::sync::Arc;

use super::prelude::*;
use super::values::PhotoMap;
use plumbline_image::canvas::{Canvas, Rgb};
use plumbline_image::still::Photo;
use plumbline_image::still::{StillError, frame_of_rgb, rgb_of_frame};
use plumbline_num::math::Point2;

/// Settings of `image.grid`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ImageGridSettings {
    /// Width of the lines, px; 0: a thousandth of the longer side, at least 1
    #[schemars(range(min = 0.0, max = 100.0))]
    pub thickness: f64,
}

impl Stage for ImageGridSettings {
    const KIND: &'static str = "image.grid";
    const SUMMARY: &'static str = "draws the grid of a map over the picture that was sampled through it";
    const INPUTS: &'static [Port] =
        &[Port::one("image", PortType::Image, "the sampled picture"), Port::one("warp", PortType::Warp, "its map")];
    const OUTPUTS: &'static [Port] = &[Port::one("image", PortType::Image, "the picture with the grid, 8 bit")];
    type Input = (Arc<Photo>, Arc<PhotoMap>);
    type Output = (Arc<Photo>,);

    fn memory(&self) -> Vec<MemoryCost> {
        vec![MemoryCost { what: "the picture with the grid", bytes_per_px: 6.0, ..MemoryCost::default() }]
    }

    fn run(&self, (photo, map): Self::Input, _context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let (width, height) = (photo.frame.width, photo.frame.height);
        let odd = |e: StillError| RunError::Internal(e.to_string());
        let pixels = rgb_of_frame(&photo.frame).map_err(odd)?;
        let mut canvas = Canvas::from_pixels(width, height, pixels).ok_or_else(|| odd(StillError::Layout))?;
        let thickness = match self.thickness {
            t if t > 0.0 => t,
            _ => (width.max(height) as f64 / 1000.0).max(1.0),
        };
        let mesh = &map.warp.mesh;
        let scale = (width as f64 / map.warp.size.0 as f64, height as f64 / map.warp.size.1 as f64);
        let vertices: Vec<Point2> = mesh.vertices.iter().map(|v| Point2::new(v.x * scale.0, v.y * scale.1)).collect();
        canvas.grid(&vertices, mesh.cols + 1, COLOR, thickness);
        let frame = frame_of_rgb(canvas.as_bytes(), width, height).map_err(odd)?;
        Ok((Arc::new(photo.with_frame(frame)),))
    }
}

/// Cyan: rare in photographs.
const COLOR: Rgb = [0, 230, 255];
