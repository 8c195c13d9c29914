//! Plumb-line calibration: lens parameters from lines that are straight in the world.
//!
//! Unknown are focal length `f`, center `c` and up to two radial terms `k`; each marked line has an unknown great circle.
//! With `d` the distance in pixels of a sample from its line's best circle under the lens
//! ([`Sight::distance`](super::Sight::distance)),
//!
//! ```text
//! E(f, c, k) = Σ_lines w_l Σ_samples (d/σ)² + ‖c − middle‖²/σ_c² + Σᵢ (kᵢ/σ_k)² + (ln f − ln f₀)²/σ_f².
//! ```
//!
//! The circles are eliminated: they are refitted for every trial lens. The weights `w_l` are robust (Geman–McClure on a
//! line's rms); outlier lines are excluded and reported. `σ` is estimated.
//!
//! **Observability.** Straightness is invariant under projective maps: lines determine the radial function `r ↦ tan θ`
//! up to a factor. Its curvature determines the focal length only within a family: `tan(r/f)` of the equidistant one
//! bends by its third order term `r³/(3f²)`, which the first radial term can replace,
//!
//! ```text
//! tan θ = r/f + (1/3 − k₁) (r/f)³ + …
//! ```
//!
//! so with free terms the focal length depends on higher orders and on the prior that `k` is small. Straight lines in
//! an undistorted picture carry no information: the prior, the field of view from the photo's metadata, decides. Slight
//! curvature may be the barrel distortion of an ordinary lens or a narrow crop of a fisheye; without metadata the prior
//! is that of common lenses (rectilinear around 70°, fisheyes around 170°). [`Calibration::focal_sigma`] is the
//! standard deviation of the focal length; straightness of the result does not depend on it.
//!
//! **Which model.** All models are fitted; the one of least
//!
//! ```text
//! n ln max(σ̂², σ₀²) + p ln n + priors
//! ```
//!
//! is taken (Schwarz), `p` being its number of parameters, `n` the number of samples less two per line, and `σ₀` the
//! accuracy of marks below which a better fit is not significant.
//!
//! # References
//! D. C. Brown, *Close-Range Camera Calibration*, Photogrammetric Engineering 37(8), 1971 (the plumb-line method).
//! F. Devernay, O. Faugeras, *Straight Lines Have to Be Straight*, Machine Vision and Applications 13, 2001.
//! J. Kannala, S. S. Brandt, *A Generic Camera Model …*, PAMI 28(8), 2006.
//! G. Schwarz, *Estimating the Dimension of a Model*, Annals of Statistics 6, 1978.

mod edges;
mod fit;
mod model;
#[cfg(test)]
mod tests;

pub use edges::{EdgeCalibration, calibrate_edges};
pub use model::LensModel;

use rayon::prelude::*;

use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection};
use plumbline_num::math::{Point2, Vec2};
use plumbline_num::run::Run;

use super::{Line, PhotoError};
use fit::{Fit, Samples};

/// What to do where lines give no lens.
const REMEDY: &str = "check that they are straight in the world, or give the lens";
/// Minimum number of samples of a line with a measurable curvature.
const MIN_SAMPLES: usize = 3;

/// Settings of [`calibrate`].
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationOptions {
    /// The candidate models; the first of equally good ones is chosen.
    pub models: Vec<LensModel>,
    /// Field of view from the photo's metadata, and the relative standard deviation of its focal length. `None`: the
    /// prior of each model, [`LensModel::usual_field`].
    pub field_of_view: Option<(FieldOfView, f64)>,
    /// Standard deviation of the principal point about the middle of the picture, as a fraction of the diagonal,
    /// default 0.01: sensors are aligned within a percent.
    pub center_sigma: f64,
    /// `σ₀`: accuracy of marks, px, default 0.1, below which a better fit is not significant. Corner detectors reach
    /// 0.1, marks by hand 0.5.
    pub mark_sigma: f64,
}

impl Default for CalibrationOptions {
    fn default() -> Self {
        Self { models: LensModel::all(), field_of_view: None, center_sigma: 0.01, mark_sigma: 0.1 }
    }
}

/// A lens found from lines.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The lens.
    pub lens: Lens,
    /// Its model.
    pub model: LensModel,
    /// Standard deviation of the samples around their circles, px.
    pub noise_px: f64,
    /// Relative standard deviation of the focal length: within this model, and between models that fit about as well.
    pub focal_sigma: f64,
    /// The field of view along the width and its standard deviation, likewise, rad; `None` where the picture's sides see nothing.
    pub field_of_view: Option<(f64, f64)>,
    /// Standard deviation of the center, px.
    pub center_sigma: Vec2,
    /// How each line fits, in the order given.
    pub lines: Vec<LineFit>,
    /// The fits of all models, in the order of the options; those that failed are missing.
    pub candidates: Vec<Candidate>,
}

/// How a line fits the lens.
#[derive(Clone, Debug, PartialEq)]
pub struct LineFit {
    /// Its name.
    pub name: String,
    /// Root mean square and largest distance of its samples from their great circle, px of the source.
    pub distance_px: Option<(f64, f64)>,
    /// Its role in the fit.
    pub role: LineRole,
}

