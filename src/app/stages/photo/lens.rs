//! Which lens took a picture: what the user says, what the file says, what the marked lines say.

use std::path::Path;
use std::sync::{Arc, OnceLock};

use super::gray_levels;
use crate::pipeline::paths::to_path;
use crate::pipeline::run_error::RunError;
use crate::stages::lines_detect::LinesDetectSettings;
use crate::stages::photo_rectify::PhotoRectifySettings;
use plumbline_camera::{ExifFacts, FieldAxis, FieldOfView, Lens, Projection, lensfun_lens, read_lens};
use plumbline_image::Plane;
use plumbline_image::still::{ExifTags, Photo};
use plumbline_num::run::Run;
use plumbline_photo::Line;
use plumbline_photo::calibration::{CalibrationOptions, EdgeCalibration, LineRole, calibrate, calibrate_edges};
use plumbline_photo::rectangle::Outline;

/// Relative error that a focal length from EXIF may have, and one that the user gives. EXIF rounds to whole
/// millimeters and counts in 35-mm terms; the user's number is trusted to its last digit.
const CLAIMED: f64 = 0.1;
const GIVEN: f64 = 0.01;
/// Least lines of three points or more from which a lens is found.
const MIN_LINES: usize = 3;

/// What a file and its pixels say of the lens.
#[derive(Clone, Debug)]
pub struct LensClues {
    /// EXIF.
    pub tags: ExifTags,
    /// Width and height of the picture, px.
    pub size: (f64, f64),
    /// Gray levels, 0 to 255, in which edges are followed; none of a picture that was stitched, which no lens took.
    pub levels: Option<Plane<f32>>,
    /// The lens of its edges, once they were followed: they do not change while settings and marks do.
    of_edges: Arc<OnceLock<Option<Found>>>,
}

impl LensClues {
    /// Of a picture.
    pub fn of(photo: &Photo) -> Self {
        let file = Self::of_file(photo);
        let named = facts(photo.tags.clone(), file.size).lens().is_ok();
        let levels = (named || !is_stitched(photo)).then(|| gray_levels(&photo.frame, CURVES_SIDE_PX)).flatten();
        Self { levels, ..file }
    }

    /// What the file alone says, where no edges are needed.
    fn of_file(photo: &Photo) -> Self {
        let size = (photo.frame.width as f64, photo.frame.height as f64);
        Self { tags: photo.tags.clone(), size, levels: None, of_edges: Arc::default() }
    }
}

fn is_stitched(photo: &Photo) -> bool {
    Outline::of_frame(&photo.frame).is_some_and(|outline| outline.is_stitched())
}

/// What the user says of the lens.
#[derive(Clone, Copy, Debug)]
pub struct LensRequest<'s> {
    lens: &'s str,
    fov: Option<FieldOfView>,
}

impl<'s> LensRequest<'s> {
    fn new(lens: &'s str, fov: Option<f64>, axis: FieldAxis) -> Self {
        Self { lens, fov: fov.map(|degrees| FieldOfView::degrees(degrees, axis)) }
    }

    /// Of a rectifying stage.
    pub fn of_rectify(settings: &'s PhotoRectifySettings) -> Self {
        Self::new(&settings.lens, settings.fov, settings.fov_axis)
    }

    /// Of a stage that finds lines; `None` where it shall find them without a lens.
    pub fn of_lines(settings: &'s LinesDetectSettings) -> Option<Self> {
        (settings.lens != "none").then(|| Self::new(&settings.lens, settings.fov, settings.fov_axis))
    }
}

/// A lens for the picture's size, and how it was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The lens.
    pub lens: Lens,
    /// In words, for the report.
    pub how: String,
    /// Relative standard deviation of the focal length, where the source states one.
    pub focal_sigma: Option<f64>,
    /// For the user.
    pub warnings: Vec<String>,
}

impl Found {
    /// Field of view along the width, rad.
    pub fn width(&self) -> Option<f64> {
        self.lens.field_of_view(FieldAxis::Horizontal).map(|field| field.radians)
    }

    /// Its standard deviation, rad: what a focal length off by its own would change.
    pub fn sigma(&self) -> Option<f64> {
        let focal = self.lens.focal * (1.0 + self.focal_sigma?);
        let other = Lens { focal, ..self.lens.clone() };
        Some((self.width()? - other.field_of_view(FieldAxis::Horizontal)?.radians).abs())
    }

