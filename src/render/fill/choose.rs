//! Which neighbor to show next: the one that adds most, less for each frame that it is away.
//!
//! Whether a neighbor covers a place is asked at a few probes per block, once per neighbor.

use super::strip::Strip;
use crate::image::Frame;
use crate::math::PointMap;
use crate::warp::WarpField;

/// Distance, frames, at which a neighbor counts half as much: motion adds up errors and the scene changes. Smaller makes
/// many thin layers, larger skips good near ones.
const HALF: f64 = 12.0;
/// Probes that a neighbor must add: fewer are not worth its rendering.
const LEAST_GAIN: usize = 2;
/// Samples this near to the edge of a neighbor do not count, px: kernels mix them with its border.
pub(super) const RIM_PX: f32 = 2.0;

/// A neighbor not yet tried.
struct Candidate<'a> {
    frame: &'a Frame,
    field: WarpField,
    /// Frames away.
    distance: usize,
    /// Probes that it covers.
    covers: Vec<bool>,
}

/// The neighbors left, and the probes that none has covered.
pub(super) struct Choice<'a> {
    candidates: Vec<Candidate<'a>>,
    left: Vec<bool>,
}

impl<'a> Choice<'a> {
    /// Of neighbors given by their distance in frames, pixels, and map from the frame itself.
    pub(super) fn new(strip: &Strip, neighbors: Vec<(usize, &'a Frame, WarpField)>) -> Self {
        let candidate = |(distance, frame, field): (usize, &'a Frame, WarpField)| {
            let inside = |src| field.map(src).is_some_and(|p| strip.margin(p) > f64::from(RIM_PX));
            let covers = strip.probes.iter().map(|probe| inside(probe.src)).collect();
            Candidate { frame, field, distance, covers }
        };
        Self { candidates: neighbors.into_iter().map(candidate).collect(), left: vec![true; strip.probes.len()] }
    }

    /// Takes out the best neighbor; `None` where none adds enough.
    pub(super) fn next(&mut self) -> Option<(&'a Frame, WarpField)> {
        let gain =
            |c: &Candidate<'_>| c.covers.iter().zip(&self.left).filter(|(covers, left)| **covers && **left).count();
        let score = |c: &Candidate<'_>| gain(c) as f64 / (1.0 + c.distance as f64 / HALF);
        let scores = self.candidates.iter().enumerate().filter(|(_, c)| gain(c) >= LEAST_GAIN);
        let (best, _) = scores.map(|(k, c)| (k, score(c))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let Candidate { frame, field, .. } = self.candidates.swap_remove(best);
        Some((frame, field))
    }

    /// Says which probes are still open.
    pub(super) fn set_left(&mut self, left: Vec<bool>) {
        self.left = left;
    }
}
