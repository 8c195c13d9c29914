//! `lines.detect`: finds lines that are straight in the world.

use std::sync::{Arc, Mutex, PoisonError};

use super::photo::gray_levels;
use super::photo::lens::{self, LensRequest};
use super::prelude::*;
use super::values::LineSet;
use plumbline_camera::{FieldAxis, Lens};
use plumbline_image::still::Photo;
use plumbline_image::{Frame, Plane};
use plumbline_num::math::{Point2, Rect};
use plumbline_num::run::Run;
use plumbline_photo::Line;
use plumbline_photo::line_detection::{
    DetectedLine, LineDetectionOptions, continued, detect_lines, followed, off_faces, unmarked,
};
use plumbline_photo::rectify::SoftLine;

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

fn found(photo: &Photo, settings: &LinesDetectSettings, run: &Run) -> Result<LineSet, RunError> {
    let lens = match LensRequest::of_lines(settings) {
        Some(request) => lens::find_unless_stitched(photo, &[], request, run)?.map(Arc::new),
        None => None,
    };
    let search = LineSearch::of(&photo.frame);
    let found = search.map_or(Ok(Vec::new()), |search| search.lines(lens.as_ref().map(|found| &found.lens), run))?;
    let lines = found.into_iter().filter(|line| !settings.without.contains(&line.name)).collect();
    Ok(LineSet { lines, lens, found: true })
}

/// Longest side of the picture that is searched, px: views of it have half as many.
const MAX_SIDE_PX: usize = 2800;

/// The gray levels of a picture in which lines are searched, under one lens or another.
#[derive(Clone, Debug)]
pub struct LineSearch {
    levels: Plane<f32>,
    /// Of the picture, px.
    size: (f64, f64),
    /// What was found last, and under which lens: settings and marks change more often.
    last: Arc<Mutex<Option<LastSearch>>>,
}

/// What a search found.
#[derive(Clone, Debug)]
struct LastSearch {
    lens: Option<Lens>,
    lines: Vec<DetectedLine>,
}

impl LineSearch {
    /// Of a picture; `None` where its memory does not hold its planes.
    pub fn of(frame: &Frame) -> Option<Self> {
        let levels = gray_levels(frame, MAX_SIDE_PX)?;
        Some(Self { levels, size: (frame.width as f64, frame.height as f64), last: Arc::default() })
    }

    /// The gray levels, 0 to 255, smaller than the picture where that is large.
    pub fn levels(&self) -> &Plane<f32> {
        &self.levels
    }

    /// Pixels of the picture per pixel of the gray levels, x and y.
    pub fn scale(&self) -> (f64, f64) {
        (self.size.0 / self.levels.width() as f64, self.size.1 / self.levels.height() as f64)
    }

    /// The lines of the picture, px, as two ends each. `lens` is of the picture; without one it is taken as perspective.
    ///
    /// # Errors
    /// [`RunError::Interrupted`].
    pub fn lines(&self, lens: Option<&Lens>, run: &Run) -> Result<Vec<Line>, RunError> {
        Ok(self.detected(lens, run)?.into_iter().map(|detected| detected.line).collect())
    }

    /// What a map is made of: marked or found lines over their whole visible length, and beside marked ones those that nobody marked,
    /// as soft constraints. Edges on faces are no lines, unless they were marked.
    ///
    /// # Errors
    /// [`RunError::Interrupted`].
    pub fn constraints(
        &self,
        (lines, found): (Vec<Line>, bool),
        lens: &Lens,
        faces: &[Rect],
        run: &Run,
    ) -> Result<Constraints, RunError> {
        let given = if found { off_faces(lines, faces) } else { lines };
        let lines = continued(&given, lens, self.levels.as_ref());
        if found || lines.is_empty() {
            return Ok(Constraints { lines, soft: Vec::new() });
        }
        run.check()?;
        let mut found = self.detected(Some(lens), run)?;
        found.retain(|detected| !off_faces(vec![detected.line.clone()], faces).is_empty());
        let courses: Vec<Line> = found.iter().map(|detected| detected.line.clone()).collect();
        let courses = followed(&courses, lens, self.levels.as_ref());
        found.iter_mut().zip(courses).for_each(|(detected, line)| detected.line = line);
        let soft = unmarked(&found, &lines, lens);
        Ok(Constraints { lines, soft })
    }

    fn detected(&self, lens: Option<&Lens>, run: &Run) -> Result<Vec<DetectedLine>, RunError> {
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = last().as_ref().filter(|known| known.lens.as_ref() == lens) {
            return Ok(known.lines.clone());
        }
        let lines = self.searched(lens, run)?;
        *last() = Some(LastSearch { lens: lens.cloned(), lines: lines.clone() });
        Ok(lines)
    }

    fn searched(&self, lens: Option<&Lens>, run: &Run) -> Result<Vec<DetectedLine>, RunError> {
        // A picture of few pixels across is of another shape when it is small, and shows no lines.
        let size = (self.levels.width() as f64, self.levels.height() as f64);
        let Ok(small) = lens.map(|lens| lens.resized(size)).transpose() else { return Ok(Vec::new()) };
        let detection = detect_lines(self.levels.as_ref(), small.as_ref(), &LineDetectionOptions::default(), run)?;
        let scale = self.scale();
        let at = |p: &Point2| Point2::new(p.x * scale.0, p.y * scale.1);
        // Of what lies between the ends the lens determines all. More points would be taken for measurements of it, once they
        // are saved and read back.
        let ends = |points: &[Point2]| points.first().into_iter().chain(points.last()).map(at).collect();
        let of_ends = |d: DetectedLine| DetectedLine { line: Line { points: ends(&d.line.points), ..d.line }, ..d };
        Ok(detection.lines.into_iter().map(of_ends).collect())
    }
}

/// The lines that a map is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Constraints {
    /// Those to be straight, in the order in which they were given.
    pub lines: Vec<Line>,
    /// Those that nobody marked.
    pub soft: Vec<SoftLine>,
}