    /// Projection, field, uncertainty and source in words.
    pub fn named(&self) -> String {
        let field = self.width().map(|width| match self.sigma() {
            Some(sigma) => format!(" {:.1}° ± {:.1}° wide", width.to_degrees(), sigma.to_degrees()),
            None => format!(" {:.1}° wide", width.to_degrees()),
        });
        format!("{}{} ({})", self.lens.projection.name(), field.unwrap_or_default(), self.how)
    }
}

/// The lens of a picture.
///
/// # Errors
/// [`RunError`]: a lens that is not known, a file that cannot be read, lines that no lens makes straight, an interruption.
pub fn find(clues: &LensClues, marked: &[Line], request: LensRequest<'_>, run: &Run) -> Result<Found, RunError> {
    let size = clues.size;
    let facts = facts(clues.tags.clone(), size);
    if request.lens == "auto" {
        automatic(clues, &facts, marked, request.fov, run)
    } else {
        given(&facts, size, request)
    }
}

/// The lens of a picture; `None` where none is known and the picture is a stitched one, which no lens took.
pub(crate) fn find_unless_stitched(
    photo: &Photo,
    marked: &[Line],
    request: LensRequest<'_>,
    run: &Run,
) -> Result<Option<Found>, RunError> {
    // A lens that is given, or determined by marked lines, is not looked for in the pixels.
    let given = request.lens != "auto" || request.fov.is_some() || determine(marked);
    let clues = if given { LensClues::of_file(photo) } else { LensClues::of(photo) };
    match find(&clues, marked, request, run) {
        Err(_) if request.lens == "auto" && is_stitched(photo) => Ok(None),
        found => found.map(Some),
    }
}

/// The lens that is said to have taken a clip of so many px; `auto` is a rectilinear one with the field of view that is given, or
/// with the focal length, px, from the metadata of the clip.
pub(crate) fn clip_lens(
    lens: &str,
    fov: Option<f64>,
    axis: FieldAxis,
    (width, height): (usize, usize),
    told_focal_px: impl FnOnce() -> Option<f64>,
) -> Result<Found, RunError> {
    let size = (width as f64, height as f64);
    let request = LensRequest::new(lens, fov, axis);
    if lens == "auto" {
        if let Some(fov) = request.fov {
            return named(Projection::Rectilinear, fov, size);
        }
        let focal = told_focal_px().ok_or_else(|| {
            let help = "give --lens FILE, or --lens MODEL with --fov DEG";
            RunError::Usage(format!("the lens is not known, and the clip states no focal length: {help}"))
        })?;
        let fov = 2.0 * (0.5 * size.0 / focal).atan();
        let fov = FieldOfView::degrees(fov.to_degrees(), FieldAxis::Horizontal);
        let mut found = named(Projection::Rectilinear, fov, size)?;
        found.warnings.push(format!("the lens is taken for a rectilinear one of {focal:.0} px, which the clip states"));
        return Ok(found);
    }
    if Projection::named(lens).is_some() && fov.is_none() {
        return Err(RunError::Usage(format!("the lens `{lens}` needs a field of view: give --fov DEG (`fov`)")));
    }
    given(&ExifFacts { size: Some(size), ..ExifFacts::default() }, size, request)
}

/// The file of a lens, where the setting names one.
pub(crate) fn lens_file(lens: &str) -> Option<&str> {
    (!lens.is_empty() && Projection::named(lens).is_none() && to_path(lens).is_file()).then_some(lens)
}

/// The lens that the user names.
fn given(facts: &ExifFacts, size: (f64, f64), request: LensRequest<'_>) -> Result<Found, RunError> {
    match (request.lens, Projection::named(request.lens), request.fov) {
        (_, Some(projection), Some(fov)) => named(projection, fov, size),
        (_, Some(Projection::Equirectangular), None) => {
            named(Projection::Equirectangular, FieldOfView::degrees(360.0, FieldAxis::Horizontal), size)
        }
        (_, Some(projection), None) => {
            let claimed = facts.lens().map_err(|e| RunError::Usage(e.to_string()))?.lens;
            let fov = claimed.field_of_view(FieldAxis::Horizontal);
            let missing =
                || RunError::Usage(format!("the lens `{}` needs a field of view: give --fov DEG", request.lens));
            named(projection, fov.ok_or_else(missing)?, size)
        }
        (path, None, _) if to_path(path).exists() => from_file(&to_path(path), facts, size),
        (name, None, _) => Err(RunError::Usage(format!(
            "`{name}` is no lens (expected auto, a lens file, or rectilinear, equidistant, equisolid, stereographic, \
             orthographic, equirectangular, cylindrical or mercator with --fov)"
        ))),
    }
}

