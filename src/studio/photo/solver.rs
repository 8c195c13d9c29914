//! The map of the photo: quickly while something is dragged, and as the pipeline makes it at rest.
//!
//! A drag is solved on a coarser grid from its last solution, in a crop of its own: both are prepared at rest, once the picture is
//! shown. At rest the map is solved by the
//! call of the stage `photo.rectify`, from nothing, so that the saved pipeline gives the picture that is shown.

use plumbline_app::pipeline::RunError;
use plumbline_app::stages::PhotoRectifySettings;
use plumbline_app::stages::photo_steps::{rectified, rectify_options};
use plumbline_camera::Lens;
use plumbline_image::Plane;
use plumbline_num::math::Rect;
use plumbline_num::run::Run;
use plumbline_photo::rectify::{Rectifier, RectifyInput, RectifyOptions, SoftLine, Target};
use plumbline_photo::{Line, PhotoError, PhotoWarp};

/// Cells along the longer side of the grid of drags; the pipeline's has 48. Measured on 24 lines: the map differs by less than a
/// pixel of the screen, in a third of the time.
const DRAFT_CELLS: usize = 24;

/// What a map is made of.
#[derive(Clone, Debug)]
pub(super) struct MapInput {
    pub(super) lens: Lens,
    pub(super) lines: Vec<Line>,
    /// The lines were found, not marked.
    pub(super) found: bool,
    /// Lines that nobody marked.
    pub(super) soft: Vec<SoftLine>,
    pub(super) faces: Vec<Rect>,
    pub(super) settings: PhotoRectifySettings,
}

impl MapInput {
    fn borrowed<'a>(&'a self, saliency: Option<&'a Plane<f32>>) -> RectifyInput<'a> {
        RectifyInput {
            lens: &self.lens,
            lines: &self.lines,
            soft_lines: &self.soft,
            found: self.found,
            faces: &self.faces,
            saliency,
        }
    }

    /// All but the lines is the same.
    fn differs_in_lines_alone(&self, other: &Self) -> bool {
        self.lens == other.lens
            && self.found == other.found
            && self.faces == other.faces
            && self.settings == other.settings
    }

    /// The map at rest.
    pub(super) fn exact(&self, saliency: Option<&Plane<f32>>, run: &Run) -> Result<PhotoWarp, RunError> {
        rectified(&self.borrowed(saliency), &self.settings, run)
    }
}

/// The map while something is dragged.
#[derive(Debug, Default)]
pub(super) struct Draft {
    last: Option<Last>,
}

#[derive(Debug)]
struct Last {
    input: MapInput,
    rectifier: Rectifier,
    /// The crop, searched once after a solve from nothing.
    frame: Option<Rect>,
}

impl Draft {
    /// The map for an input that differs little from the last one.
    pub(super) fn solve(
        &mut self,
        input: &MapInput,
        saliency: Option<&Plane<f32>>,
        run: &Run,
    ) -> Result<PhotoWarp, RunError> {
        if input.settings.to != Target::Optimized {
            return input.exact(saliency, run);
        }
        // What is interrupted leaves the last solution, from which the next begins.
        match self.of_same_view(input) {
            Some(last) => last.rectifier.follow(&input.lines, run)?,
            None => self.begin(input, saliency, run)?,
        }
        Ok(self.framed()?)
    }

    /// At rest: what the next drag starts from, solved anew, and its crop.
    pub(super) fn prepare(
        &mut self,
        input: &MapInput,
        saliency: Option<&Plane<f32>>,
        run: &Run,
    ) -> Result<(), RunError> {
        if input.settings.to != Target::Optimized {
            return Ok(());
        }
        match self.of_same_view(input) {
            Some(last) => {
                last.rectifier.solve(&input.lines, run)?;
                last.frame = None;
            }
            None => self.begin(input, saliency, run)?,
        }
        self.framed()?;
        Ok(())
    }

    fn of_same_view(&mut self, input: &MapInput) -> Option<&mut Last> {
        self.last.as_mut().filter(|last| last.input.differs_in_lines_alone(input))
    }

    fn begin(&mut self, input: &MapInput, saliency: Option<&Plane<f32>>, run: &Run) -> Result<(), PhotoError> {
        let options = RectifyOptions { cells: DRAFT_CELLS, ..rectify_options(&input.settings, &input.lens) };
        let rectifier = Rectifier::new(&input.borrowed(saliency), &options, run)?;
        self.last = Some(Last { input: input.clone(), rectifier, frame: None });
        Ok(())
    }

    fn framed(&mut self) -> Result<PhotoWarp, PhotoError> {
        let nothing = || PhotoError::Output("nothing is solved yet".to_owned());
        let last = self.last.as_mut().ok_or_else(nothing)?;
        let frame = match last.frame {
            Some(frame) => frame,
            None => last.rectifier.frame()?,
        };
        last.frame = Some(frame);
        last.rectifier.warp_in(&frame)
    }
}
