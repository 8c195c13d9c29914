//! `lines.detect`: finds lines that are straight in the world.

use std::sync::Arc;

use super::photo::gray_levels;
use super::photo::lens::{self, LensRequest};
use super::prelude::*;
use super::values::{LineSet, Searched};
use plumbline_camera::FieldAxis;
use plumbline_image::Frame;
use plumbline_image::still::Photo;
use plumbline_num::run::Run;
use plumbline_photo::line_detection::LineSearch;

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

fn found(photo: &Arc<Photo>, settings: &LinesDetectSettings, run: &Run) -> Result<LineSet, RunError> {
    let lens = match LensRequest::of_lines(settings) {
        Some(request) => lens::find_unless_stitched(photo, &[], request, run)?.map(Arc::new),
        None => None,
    };
    let search = line_search(&photo.frame);
    let in_search = |search: &LineSearch| search.lines(lens.as_ref().map(|found| &found.lens), run);
    let found = search.as_ref().map_or(Ok(Vec::new()), in_search)?;
    let lines = found.into_iter().filter(|line| !settings.without.contains(&line.name)).collect();
    Ok(LineSet { lines, lens, found: true, searched: search.map(|search| Searched::new(photo, search)) })
}

/// Longest side of the picture that is searched, px: views of it have half as many.
const MAX_SIDE_PX: usize = 2800;

/// The gray levels in which the lines of a picture are searched; `None` where its memory does not hold its planes.
pub fn line_search(frame: &Frame) -> Option<LineSearch> {
    let levels = gray_levels(frame, MAX_SIDE_PX)?;
    Some(LineSearch::new(levels, (frame.width as f64, frame.height as f64)))
}