/// Role of a line in a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineRole {
    /// An inlier.
    Used,
    /// An outlier: not straight in the world, or marked wrongly.
    Bent,
    /// Fewer than three points: no measurable curvature.
    TooShort,
}

/// The fit of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// The model.
    pub model: LensModel,
    /// Standard deviation of the samples around their circles, px.
    pub noise_px: f64,
    /// The criterion: smaller is better; differences below 2 are not significant, above 10 decisive.
    pub score: f64,
    /// Focal length, px.
    pub focal: f64,
    /// Field of view along the width, rad; `None` where the picture's sides see nothing.
    pub field_of_view: Option<f64>,
}

/// Finds the lens under which marked lines are straight, for a picture of `size` px.
///
/// Lines of two points are passed over; orientations are not looked at.
///
/// # Errors
/// [`PhotoError`]: a size that is none, marks that are no numbers, too few lines or samples, or lines that no lens
/// makes straight, an interruption.
pub fn calibrate(
    lines: &[Line],
    size: (f64, f64),
    options: &CalibrationOptions,
    run: &Run,
) -> Result<Calibration, PhotoError> {
    let samples = Samples::new(lines, size)?;
    let fits: Vec<Option<Fit>> = options.models.par_iter().map(|m| Fit::new(&samples, *m, options, run)).collect();
    run.check()?;
    let mut candidates = Vec::new();
    let mut best: Option<(f64, Fit)> = None;
    for fit in fits.into_iter().flatten() {
        let score = fit.score(options);
        candidates.push(candidate(&fit, score));
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, fit));
        }
    }
    let (_, fit) =
        best.ok_or_else(|| PhotoError::Input(format!("no lens model makes the marked lines straight: {REMEDY}")))?;
    let used = fit.used();
    if 2 * used < samples.lines() {
        let lines = samples.lines();
        return Err(PhotoError::Input(format!("only {used} of {lines} marked lines agree on a lens: {REMEDY}")));
    }
    Ok(report(lines, &samples, &fit, candidates))
}

fn candidate(fit: &Fit, score: f64) -> Candidate {
    let lens = fit.lens();
    let field_of_view = width_field(&lens);
    Candidate { model: fit.model(), noise_px: fit.noise_px(), score, focal: lens.focal.x, field_of_view }
}

/// Field of view along the width, rad.
fn width_field(lens: &Lens) -> Option<f64> {
    lens.field_of_view(FieldAxis::Horizontal).map(|fov| fov.radians)
}

/// Root mean square difference of a quantity of the candidates from the best one's, each weighted by its probability `∝
/// exp(−score/2)`.
fn disagreement(candidates: &[Candidate], figure: impl Fn(&Candidate) -> Option<f64>, best: f64) -> f64 {
    let least = candidates.iter().fold(f64::INFINITY, |m, c| m.min(c.score));
    let weighed = candidates.iter().filter_map(|c| Some(((-0.5 * (c.score - least)).exp(), figure(c)?)));
    let (total, squares) = weighed.fold((0.0, 0.0), |(t, s), (w, v)| (t + w, s + w * (v - best) * (v - best)));
    if total > 0.0 { (squares / total).sqrt() } else { 0.0 }
}

fn report(lines: &[Line], samples: &Samples, fit: &Fit, candidates: Vec<Candidate>) -> Calibration {
    let lens = fit.lens();
    let mut fits = fit.line_fits(samples).into_iter();
    let reports = lines.iter().map(|line| {
        let (distance_px, role) = if line.points.len() < MIN_SAMPLES {
            (None, LineRole::TooShort)
        } else {
            let (rms, max, used) = fits.next().expect("one fit per line of three points or more");
            (Some((rms, max)), if used { LineRole::Used } else { LineRole::Bent })
        };
        LineFit { name: line.name.clone(), distance_px, role }
    });
    let lines = reports.collect();
    let sigma = fit.sigma();
    let center_sigma = Vec2::new(sigma[1], sigma[2]);
    let among_focals = disagreement(&candidates, |c| Some(c.focal.ln()), lens.focal.x.ln());
    let field_of_view = width_field(&lens)
        .map(|field| (field, fit.spread_of(width_field).hypot(disagreement(&candidates, |c| c.field_of_view, field))));
    let focal_sigma = sigma[0].hypot(among_focals);
    Calibration {
        model: fit.model(),
        noise_px: fit.noise_px(),
        focal_sigma,
        field_of_view,
        center_sigma,
        lines,
        candidates,
        lens,
    }
}

/// Logarithm of the focal length for a field of view under a projection; a field too wide for the projection is
/// narrowed until it fits.
fn log_focal(projection: &Projection, fov: FieldOfView, size: (f64, f64)) -> f64 {
    let narrower = std::iter::successors(Some(fov.radians), |radians| Some(0.9 * radians));
    let focal = narrower.take(40).find_map(|radians| {
        Lens::from_field_of_view(projection.clone(), FieldOfView { radians, ..fov }, size).ok().map(|l| l.focal.x)
    });
    focal.unwrap_or(0.5 * size.0.hypot(size.1)).ln()
}

/// The middle of a picture.
fn middle(size: (f64, f64)) -> Point2 {
    Point2::new(0.5 * size.0, 0.5 * size.1)
}
