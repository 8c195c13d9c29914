//! Points that ended in a place of their own.
//!
//! Near a camera the reprojection error of a point has minima far from the truth, which a robust loss deepens: a few
//! observations fit, the others count as outliers. From a rough start some points fall into one. They are searched anew from
//! the ray of their anchor's observation, at several depths.
//!
//! A made-up walk (23 % wrong observations, tracks of 27 frames) has cameras in 22 of 73 frames; without this search it has none
//! (`docs/ABLATIONS.md`).

use super::parameters::Ray;
use super::robust_loss::RobustLoss;
use super::structure::PointProblem;
use plumbline_num::math::Vec2;
use plumbline_num::optim::levenberg_marquardt::DampingOptions;

/// Mean residual, in standard deviations, above which a point is searched anew: outliers lift the mean of a good track to less.
const SUSPICIOUS: f64 = 3.0;
/// Inverse depths tried, relative to the typical one; evenly by depth where points are near, and infinity.
const DEPTHS: [f64; 5] = [0.0, 0.3, 1.0, 2.0, 4.0];
/// Steps from each start.
const SEARCH: DampingOptions = DampingOptions { lambda: 1e-3, tolerance: 1e-3, floor: 0.0, max_iterations: 20 };

/// Whether a track that costs `cost` over so many observations is to be searched anew.
pub(super) fn is_suspicious(cost: f64, observations: usize, robust_loss: &RobustLoss) -> bool {
    !(cost <= observations as f64 * robust_loss.cost(Some(SUSPICIOUS * SUSPICIOUS)))
}

/// The best place found from the anchor's own ray; `None` where none costs less than `cost`.
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