fn named(projection: Projection, fov: FieldOfView, size: (f64, f64)) -> Result<Found, RunError> {
    let how = format!("given: {}, {:.1}°", projection.name(), fov.radians.to_degrees());
    let lens = Lens::from_field_of_view(projection, fov, size).map_err(|e| RunError::Usage(e.to_string()))?;
    Ok(Found { lens, how, focal_sigma: None, warnings: Vec::new() })
}

fn from_file(path: &Path, facts: &ExifFacts, size: (f64, f64)) -> Result<Found, RunError> {
    let profile = read_lens(path, facts).map_err(|e| RunError::Input(e.to_string()))?;
    let fits = profile.lens.resized(size);
    let lens = fits.map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
    let how = format!("{} file {}", profile.format, path.display());
    Ok(Found { lens, how, focal_sigma: None, warnings: profile.notes })
}

/// From marked lines, with what EXIF or the user claim as a prior; without lines from a profile, from edges that are found in the
/// picture, with the same prior, or from those claims alone.
fn automatic(
    clues: &LensClues,
    facts: &ExifFacts,
    marked: &[Line],
    given: Option<FieldOfView>,
    run: &Run,
) -> Result<Found, RunError> {
    let size = clues.size;
    // What is claimed about the field of view, and how exactly.
    let exif = facts.lens();
    let exif_field = || Some((exif.as_ref().ok()?.lens.field_of_view(FieldAxis::Horizontal)?, CLAIMED));
    let claim = given.map(|fov| (fov, GIVEN)).or_else(exif_field);
    // In this order: marked lines, the field of view given, a lensfun profile, the shape of a panorama, edges, EXIF.
    if determine(marked) {
        return from_lines(marked, size, claim, run);
    }
    if let Some(fov) = given {
        return named(Projection::Rectilinear, fov, size);
    }
    if let Some(found) = from_profile(facts, size) {
        return Ok(found);
    }
    if exif.is_err() && (size.0 - 2.0 * size.1).abs() < 1.0 {
        return panorama(size);
    }
    let claimed = exif.as_ref().ok().map(|found| &found.lens);
    if let Some(found) = of_edges(clues, claim, claimed, run)? {
        return Ok(found);
    }
    let found = exif.map_err(|error| RunError::Usage(format!("the lens is not known: {error}")))?;
    let how = format!("EXIF: {}", found.reason);
    Ok(Found { lens: found.lens, how, focal_sigma: Some(CLAIMED), warnings: Vec::new() })
}

/// Whether lines are enough to find a lens.
fn determine(marked: &[Line]) -> bool {
    marked.iter().filter(|l| l.points.len() > 2).count() >= MIN_LINES
}

fn from_profile(facts: &ExifFacts, size: (f64, f64)) -> Option<Found> {
    facts.model.as_ref()?;
    let profile = lensfun_lens(None, facts).ok()?;
    let lens = profile.lens.resized(size).ok()?;
    let how = format!("{} profile {}", profile.format, profile.name);
    Some(Found { lens, how, focal_sigma: None, warnings: profile.notes })
}

/// A picture twice as wide as high shows the whole sphere.
fn panorama(size: (f64, f64)) -> Result<Found, RunError> {
    let all = FieldOfView::degrees(360.0, FieldAxis::Horizontal);
    let mut found = named(Projection::Equirectangular, all, size)?;
    "guessed from the shape".clone_into(&mut found.how);
    found.warnings.push("taken for an equirectangular panorama, since it is twice as wide as high".to_owned());
    Ok(found)
}

/// Longest side of the picture in which edges are followed to find its lens, px: a fit of more says no more.
const CURVES_SIDE_PX: usize = 1400;
/// The lens of the edges, found once: of what it depends on, all is the picture's.
fn of_edges(
    clues: &LensClues,
    claim: Option<(FieldOfView, f64)>,
    claimed: Option<&Lens>,
    run: &Run,
) -> Result<Option<Found>, RunError> {
    let Some(levels) = &clues.levels else { return Ok(None) };
    if let Some(known) = clues.of_edges.get() {
        return Ok(known.clone());
    }
    let found = from_edges(levels, clues.size, claim, claimed, run)?;
    Ok(clues.of_edges.get_or_init(|| found).clone())
}

