//! Bundle adjustment: maximum-a-posteriori estimation of poses, points, lens and readout from image observations.
//!
//! ```text
//! E = ½ Σ ρ(‖project_i(X_j) − observed_ij‖²/σ²) + ½ Σ ((x − x̄)/σ_x)²     x: ln f, k₁, ρ_s, as far as they have priors
//!       + ½ Σ_j (κ_j min(w_j, 0))²
//! ```
//!
//! over poses, rays and inverse depths of points in their anchors, and the unknowns shared by all frames (`ln f`,
//! `k₁`, `ρ_s`). The solver is Levenberg–Marquardt. In each iteration the points are eliminated one by one (Schur
//! complement); the reduced camera system is banded by the lengths of tracks, with the three shared unknowns as its
//! border. Robust losses enter by iterative reweighting. The last term penalizes negative inverse depth (points beyond
//! infinity) softly, so that a point at infinity can return to a positive depth.
//!
//! Gauge: observations do not determine position, orientation and scale of the whole scene. The first pose is fixed,
//! and one coordinate of the translation of the camera farthest from it.
//!
//! # Reference
//! B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, *Bundle adjustment — a modern synthesis*, 1999; J. Civera, A. Davison,
//! J. Montiel, *Inverse depth parametrization for monocular SLAM*, IEEE T-RO 24 (2008).

mod cameras;
mod error;
mod layout;
mod normal;
mod options;
mod parameters;
mod problem;
mod rescue;
mod residual;
mod residuals;
mod robust_loss;
mod schur;
mod shutter;
mod structure;

pub use error::BundleError;
pub use options::{BundleOptions, Freedom, RobustFit};
pub use residuals::{ObservationResidual, residuals};
pub use structure::refine_points;

use super::{Observation, Scene};
use cameras::Cameras;
use layout::Layout;
use parameters::SHARED;
use plumbline_num::optim::levenberg_marquardt::minimize;
use plumbline_num::run::Run;
use problem::Adjustment;

/// Report of an adjustment.
#[derive(Clone, Debug, PartialEq)]
pub struct BundleReport {
    /// Iterations under all losses together.
    pub iterations: usize,
    /// `E` at the initial guess, under the first loss.
    pub initial_cost: f64,
    /// `E` at the result, under the last loss.
    pub cost: f64,
    /// Whether the last loss was minimized to the tolerance.
    pub converged: bool,
    /// Number of observations used.
    pub observations: usize,
    /// Number of points used.
    pub points: usize,
    /// Root mean square of the residual lengths, px; outliers are included, points behind their camera are not.
    pub rms_px: f64,
    /// Median of the residual lengths, px.
    pub median_px: f64,
    /// Standard deviation of `ln f`, scaled by the noise that the residuals show; `None` if it was not requested, if
    /// the focal length is fixed, or if nothing determines it.
    pub sigma_ln_focal: Option<f64>,
}

/// Adjusts a scene to observations. Observations of unknown frames or points are ignored, and so are points observed
/// in one frame only.
///
/// # Errors
/// [`BundleError`]: options out of range, non-finite values, nothing to adjust, an interruption. The scene is then
/// unchanged.
pub fn adjust(
    scene: &mut Scene,
    observations: &[Observation],
    options: &BundleOptions,
    run: &Run,
) -> Result<BundleReport, BundleError> {
    options.check()?;
    // 1. Structure: observations in use, free unknowns, gauge.
    let shared_free: [bool; SHARED] = [options.focal, options.k1, options.readout].map(|f| f != Freedom::Fixed);
    let rolling = scene.readout != 0.0 || options.readout != Freedom::Fixed;
    let mut layout = Layout::new(scene, observations, &options.fixed_frames, shared_free, rolling)?;
    if options.rotation_only {
        layout.fix_translations();
    }
    let cameras = Cameras::new(&layout, scene.intrinsics.center);
    let mut problem = Adjustment::new(&layout, layout.parameters(scene), cameras, options);
    let mut report = None;
    let damping = options.fit.damping_for(layout.observations.len());
    // 2. Minimize each loss from the result of the previous one; then search again for points in a wrong minimum.
    for loss in &options.fit.losses {
        problem.robust_loss.loss = *loss;
        let cost = problem.cost();
        let minimum = minimize(&mut problem, cost, &damping, run)?;
        let (before, initial_cost) = report.map_or((0, minimum.initial_cost), |r: (usize, f64, _)| (r.0, r.1));
        report = Some((before + minimum.iterations, initial_cost, minimum));
        problem.rescue(run)?;
    }
    // 3. Write the scene only after all losses succeeded: on any error above it is unchanged.
    let (iterations, initial_cost, last) = report.expect("there is a loss: it was checked");
    layout.store(&problem.present, scene);
    // 4. Statistics, and the standard deviation of the focal length scaled by the measured noise.
    let residuals = Residuals::of(&mut problem, options);
    let sigma_ln_focal = (options.uncertainty && shared_free[0]).then(|| problem.variance_of_ln_focal()).flatten();
    Ok(BundleReport {
        iterations,
        initial_cost,
        cost: last.cost,
        converged: last.converged,
        observations: layout.observations.len(),
        points: layout.tracks.len(),
        rms_px: residuals.rms_px,
        median_px: residuals.median_px,
        sigma_ln_focal: sigma_ln_focal.map(|variance| variance.sqrt() * residuals.noise),
    })
}

/// Statistics of the final residuals.
struct Residuals {
    rms_px: f64,
    median_px: f64,
    /// Robust noise estimate in units of the assumed standard deviation.
    noise: f64,
}

impl Residuals {
    fn of(problem: &mut Adjustment<'_>, options: &BundleOptions) -> Self {
        problem.cost();
        let mut squares: Vec<f64> = problem.squares().flatten().collect();
        squares.sort_by(f64::total_cmp);
        let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        // The median squared length of a 2D Gaussian of unit variance is 2 ln 2.
        let noise = (median / (2.0 * std::f64::consts::LN_2)).sqrt();
        Self { rms_px: options.fit.sigma_px * mean.sqrt(), median_px: options.fit.sigma_px * median.sqrt(), noise }
    }
}

#[cfg(test)]
mod tests;
