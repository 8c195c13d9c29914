//! `image.grid`: the grid of a map over its result.

use std::sync::Arc;

use super::{picture, required_map, with_pixels};
use crate::pipeline::kinds::ImageGridSettings;
use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::context::Context;
use plumbline_image::canvas::{Canvas, Rgb};
use plumbline_image::still::{StillError, frame_of_rgb, rgb_of_frame};
use plumbline_num::math::Point2;

/// Cyan: rare in photographs.
const COLOR: Rgb = [0, 230, 255];

/// Draws the grid.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &ImageGridSettings) -> Result<(), RunError> {
    let photo = picture(context, stage, "image")?;
    let map = required_map(context, stage, "warp")?;
    let (width, height) = (photo.frame.width, photo.frame.height);
    let odd = |e: StillError| RunError::Internal(e.to_string());
    let pixels = rgb_of_frame(&photo.frame).map_err(odd)?;
    let mut canvas = Canvas::from_pixels(width, height, pixels).ok_or_else(|| odd(StillError::Layout))?;
    let thickness = match settings.thickness {
        t if t > 0.0 => t,
        _ => (width.max(height) as f64 / 1000.0).max(1.0),
    };
    let mesh = &map.warp.mesh;
    let scale = (width as f64 / map.warp.size.0 as f64, height as f64 / map.warp.size.1 as f64);
    let vertices: Vec<Point2> = mesh.vertices.iter().map(|v| Point2::new(v.x * scale.0, v.y * scale.1)).collect();
    canvas.grid(&vertices, mesh.cols + 1, COLOR, thickness);
    let frame = frame_of_rgb(canvas.as_bytes(), width, height).map_err(odd)?;
    context.values.put(stage, "image", Arc::new(with_pixels(&photo, frame)));
    Ok(())
}
