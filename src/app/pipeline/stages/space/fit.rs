//! A similarity through what points do, and how much each of them counts.

use std::collections::HashMap;

use crate::pipeline::run_error::RunError;
use crate::pipeline::stages::analysis::{Tracks, store_error};
use plumbline_num::math::{Point2, Similarity2};
use plumbline_video::motion::{self, Pair};

/// Sightings that a similarity is fitted to, at least.
const LEAST_SIGHTINGS: usize = 12;

/// Rounds of reweighting, each at the scale of the median miss: three settle a fit that starts from the mean.
const ROUNDS: usize = 3;

/// Time, s, over which a track comes to count and ceases to.
const FADE_S: f64 = 0.5;

/// Weight of a track at its very ends: all of them together still make a fit where there is nothing else.
const LEAST_FADE: f64 = 1e-3;

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
        (self.pairs.len() >= LEAST_SIGHTINGS).then(|| motion::similarity(&self.pairs, &self.weights)).flatten()
    }

    /// The similarity of most points: near ones, which move most and on courses of their own, count less.
    pub(super) fn robust_similarity(mut self) -> Option<Similarity2> {
        let mut found = self.similarity()?;
        for _ in 0..ROUNDS {
            let misses: Vec<f64> =
                self.pairs.iter().map(|p| (found.apply(p.previous) - p.this).norm_squared()).collect();
            let mut sorted = misses.clone();
            let middle = sorted.len() / 2;
            let scale = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1 + f64::MIN_POSITIVE;
            self.weights = misses.iter().map(|m| 1.0 / (1.0 + m / scale)).collect();
            found = self.similarity()?;
        }
        Some(found)
    }
}

/// First and last frame of every track.
pub(super) struct Lives(HashMap<u32, (usize, usize)>);

impl Lives {
    pub(super) fn of(tracks: &Tracks) -> Result<Self, RunError> {
        let mut lives = HashMap::new();
        for frame in 0..tracks.store.frames() {
            for o in tracks.store.read(frame).map_err(store_error)?.observations {
                lives.entry(o.id).or_insert((frame, frame)).1 = frame;
            }
        }
        Ok(Self(lives))
    }

    /// How much a track counts at a frame, in (0, 1]: little where it is born and where it dies. Points that came and went
    /// with their full weight, near ones above all, would make a fit to them jump.
    pub(super) fn weight(&self, id: u32, frame: usize, times_s: &[f64]) -> f64 {
        let Some(&(first, last)) = self.0.get(&id) else { return LEAST_FADE };
        let ramp = |from: usize, to: usize| ((times_s[to] - times_s[from]) / FADE_S).clamp(LEAST_FADE, 1.0);
        ramp(first, frame) * ramp(frame, last)
    }
}