/// The lens under which edges of the picture are straight, of `full` px.
fn from_edges(
    levels: &Plane<f32>,
    full: (f64, f64),
    claim: Option<(FieldOfView, f64)>,
    claimed: Option<&Lens>,
    run: &Run,
) -> Result<Option<Found>, RunError> {
    let options = CalibrationOptions { field_of_view: claim, ..CalibrationOptions::default() };
    let Some(EdgeCalibration { calibration, used }) = calibrate_edges(levels.as_ref(), claimed, &options, run)? else {
        return Ok(None);
    };
    let Ok(lens) = calibration.lens.resized(full) else { return Ok(None) };
    let how = format!(
        "{} from {used} of {} edges found in the picture, which fit to {:.2} px of {}",
        calibration.model.name(),
        calibration.lines.len(),
        calibration.noise_px,
        levels.width().max(levels.height()),
    );
    Ok(Some(Found { lens, how, focal_sigma: Some(calibration.focal_sigma), warnings: Vec::new() }))
}

fn from_lines(
    marked: &[Line],
    size: (f64, f64),
    claim: Option<(FieldOfView, f64)>,
    run: &Run,
) -> Result<Found, RunError> {
    let options = CalibrationOptions { field_of_view: claim, ..CalibrationOptions::default() };
    let found = calibrate(marked, size, &options, run)?;
    let bent = found.lines.iter().filter(|l| l.role == LineRole::Bent);
    let warning =
        |name: &str| format!("line `{name}` fits no lens under which the others are straight; it was left out there");
    let warnings = bent.map(|l| warning(&l.name)).collect();
    let how = format!("{} from marked lines, which fit to {:.2} px", found.model.name(), found.noise_px);
    Ok(Found { lens: found.lens, how, focal_sigma: Some(found.focal_sigma), warnings })
}

/// What EXIF says, for a picture of `size` px. Digital zoom cuts the field; pixels count as they were when the picture was
/// taken, scaled to what it is now.
fn facts(tags: ExifTags, size: (f64, f64)) -> ExifFacts {
    let zoom = tags.digital_zoom.filter(|z| *z >= 1.0).unwrap_or(1.0);
    let lens = match (&tags.lens_make, tags.lens_model) {
        (Some(make), Some(model)) if !model.starts_with(make.as_str()) => Some(format!("{make} {model}")),
        (_, model) => model,
    };
    let taken = tags.size_px.map(|(w, h)| f64::from(w).hypot(f64::from(h)));
    let pixel_um = tags.sensor_px_per_mm.zip(taken).map(|((x, y), taken)| {
        let scale = 1000.0 * taken / size.0.hypot(size.1) / zoom;
        (scale / x, scale / y)
    });
    ExifFacts {
        size: Some(size),
        make: tags.make,
        model: tags.model,
        lens,
        focal_mm: tags.focal_mm,
        focal_35_mm: tags.focal_35mm,
        pixel_um,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn degrees(tags: ExifTags, size: (f64, f64)) -> Option<f64> {
        let lens = facts(tags, size).lens().ok()?.lens;
        lens.field_of_view(FieldAxis::Diagonal).map(|f| f.radians.to_degrees())
    }

    #[test]
    fn focal_lengths_mean_the_same_field_at_any_size_of_the_picture() {
        let tags = ExifTags { focal_35mm: Some(24.0), ..ExifTags::default() };
        let field = degrees(tags, (4000.0, 3000.0)).expect("a focal length");
        assert!((field - 84.06).abs() < 0.1, "{field}");
        // A sensor of 24×16 mm at 16 mm, the picture scaled to a half since: the same field.
        let sensor = ExifTags {
            focal_mm: Some(16.0),
            sensor_px_per_mm: Some((250.0, 250.0)),
            size_px: Some((6000, 4000)),
            ..ExifTags::default()
        };
        for size in [(6000.0, 4000.0), (3000.0, 2000.0)] {
            let field = degrees(sensor.clone(), size).expect("a focal length");
            assert!((field - 84.06).abs() < 0.2, "{field}");
        }
        assert_eq!(degrees(ExifTags { focal_mm: Some(16.0), ..ExifTags::default() }, (400.0, 300.0)), None);
    }
}
