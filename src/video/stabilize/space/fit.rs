//! A weighted similarity fit to moving points, and the weight of each track over its life.

use std::collections::HashMap;

use crate::motion::{self, Pair};
use crate::stabilize::error::StabilizeError;
use crate::stabilize::tracks::Tracks;
use plumbline_num::math::{Point2, Similarity2};

/// Least number of pairs for a similarity: with 24 equations for four parameters one outlier does not dominate.
const MIN_PAIRS: usize = 12;

/// Iterations of reweighting, each at the scale of the median residual: a fit whose initial guess is the mean has converged
/// after three.
const ITERATIONS: usize = 3;

/// Time over which the weight of a track rises and falls, s: that of the anchors of the warp.
const FADE_S: f64 = 0.5;

/// Weight of a track at its very ends: not zero, so that there is a fit where all tracks begin or end.
const MIN_WEIGHT: f64 = 1e-3;

/// Pairs of points that a similarity is fitted to.
#[derive(Default)]
pub(super) struct Fit {
    pairs: Vec<Pair>,
    weights: Vec<f64>,
}

impl Fit {
    pub(super) fn add(&mut self, previous: Point2, this: Point2, weight: f64) {
        self.pairs.push(Pair { previous, this });
        self.weights.push(weight);
    }

    pub(super) fn similarity(&self) -> Option<Similarity2> {
        (self.pairs.len() >= MIN_PAIRS).then(|| motion::similarity(&self.pairs, &self.weights)).flatten()
    }

    /// The similarity of most points: near ones, which move most and by parallax, get less weight.
    pub(super) fn robust_similarity(mut self) -> Option<Similarity2> {
        let mut found = self.similarity()?;
        for _ in 0..ITERATIONS {
            let residuals: Vec<f64> =
                self.pairs.iter().map(|p| (found.apply(p.previous) - p.this).norm_squared()).collect();
            let mut sorted = residuals.clone();
            let middle = sorted.len() / 2;
            let scale = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 + f64::MIN_POSITIVE;
            self.weights = residuals.iter().map(|r| 1.0 / (1.0 + r / scale)).collect();
            found = self.similarity()?;
        }
        Some(found)
    }
}

/// First and last frame of every track.
pub(super) struct TrackSpans(HashMap<u32, (usize, usize)>);

impl TrackSpans {
    pub(super) fn of(tracks: &Tracks) -> Result<Self, StabilizeError> {
        let mut spans = HashMap::new();
        for frame in 0..tracks.store.frames() {
            for o in tracks.store.read(frame)?.observations {
                spans.entry(o.id).or_insert((frame, frame)).1 = frame;
            }
        }
        Ok(Self(spans))
    }

    /// Weight of a track at a frame, in (0, 1]: small where it begins and ends. Points that appear and disappear with full weight,
    /// near ones above all, would make the fit jump.
    pub(super) fn weight(&self, id: u32, frame: usize, times_s: &[f64]) -> f64 {
        let Some(&(first, last)) = self.0.get(&id) else { return MIN_WEIGHT };
        let ramp = |from: usize, to: usize| ((times_s[to] - times_s[from]) / FADE_S).clamp(MIN_WEIGHT, 1.0);
        ramp(first, frame) * ramp(frame, last)
    }
}
