//! What is known of the photo: its pixels, and what is found in them once. Lines, faces and importance are searched one after
//! another, between the letters of the windows.

use std::path::Path;
use std::sync::Arc;

use super::protocol::PhotoInfo;
use crate::error::StudioError;
use plumbline_app::pipeline::RunError;
use plumbline_app::stages::photo_steps::{LensClues, line_search, load};
use plumbline_app::stages::{FacesDetectSettings, ImageLoadSettings};
use plumbline_image::feature::{Face, FaceDetector, FaceOptions, Importance, ImportanceOptions};
use plumbline_image::still::{ExifTags, Photo};
use plumbline_image::warp::{Map, WarpField};
use plumbline_num::math::Point2;
use plumbline_num::run::{Run, Stopped};
use plumbline_photo::Line;
use plumbline_photo::line_detection::LineSearch;

/// Pixels up to which the whole photo stays in memory. A larger one is read again for an export, and zoomed into as far as its copy
/// of so many pixels shows.
const MAX_KEPT_PIXELS: usize = 40_000_000;
/// Longest sides of the copies from which results are drawn while something is dragged, px: the first is that of a large window,
/// each has half of the pixels of the one before.
const DRAFT_SIDES: [usize; 5] = [1280, 905, 640, 453, 320];
/// Pixels of a copy that a pixel of the screen spans at most: up to here the renderer takes one sample of it, beyond the mean of four
/// or more.
const MAX_SPAN: f64 = 1.2;

/// The photo, and what is found in it.
#[derive(Debug)]
pub(super) struct Analysis {
    /// Width and height of the photo, px.
    pub(super) size: (usize, usize),
    /// EXIF and size.
    pub(super) clues: LensClues,
    /// The gray levels in which lines are searched.
    pub(super) search: Option<LineSearch>,
    /// The photo, until everything was searched, and beyond where it is not too large.
    pub(super) detail: Photo,
    /// Small copies, the largest first.
    drafts: Vec<Photo>,
    /// Faces that were found.
    pub(super) faces: Option<Arc<[Face]>>,
    /// Importance that was judged.
    pub(super) importance: Option<Arc<Importance>>,
    /// Warnings of reading it.
    pub(super) warnings: Vec<String>,
    /// Found lines, and the lens under which they were searched.
    pub(super) found: Option<Found>,
}

/// Found lines.
#[derive(Debug)]
pub(super) struct Found {
    /// The lens, as `Debug` shows it, or none: what the search depends on.
    pub(super) key: String,
    /// The lines, the best first.
    pub(super) lines: Arc<[Line]>,
}

impl Analysis {
    /// Reads the photo.
    pub(super) fn open(path: &Path, settings: &ImageLoadSettings, run: &Run) -> Result<Self, StudioError> {
        let mut photo = read(path, settings)?;
        run.check()?;
        let clues = LensClues::of(&photo);
        let search = line_search(&photo.frame);
        let drafts = drafts_of(&photo, run)?;
        let size = (photo.frame.width, photo.frame.height);
        let warnings = std::mem::take(&mut photo.warnings);
        Ok(Self { size, clues, search, detail: photo, drafts, faces: None, importance: None, warnings, found: None })
    }

    /// Width and height, px.
    pub(super) fn sides(&self) -> (f64, f64) {
        (self.size.0 as f64, self.size.1 as f64)
    }

    /// The copy for drags where a pixel of the screen spans `scale` pixels of the photo: the largest of which it spans no more than
    /// [`MAX_SPAN`].
    pub(super) fn draft(&self, scale: f64) -> &Photo {
        let fits = |copy: &&Photo| scale * copy.frame.width as f64 <= MAX_SPAN * self.size.0 as f64;
        self.drafts.iter().find(fits).unwrap_or(&self.drafts[self.drafts.len() - 1])
    }

