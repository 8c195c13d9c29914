//! Selection of the next neighbor: the largest gain in coverage, discounted by the distance in time.
//!
//! Coverage is tested at a few probes per block, once per neighbor.

use super::strip::Strip;
use super::window::Held;
use crate::warp::WarpField;
use plumbline_num::math::PointMap;

/// Distance, frames, at which a neighbor's gain counts half: motion accumulates errors and the scene changes. Smaller
/// makes many thin layers, larger skips good near ones.
const HALF_WEIGHT_FRAMES: f64 = 12.0;
/// Minimum number of probes that a neighbor adds: fewer do not justify its rendering.
const MIN_GAIN: usize = 2;
/// Distance from the edge of a neighbor, px, within which samples are ignored: kernels mix them with its border.
pub(super) const RIM_PX: f32 = 2.0;

/// Factor on the gain of the neighbor that filled the frame before: its alignment errors move along with it, where
/// another neighbor would flicker. Larger keeps neighbors that are far.
const CONTINUITY_GAIN: f64 = 2.0;

/// A neighbor and the map to it.
pub(super) struct Neighbor<'a> {
    pub(super) held: &'a Held,
    /// From positions in the frame itself.
    pub(super) field: WarpField,
}

/// A neighbor not yet tried.
struct Candidate<'a> {
    neighbor: Neighbor<'a>,
    /// What a probe that it adds counts for.
    worth: f64,
    /// Probes that it covers.
    covers: Vec<bool>,
}

/// The neighbors left, and the probes that none has covered.
pub(super) struct Choice<'a> {
    candidates: Vec<Candidate<'a>>,
    left: Vec<bool>,
}

impl<'a> Choice<'a> {
    /// Of the neighbors of frame `now`, of which `before` filled the frame before.
    pub(super) fn new(
        strip: &Strip,
        now: usize,
        before: &[usize],
        neighbors: impl Iterator<Item = Neighbor<'a>>,
    ) -> Self {
        let candidate = |neighbor: Neighbor<'a>| {
            let number = neighbor.held.number;
            let kept = if before.contains(&number) { CONTINUITY_GAIN } else { 1.0 };
            let worth = kept / (1.0 + number.abs_diff(now) as f64 / HALF_WEIGHT_FRAMES);
            let inside = |src| neighbor.field.map(src).is_some_and(|p| strip.margin(p) > f64::from(RIM_PX));
            let covers = strip.probes.iter().map(|probe| inside(probe.src)).collect();
            Candidate { neighbor, worth, covers }
        };
        Self { candidates: neighbors.map(candidate).collect(), left: vec![true; strip.probes.len()] }
    }

    /// Takes out the best neighbor; `None` where none adds enough.
    pub(super) fn next(&mut self) -> Option<Neighbor<'a>> {
        let gain =
            |c: &Candidate<'_>| c.covers.iter().zip(&self.left).filter(|(covers, left)| **covers && **left).count();
        let gains = self.candidates.iter().map(gain).enumerate().filter(|(_, gain)| *gain >= MIN_GAIN);
        let scores = gains.map(|(k, gain)| (k, gain as f64 * self.candidates[k].worth));
        let (best, _) = scores.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(self.candidates.swap_remove(best).neighbor)
    }

    /// Says which probes are still open.
    pub(super) fn set_left(&mut self, left: Vec<bool>) {
        self.left = left;
    }
}
