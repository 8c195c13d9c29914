//! Which lens took a picture: what the user says, what the file says, what the lines say.

use crate::camera::{FieldAxis, FieldOfView, Lens, Projection};
use crate::image::still::{ExifTags, Photo};
use crate::photo::Line;
use crate::photo::calibration::{CalibrationOptions, LineRole, calibrate};
use crate::pipeline::kinds::{FovAxis, PhotoRectifySettings};
use crate::pipeline::run_error::RunError;

/// Diagonal of a full frame, mm: what focal lengths "in 35 mm film" refer to.
const FULL_FRAME_MM: f64 = 43.266_615;
/// By which share a field of view from EXIF may be off, and one that the user gives.
const CLAIMED: f64 = 0.1;
const GIVEN: f64 = 0.01;
/// Least lines of three points or more from which a lens is found.
const LEAST_LINES: usize = 3;

/// A lens, and how it was found.
pub(super) struct Found {
    pub(super) lens: Lens,
    /// In words, for the report.
    pub(super) how: String,
    pub(super) warnings: Vec<String>,
}

/// The lens of a picture.
pub(super) fn find(photo: &Photo, lines: &[Line], settings: &PhotoRectifySettings) -> Result<Found, RunError> {
    let size = (photo.frame.width as f64, photo.frame.height as f64);
    let given = settings.fov.map(|degrees| FieldOfView::degrees(degrees, axis(settings.fov_axis)));
    match (settings.lens.as_str(), given) {
        ("auto", given) => automatic(photo, lines, size, given),
        (name, given) => match (projection(name), given) {
            (Some(projection), Some(fov)) => named(projection, fov, size),
            (Some(projection), None) => {
                let fov = claimed_field(&photo.tags()).ok_or_else(|| no_field(name))?;
                named(projection, fov, size)
            }
            (None, _) => Err(RunError::Usage(format!(
                "`{name}` is no lens (expected auto, or rectilinear, equidistant, equisolid, stereographic, orthographic, \
                 equirectangular, cylindrical or mercator with --fov)"
            ))),
        },
    }
}

fn no_field(name: &str) -> RunError {
    RunError::Usage(format!("the lens `{name}` needs a field of view: give --fov DEG (`fov`), EXIF has no focal length"))
}

fn named(projection: Projection, fov: FieldOfView, size: (f64, f64)) -> Result<Found, RunError> {
    let how = format!("{}, {:.1}°", projection.name(), fov.radians.to_degrees());
    let lens = Lens::from_field_of_view(projection, fov, size).map_err(|e| RunError::Usage(e.to_string()))?;
    Ok(Found { lens, how, warnings: Vec::new() })
}

/// From marked lines, with what EXIF or the user claim as a prior; without lines from those claims alone.
fn automatic(
    photo: &Photo,
    lines: &[Line],
    size: (f64, f64),
    given: Option<FieldOfView>,
) -> Result<Found, RunError> {
    let claim = given.map(|fov| (fov, GIVEN)).or_else(|| claimed_field(&photo.tags()).map(|fov| (fov, CLAIMED)));
    if lines.iter().filter(|l| l.points.len() > 2).count() >= LEAST_LINES {
        let options = CalibrationOptions { field_of_view: claim, ..CalibrationOptions::default() };
        let found = calibrate(lines, size, &options).map_err(|e| RunError::Input(e.to_string()))?;
        let off = found.lines.iter().filter(|l| l.role == LineRole::Bent);
        let warning = |name: &str| format!("line `{name}` fits no lens that makes the others straight; it was not used to find it");
        let warnings = off.map(|l| warning(&l.name)).collect();
        let how = format!("{} from marked lines, which fit to {:.2} px", found.model.name(), found.noise_px);
        return Ok(Found { lens: found.lens, how, warnings });
    }
    if let Some((fov, _)) = claim {
        return named(Projection::Rectilinear, fov, size);
    }
    if (size.0 - 2.0 * size.1).abs() < 1.0 {
        let all = FieldOfView::degrees(360.0, FieldAxis::Horizontal);
        let mut found = named(Projection::Equirectangular, all, size)?;
        found.warnings.push("taken for an equirectangular panorama, since it is twice as wide as high".to_owned());
        return Ok(found);
    }
    let help = "give --lens MODEL with --fov DEG, a lens file, or mark three curved lines or more in NAME.lines.json";
    Err(RunError::Usage(format!("the lens is not known: EXIF has no focal length, and no lines were marked; {help}")))
}

fn axis(axis: FovAxis) -> FieldAxis {
    match axis {
        FovAxis::H => FieldAxis::Horizontal,
        FovAxis::V => FieldAxis::Vertical,
        FovAxis::D => FieldAxis::Diagonal,
    }
}

fn projection(name: &str) -> Option<Projection> {
    Some(match name {
        "rectilinear" => Projection::Rectilinear,
        "equidistant" => Projection::Equidistant,
        "equisolid" => Projection::Equisolid,
        "stereographic" => Projection::Stereographic,
        "orthographic" => Projection::Orthographic,
        "equirectangular" => Projection::Equirectangular,
        "cylindrical" => Projection::Cylindrical,
        "mercator" => Projection::Mercator,
        _ => return None,
    })
}

/// The field of view that EXIF claims, along the diagonal of a rectilinear picture.
fn claimed_field(tags: &ExifTags) -> Option<FieldOfView> {
    let from_sensor = || {
        let ((px, py), (w, h)) = (tags.sensor_px_per_mm?, tags.size_px?);
        let diagonal_mm = (f64::from(w) / px).hypot(f64::from(h) / py);
        Some(tags.focal_mm? * FULL_FRAME_MM / diagonal_mm)
    };
    let focal = tags.focal_35mm.or_else(from_sensor).filter(|f| (1.0..2000.0).contains(f))?;
    let focal = focal * tags.digital_zoom.filter(|z| tags.focal_35mm.is_none() && *z >= 1.0).unwrap_or(1.0);
    let degrees = 2.0 * (0.5 * FULL_FRAME_MM / focal).atan().to_degrees();
    Some(FieldOfView::degrees(degrees, FieldAxis::Diagonal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn focal_lengths_mean_the_field_of_a_full_frame() {
        let degrees = |tags: &ExifTags| claimed_field(tags).map(|f| f.radians.to_degrees());
        let tags = ExifTags { focal_35mm: Some(24.0), ..ExifTags::default() };
        assert!((degrees(&tags).expect("a focal length") - 84.06).abs() < 0.1, "{:?}", degrees(&tags));
        // A sensor of 24×16 mm at 16 mm: the same field as 24 mm, nearly.
        let sensor = ExifTags {
            focal_mm: Some(16.0),
            sensor_px_per_mm: Some((250.0, 250.0)),
            size_px: Some((6000, 4000)),
            ..ExifTags::default()
        };
        assert!((degrees(&sensor).expect("a focal length") - 84.06).abs() < 0.1);
        assert_eq!(degrees(&ExifTags { focal_mm: Some(16.0), ..ExifTags::default() }), None);
    }
}
