//! The view graph: pairs of keyframes that share points, with their two-view geometry.

use rayon::prelude::*;

use super::correspondence::Correspondence;
use super::focal::{FocalEstimate, FocalOptions, estimate_focal};
use super::mapper::MIN_POINTS;
use super::two_view::{TwoView, TwoViewOptions, TwoViewVerdict, two_view};
use super::{Match, TrackTable};
use plumbline_camera::Intrinsics;
use plumbline_num::math::Vec2;
use plumbline_num::run::{Run, Stopped};

/// Steps between the keyframes of a pair: close ones share most points, distant ones have most parallax.
const STRIDES: [usize; 5] = [1, 2, 3, 5, 8];
/// Maximum number of pairs for the estimate of the focal length.
const FOCAL_PAIRS: usize = 16;

/// A pair of keyframes.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    /// Frame of the first view.
    pub(super) first: usize,
    /// Frame of the second view.
    pub(super) second: usize,
    /// Points common to both.
    pub(super) matches: Vec<Match>,
    /// Their two-view geometry.
    pub(super) view: TwoView,
}

impl Edge {
    /// Number of matches that the pair's model explains.
    pub(super) fn inliers(&self) -> usize {
        self.view.inliers.iter().filter(|i| **i).count()
    }

    /// Suitability as the initial pair of a map: number of points times angle, the angle clamped to 6 degrees.
    pub(super) fn strength(&self) -> f64 {
        self.inliers() as f64 * self.view.median_angle.min(6.0_f64.to_radians())
    }
}

/// Classifies the pairs of keyframes at an assumed lens whose focal length may be wrong by the factor
/// `max_focal_ratio`.
pub(super) fn view_graph(
    table: &TrackTable,
    keys: &[usize],
    camera: &Intrinsics,
    max_focal_ratio: f64,
    run: &Run,
) -> Result<Vec<Edge>, Stopped> {
    let pairs = STRIDES.iter().flat_map(|&s| (s..keys.len()).map(move |k| (keys[k - s], keys[k])));
    let pairs: Vec<(usize, usize)> = pairs.collect();
    // Tolerances in px apply at 640 px across.
    let unit = f64::from(table.width.max(table.height)) / 640.0;
    let options = TwoViewOptions { max_focal_ratio, ..TwoViewOptions::for_focal(camera.focal / unit) };
    let judged = pairs.par_iter().map(|&(first, second)| {
        let mut matches = table.shared(first, second);
        if matches.len() < MIN_POINTS {
            return Ok(None);
        }
        let mut rays = Vec::with_capacity(matches.len());
        matches.retain(|m| {
            let pair = camera.undistorted(m.first).zip(camera.undistorted(m.second));
            rays.extend(pair.map(|(a, b)| Correspondence::new(a, b)));
            pair.is_some()
        });
        Ok(Some(Edge { first, second, view: two_view(&rays, &options, run)?, matches }))
    });
    let judged: Vec<Option<Edge>> = judged.collect::<Result<_, Stopped>>()?;
    Ok(judged.into_iter().flatten().collect())
}

/// The focal length estimated from the pairs with depth.
pub(super) fn shared_focal(table: &TrackTable, edges: &[Edge], run: &Run) -> Result<Option<FocalEstimate>, Stopped> {
    let mut general: Vec<&Edge> = edges.iter().filter(|e| e.view.verdict == TwoViewVerdict::General).collect();
    general.sort_by(|a, b| b.strength().total_cmp(&a.strength()));
    general.truncate(FOCAL_PAIRS);
    let center = Vec2::new(f64::from(table.width), f64::from(table.height)) / 2.0;
    let pairs: Vec<Vec<Correspondence>> = general
        .iter()
        .map(|e| {
            e.matches.iter().map(|m| Correspondence::new(m.first.coords - center, m.second.coords - center)).collect()
        })
        .collect();
    estimate_focal(&pairs, &FocalOptions::for_width(f64::from(table.width.max(table.height))), run)
}
