//! Points that converged to a wrong local minimum.
//!
//! The reprojection error of a point near a camera has local minima far from the true position. A robust loss deepens
//! them: a few observations fit, the others count as outliers. From a poor initial guess some points converge to one.
//! They are searched again from the ray of their anchor's observation, at several depths.
//!
//! A synthetic walk (23 % wrong observations, tracks of 27 frames) has cameras in 22 of 73 frames; without this search
//! it has none (`docs/ABLATIONS.md`).

use super::parameters::Ray;
use super::robust_loss::RobustLoss;
use super::structure::PointProblem;
use plumbline_num::math::Vec2;
use plumbline_num::optim::levenberg_marquardt::DampingOptions;

/// Mean residual, in standard deviations, above which a point is searched again. Outliers raise the mean of a good
/// track to less.
const SUSPICIOUS: f64 = 3.0;
/// Initial inverse depths, relative to the typical one: evenly spaced depths for near points, and infinity.
const DEPTHS: [f64; 5] = [0.0, 0.3, 1.0, 2.0, 4.0];
/// Damping and iteration limit of the search from each initial depth.
const SEARCH: DampingOptions = DampingOptions { lambda: 1e-3, tolerance: 1e-3, floor: 0.0, max_iterations: 20 };

/// Whether a track of this cost and number of observations is searched again.
pub(super) fn is_suspicious(cost: f64, observations: usize, robust_loss: &RobustLoss) -> bool {
    !(cost <= observations as f64 * robust_loss.cost(Some(SUSPICIOUS * SUSPICIOUS)))
}

/// The best point found from the anchor's own ray; `None` if none has a cost below `cost`.
pub(super) fn search<'a>(
    problem: impl Fn(Ray) -> PointProblem<'a>,
    own_ray: Vec2,
    typical: f64,
    cost: f64,
) -> Option<(Ray, f64)> {
    let starts = DEPTHS.map(|ratio| Ray { xy: own_ray, w: ratio * typical });
    let found = starts.into_iter().map(|start| problem(start).search(&SEARCH));
    found.fold(
        None,
        |best: Option<(Ray, f64)>, (ray, c)| {
            if c < best.map_or(cost, |b| b.1) { Some((ray, c)) } else { best }
        },
    )
}
