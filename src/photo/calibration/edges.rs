//! Calibration from the edges of a picture in which nothing is marked.
//!
//! Edges that are straight in the world agree on a lens; edges of other things scatter, each in its own way. So the edges are
//! followed ([`curves`]) and the lens fitted to them ([`calibrate`]), which leaves out outliers. The lens is taken where enough edges
//! agree on it, to within a pixel, and where they say more than a lens that is claimed does.

use plumbline_camera::Lens;
use plumbline_image::PlaneRef;
use plumbline_num::math::Point2;
use plumbline_num::run::Run;

use super::super::line_detection::curves;
use super::super::{Line, PhotoError, Sight, best_circle};
use super::{Calibration, CalibrationOptions, LineRole, calibrate};

/// Least number of edges that must agree on a lens, and the least part of all of them.
const MIN_CURVES: usize = 8;
const MIN_AGREEING: f64 = 0.6;
/// Largest scatter of edges around their lines, as a fraction of the diagonal: one px of a megapixel. Edges of things that are not
/// straight scatter more.
const MAX_CURVE_NOISE: f64 = 6e-4;
/// Largest scatter under a lens from edges, as a fraction of that under the claimed lens, for which the former is taken.
const MIN_GAIN: f64 = 0.7;
/// Largest relative standard deviation of a focal length from edges alone: 25 % moves the border of a fisheye by as much.
const MAX_FOCAL_SIGMA: f64 = 0.25;

/// A lens found from edges.
#[derive(Clone, Debug, PartialEq)]
pub struct EdgeCalibration {
    /// The lens, in px of the gray levels, and how it fits the edges, longest first.
    pub calibration: Calibration,
    /// How many edges agree on it.
    pub used: usize,
}

/// The lens under which edges of a picture are straight; `levels` are its gray levels, 0 to 255. `None` where too few edges agree, where
/// they do not determine a lens, or where `claimed`, such as that of the metadata, fits them about as well.
///
/// # Errors
/// [`PhotoError::Interrupted`].
///
/// # Example
/// ```
/// use plumbline_image::Plane;
/// use plumbline_num::run::Run;
/// use plumbline_photo::calibration::{CalibrationOptions, calibrate_edges};
///
/// let wall = Plane::from_fn(300, 200, |_, y| if y < 90 { 60.0 } else { 180.0 });
/// // One edge determines no lens.
/// assert_eq!(calibrate_edges(wall.as_ref(), None, &CalibrationOptions::default(), &Run::default())?, None);
/// # Ok::<(), plumbline_photo::PhotoError>(())
/// ```
pub fn calibrate_edges(
    levels: PlaneRef<'_, f32>,
    claimed: Option<&Lens>,
    options: &CalibrationOptions,
    run: &Run,
) -> Result<Option<EdgeCalibration>, PhotoError> {
    let size = (levels.width() as f64, levels.height() as f64);
    let edges = curves(levels, run)?;
    if edges.len() < MIN_CURVES {
        return Ok(None);
    }
    let calibration = match calibrate(&edges, size, options, run) {
        Ok(found) => found,
        Err(PhotoError::Interrupted(stopped)) => return Err(PhotoError::Interrupted(stopped)),
        Err(_) => return Ok(None),
    };
    let fits = edges.iter().zip(&calibration.lines);
    let used: Vec<&Line> = fits.filter(|(_, fit)| fit.role == LineRole::Used).map(|(line, _)| line).collect();
    let agreeing = used.len() as f64 / edges.len() as f64;
    let noise = calibration.noise_px / size.0.hypot(size.1);
    if used.len() < MIN_CURVES || agreeing < MIN_AGREEING || noise > MAX_CURVE_NOISE {
        return Ok(None);
    }
    let rms = |lens: &Lens| {
        let lens = lens.resized(size).ok()?;
        let squares = used.iter().filter_map(|line| mean_square(&line.points, &lens)).sum::<f64>();
        Some((squares / used.len() as f64).sqrt())
    };
    let gain = claimed.and_then(|lens| Some(rms(&calibration.lens)? / rms(lens)?));
    let undetermined = claimed.is_none() && calibration.focal_sigma > MAX_FOCAL_SIGMA;
    let used = used.len();
    let taken = !undetermined && gain.is_none_or(|gain| gain <= MIN_GAIN);
    Ok(taken.then_some(EdgeCalibration { calibration, used }))
}

/// Mean square distance of points from their best great circle, px².
fn mean_square(points: &[Point2], lens: &Lens) -> Option<f64> {
    let sights: Option<Vec<Sight>> = points.iter().map(|p| Sight::new(lens, *p)).collect();
    let sights = sights?;
    let n = best_circle(&sights)?;
    Some(sights.iter().map(|s| s.distance(&n).powi(2)).sum::<f64>() / sights.len() as f64)
}