    /// Judges importance and finds faces, where that was not done; then the photo shrinks to what is kept.
    ///
    /// True where it did something: there may be more.
    pub(super) fn search_photo(&mut self, faces: Option<&FacesDetectSettings>, run: &Run) -> Result<bool, Stopped> {
        if self.importance.is_none() {
            let options = ImportanceOptions::default();
            let judged = Importance::of_frame(&self.detail.frame, &[], None, &options, run);
            run.check()?;
            // A picture of a layout that cannot be judged has none, and the pipeline says why.
            self.importance = Some(Arc::new(match judged {
                Ok(importance) => importance,
                Err(_) => return Ok(false),
            }));
            return Ok(true);
        }
        if self.faces.is_none() {
            let min_score = faces.map_or(FacesDetectSettings::default().min_score, |s| s.min_score);
            let options = FaceOptions { min_score, ..FaceOptions::default() };
            self.faces = Some(FaceDetector::new(options).detect(&self.detail.frame, run)?.into());
            return Ok(true);
        }
        if self.detail.frame.width * self.detail.frame.height > MAX_KEPT_PIXELS {
            let side = (self.sides().0.max(self.sides().1)
                * (MAX_KEPT_PIXELS as f64 / (self.sides().0 * self.sides().1)).sqrt()) as usize;
            if let Ok(kept) = smaller(&self.detail, side, run) {
                self.detail = kept;
            }
            run.check()?;
            return Ok(true);
        }
        Ok(false)
    }

    /// The whole photo, for an export.
    pub(super) fn with_whole<T>(
        &self,
        path: &Path,
        settings: &ImageLoadSettings,
        export: impl FnOnce(&Photo) -> Result<T, StudioError>,
    ) -> Result<T, StudioError> {
        if (self.detail.frame.width, self.detail.frame.height) == self.size {
            return export(&self.detail);
        }
        export(&read(path, settings)?)
    }

    /// What the page says of the photo.
    pub(super) fn info(&self, name: &str) -> PhotoInfo {
        let (width, height) = self.size;
        let exif = described(&self.clues.tags);
        PhotoInfo { name: name.to_owned(), width, height, exif, reduced: width * height > MAX_KEPT_PIXELS }
    }
}

fn read(path: &Path, settings: &ImageLoadSettings) -> Result<Photo, StudioError> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    load(path, settings.max_pixels, threads).map_err(|e| input(path, e))
}

fn input(path: &Path, error: RunError) -> StudioError {
    match error {
        RunError::Interrupted => StudioError::Stopped(Stopped::Interrupted),
        error => {
            let text = error.to_string();
            let why = text.strip_prefix(&format!("{}: ", path.display())).unwrap_or(&text).to_owned();
            StudioError::Input { path: path.to_owned(), why }
        }
    }
}

/// Copies for drags, each from the one before.
fn drafts_of(photo: &Photo, run: &Run) -> Result<Vec<Photo>, StudioError> {
    let mut drafts: Vec<Photo> = Vec::new();
    for side in DRAFT_SIDES {
        drafts.push(smaller(drafts.last().unwrap_or(photo), side, run)?);
    }
    Ok(drafts)
}

/// A copy whose longer side is at most so long, as the mean over its pixels.
pub(super) fn smaller(photo: &Photo, side: usize, run: &Run) -> Result<Photo, StudioError> {
    let (width, height) = (photo.frame.width, photo.frame.height);
    let (w, h) = plumbline_image::analysis_size(width, height, side);
    let scale = (width as f64 / w as f64, height as f64 / h as f64);
    let map = Map::Affine(nalgebra::Matrix2x3::new(scale.0, 0.0, 0.0, 0.0, scale.1, 0.0));
    let field = WarpField::identity().then(map);
    photo.rendered(&field, (w, h), run).map_err(|e| StudioError::Method(e.to_string()))
}

/// EXIF of camera and lens as the page lists it.
fn described(tags: &ExifTags) -> Vec<(String, String)> {
    let text = |name: &str, value: Option<String>| value.map(|v| (name.to_owned(), v));
    let camera = [tags.make.clone(), tags.model.clone()].into_iter().flatten().collect::<Vec<_>>().join(" ");
    [
        text("Camera", Some(camera).filter(|c| !c.is_empty())),
        text("Lens", tags.lens_model.clone()),
        text("Focal length", tags.focal_mm.map(|f| format!("{f:.1} mm"))),
        text("As full frame", tags.focal_35mm.map(|f| format!("{f:.0} mm"))),
        text("Digital zoom", tags.digital_zoom.filter(|z| *z > 1.0).map(|z| format!("{z:.2}×"))),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Length between the ends of a line, px.
pub(super) fn length(points: &[Point2]) -> f64 {
    points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum()
}
