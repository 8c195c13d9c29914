//! The map that makes the irregular border of a stitched picture a rectangle.

use serde_json::{Map, json};

use super::report_lines;
use crate::pipeline::run_error::RunError;
use crate::pipeline::sizes::{PictureSize, TargetSize};
use crate::stages::context::Context;
use crate::stages::values::PhotoMap;
use plumbline_image::still::Photo;
use plumbline_image::{Plane, analysis_luma};
use plumbline_num::math::Rect;
use plumbline_photo::Line;
use plumbline_photo::rectangle::{Outline, RectangleInput, RectangleOptions, RectangleShape, rectangle};

/// Longest side of the gray levels that seams are laid in, px.
const LUMA_SIDE: usize = 960;

/// The map of a picture.
pub(crate) fn make(
    context: &mut Context<'_, '_>,
    photo: &Photo,
    lines: &[Line],
    faces: &[Rect],
    wanted: Option<TargetSize>,
) -> Result<PhotoMap, RunError> {
    // The outline, and the gray levels that seams avoid.
    let outline = Outline::of_frame(&photo.frame).ok_or_else(no_border)?;
    context.job.check_cancel()?;
    let mut luma = Plane::new(0, 0);
    if !analysis_luma(&photo.frame, LUMA_SIDE, &mut luma) {
        return Err(RunError::Internal("the memory of the picture does not contain its planes".to_owned()));
    }
    // The map.
    let size = (photo.frame.width, photo.frame.height);
    let input = RectangleInput { size, outline: &outline, luma: luma.as_ref(), lines, faces };
    let solve = |shape| {
        let options = RectangleOptions { shape, ..RectangleOptions::default() };
        rectangle(&input, &options, &context.job.run()).map_err(RunError::from)
    };
    let mut made = solve(match wanted {
        Some(TargetSize::Shape(ratio)) => RectangleShape::Aspect(ratio.value()),
        Some(TargetSize::Size(PictureSize::Pixels(size))) => {
            RectangleShape::Exact(size.width as usize, size.height as usize)
        }
        _ => RectangleShape::Natural,
    })?;
    if let Some(TargetSize::Size(relative)) = wanted {
        // The shape that stretches least is known now; a size relative to it is rendered at once.
        let (width, height) = relative.pixels(made.warp.size);
        if (width, height) != made.warp.size {
            made = solve(RectangleShape::Exact(width, height))?;
        }
    }
    // The summary and the report.
    report_lines(context, &made.warp.lines, &[]);
    let mut report = Map::new();
    report.insert("inside".into(), json!(outline.inside_fraction()));
    report.insert("stretch".into(), json!(made.stretch));
    report.insert("outside_shown".into(), json!(made.outside));
    report.insert("faces".into(), faces.len().into());
    Ok(PhotoMap { warp: made.warp, report })
}

fn no_border() -> RunError {
    let what = "a border that is transparent, black or white along the frame is what rectangling fills";
    RunError::Input(format!("nothing lies around the picture: {what}"))
}
