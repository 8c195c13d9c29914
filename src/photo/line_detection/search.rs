//! The lines that a map of a photo is made of: marked or found, over their whole visible length, and beside marked ones those that
//! nobody marked.

use std::sync::{Arc, Mutex, PoisonError};

use super::continuation::followed;
use super::straight::straight;
use super::{DetectedLine, LineDetectionOptions, continued, detect_lines, off_faces, unmarked};
use crate::Line;
use crate::rectify::SoftLine;
use plumbline_camera::Lens;
use plumbline_image::Plane;
use plumbline_num::math::{Point2, Rect};
use plumbline_num::run::{Run, Stopped};

/// The gray levels of a photo, in which lines are searched under one lens or another. Clones share what was found last.
///
/// # Example
/// ```
/// use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection};
/// use plumbline_image::Plane;
/// use plumbline_num::math::Point2;
/// use plumbline_num::run::Run;
/// use plumbline_photo::line_detection::LineSearch;
/// use plumbline_photo::{Line, Orientation};
///
/// // A sill and a wall; of the sill a part is marked.
/// let levels = Plane::from_fn(300, 200, |x, y| if y < 120 || x > 250 { 30.0 } else { 200.0 });
/// let search = LineSearch::new(levels, (300.0, 200.0));
/// let fov = FieldOfView::degrees(90.0, FieldAxis::Horizontal);
/// let lens = Lens::from_field_of_view(Projection::Rectilinear, fov, (300.0, 200.0))?;
/// let points = vec![Point2::new(80.0, 120.0), Point2::new(160.0, 120.0)];
/// let sill = Line { name: "sill".to_owned(), points, orientation: Orientation::Free };
/// let constraints = search.of_marked(&[sill], &lens, &[], &Run::default()).expect("a run that never stops");
/// assert!(constraints.lines[0].points[0].x < 8.0, "it is continued");
/// assert_eq!(constraints.soft.len(), 1, "the wall");
/// # Ok::<(), plumbline_camera::LensError>(())
/// ```
#[derive(Clone, Debug)]
pub struct LineSearch {
    levels: Arc<Plane<f32>>,
    /// Of the photo, px.
    size: (f64, f64),
    /// What was found last, and under which lens: settings and marks change more often.
    last: Arc<Mutex<Option<LastSearch>>>,
}

/// What a search found.
#[derive(Clone, Debug)]
struct LastSearch {
    lens: Option<Lens>,
    lines: Vec<DetectedLine>,
    /// Of each, whether its edge is straight; beside marked lines, which decide where they disagree, the others count too.
    straight: Vec<bool>,
}

/// The lines that a map is made of.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LineConstraints {
    /// Those to be straight, in the order in which they were given.
    pub lines: Vec<Line>,
    /// Those that nobody marked.
    pub soft: Vec<SoftLine>,
}

impl LineSearch {
    /// In gray levels, 0 to 255, of a photo of `size` px, at any resolution.
    pub fn new(levels: Plane<f32>, size: (f64, f64)) -> Self {
        Self { levels: Arc::new(levels), size, last: Arc::default() }
    }

    /// The gray levels.
    pub fn levels(&self) -> &Plane<f32> {
        &self.levels
    }

    /// Pixels of the photo per pixel of the gray levels, x and y.
    pub fn scale(&self) -> (f64, f64) {
        (self.size.0 / self.levels.width() as f64, self.size.1 / self.levels.height() as f64)
    }

    /// The lines of the photo, px, as two ends each. `lens` is of the photo; without one it is taken as perspective.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn lines(&self, lens: Option<&Lens>, run: &Run) -> Result<Vec<Line>, Stopped> {
        let LastSearch { lines, straight, .. } = self.detected(lens, run)?;
        let straight = lines.into_iter().zip(straight).filter(|(_, is_straight)| *is_straight);
        Ok(straight.map(|(detected, _)| detected.line).collect())
    }

    /// Of lines that were found: those that are no edges of faces, as their edges are measured over their whole visible length. It is
    /// the edge that is made straight, not the great circle: between the two lies the error of the lens, one to two pixels of an
    /// ordinary wide-angle photo.
    pub fn of_found(&self, lines: Vec<Line>, lens: &Lens, faces: &[Rect]) -> LineConstraints {
        let lines = followed(&off_faces(lines, faces), lens, self.levels().as_ref());
        LineConstraints { lines, soft: Vec::new() }
    }

    /// Of lines that were marked: those, over their whole visible length, and beside them those that nobody marked. Without marks
    /// nothing is searched.
    ///
    /// # Errors
    /// [`Stopped`].
    pub fn of_marked(
        &self,
        lines: &[Line],
        lens: &Lens,
        faces: &[Rect],
        run: &Run,
    ) -> Result<LineConstraints, Stopped> {
        let lines = continued(lines, lens, self.levels().as_ref());
        if lines.is_empty() {
            return Ok(LineConstraints::default());
        }
        run.check()?;
        let mut found = self.detected(Some(lens), run)?.lines;
        found.retain(|detected| !off_faces(vec![detected.line.clone()], faces).is_empty());
        let courses: Vec<Line> = found.iter().map(|detected| detected.line.clone()).collect();
        let courses = followed(&courses, lens, self.levels().as_ref());
        found.iter_mut().zip(courses).for_each(|(detected, line)| detected.line = line);
        let soft = unmarked(&found, &lines, lens);
        Ok(LineConstraints { lines, soft })
    }

    fn detected(&self, lens: Option<&Lens>, run: &Run) -> Result<LastSearch, Stopped> {
        let last = || self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = last().as_ref().filter(|known| known.lens.as_ref() == lens) {
            return Ok(known.clone());
        }
        let (lines, straight) = self.searched(lens, run)?.into_iter().unzip();
        let found = LastSearch { lens: lens.cloned(), lines, straight };
        *last() = Some(found.clone());
        Ok(found)
    }

    /// The lines, and whether the edge of each is straight.
    fn searched(&self, lens: Option<&Lens>, run: &Run) -> Result<Vec<(DetectedLine, bool)>, Stopped> {
        // A picture of few pixels across is of another shape when it is small, and shows no lines.
        let size = (self.levels.width() as f64, self.levels.height() as f64);
        let Ok(small) = lens.map(|lens| lens.resized(size)).transpose() else { return Ok(Vec::new()) };
        let levels = self.levels().as_ref();
        let found = detect_lines(levels, small.as_ref(), &LineDetectionOptions::default(), run)?.lines;
        let courses: Vec<&Line> = found.iter().map(|detected| &detected.line).collect();
        let straight = small.map_or_else(|| vec![true; courses.len()], |lens| straight(&courses, &lens, levels));
        let scale = self.scale();
        let at = |p: &Point2| Point2::new(p.x * scale.0, p.y * scale.1);
        // Of what lies between the ends the lens determines all. More points would be taken for measurements of it, once they
        // are saved and read back.
        let ends = |points: &[Point2]| points.first().into_iter().chain(points.last()).map(at).collect();
        let of_ends = |d: DetectedLine| DetectedLine { line: Line { points: ends(&d.line.points), ..d.line }, ..d };
        Ok(found.into_iter().map(of_ends).zip(straight).collect())
    }
}
