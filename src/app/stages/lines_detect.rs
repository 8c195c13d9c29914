//! `lines.detect`: finds lines that are straight in the world.

use std::sync::Arc;

use super::photo::lens::{self, LensRequest};
use super::prelude::*;
use super::values::LineSet;
use plumbline_camera::FieldAxis;
use plumbline_image::still::Photo;
use plumbline_image::{Plane, analysis_luma};
use plumbline_num::math::Point2;
use plumbline_num::run::Run;
use plumbline_photo::Line;
use plumbline_photo::line_detection::{LineDetectionOptions, detect_lines};

/// Settings of `lines.detect`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LinesDetectSettings {
    /// Names of lines that are found but not wanted, as the report calls them
    pub without: Vec<String>,
    /// The lens: none takes what is straight in the picture; else as in photo.rectify
    #[schemars(extend("format" = "lens"))]
    pub lens: String,
    /// Field of view, degrees, for a lens named by its model
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov: Option<f64>,
    /// The direction along which the field of view is measured
    pub fov_axis: FieldAxis,
}

impl Default for LinesDetectSettings {
    fn default() -> Self {
        Self { without: Vec::new(), lens: "none".to_owned(), fov: None, fov_axis: FieldAxis::default() }
    }
}

impl Stage for LinesDetectSettings {
    const KIND: &'static str = "lines.detect";
    const SUMMARY: &'static str = "finds lines that are straight in the world";
    const INPUTS: &'static [Port] = &[
        Port::one("image", PortType::Image, "the picture"),
        Port::optional(
            "marked",
            PortType::Lines,
            "marked lines: where there are any, they are taken and none are searched",
        ),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("lines", PortType::Lines, "the lines")];
    type Input = (Arc<Photo>, Option<LineSet>);
    type Output = (LineSet,);

    fn run(&self, (photo, marked): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        match marked.filter(|set| !set.lines.is_empty()) {
            Some(marked) => Ok((marked,)),
            None => Ok((found(&photo, self, &context.job.run())?,)),
        }
    }
}

/// Longest side of the picture that is searched, px: views of it have half as many.
const MAX_SIDE_PX: usize = 2800;

fn found(photo: &Photo, settings: &LinesDetectSettings, run: &Run) -> Result<LineSet, RunError> {
    let lens = match LensRequest::of_lines(settings) {
        Some(request) => lens::find_unless_stitched(photo, &[], request, run)?.map(Arc::new),
        None => None,
    };
    let mut luma = Plane::new(0, 0);
    if !analysis_luma(&photo.frame, MAX_SIDE_PX, &mut luma) {
        return Ok(LineSet { lines: Vec::new(), lens, found: true });
    }
    let (width, height) = (luma.width(), luma.height());
    let levels = Plane::from_fn(width, height, |x, y| f32::from(luma.as_ref().row(y)[x]));
    drop(luma);
    // A picture of few pixels across is of another shape when it is small, and shows no lines.
    let Ok(small) = lens.as_ref().map(|found| found.lens.resized((width as f64, height as f64))).transpose() else {
        return Ok(LineSet { lines: Vec::new(), lens, found: true });
    };
    let detection = detect_lines(levels.as_ref(), small.as_ref(), &LineDetectionOptions::default(), run)?;
    let scale = (photo.frame.width as f64 / width as f64, photo.frame.height as f64 / height as f64);
    let at = |p: &Point2| Point2::new(p.x * scale.0, p.y * scale.1);
    // Of what lies between the ends the lens determines all. More points would be taken for measurements of it, once they are
    // saved and read back.
    let ends = |points: &[Point2]| points.first().into_iter().chain(points.last()).map(at).collect();
    let line = |line: Line| Line { points: ends(&line.points), ..line };
    let wanted = |line: &Line| !settings.without.contains(&line.name);
    let lines = detection.lines.into_iter().map(|d| line(d.line)).filter(wanted).collect();
    Ok(LineSet { lines, lens, found: true })
}
