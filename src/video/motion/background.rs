//! Background tracks: a score per track, updated from frame to frame.
//!
//! One pair of frames does not distinguish a person who fills the picture from the scene behind. Time and position do. Every track
//! `i` has a score `sᵢ ∈ [0,1]`, the running fraction of frames in which it moved with the background, measured by
//!
//! - its residual `rᵢ` against the background motion of this frame, and
//! - its drift `eᵢ ← δ eᵢ + rᵢ`, a leaky sum that lets noise cancel and makes a slow but steady own motion add up: a constant
//!   residual `v` settles at `v/(1−δ)`, white noise of deviation `σ` only at `σ/√(1−δ²)`.
//!
//! Both are relative to the background's own spread (a weighted median), so that parallax, noise and resolution set the scale.
//! A new track gets the mean score of its surroundings: a point that appears on a walking person is likely part of that person.
//!
//! The frame is divided into cells. The weight of a track in the estimation of the next motion is
//!
//! ```text
//! ωᵢ = v_c · sᵢ² / m_c,      m_c = Σ_{j∈c} sⱼ²,      v_c = b_c · m_c / (m_c + m₀),
//! ```
//!
//! so that each cell has about the same total weight independent of its number of points, cells of low scores have little weight,
//! and cells at the border more than those in the center (`b_c`), where subjects are.

use plumbline_num::math::{Point2, Vec2};

use crate::track::Observation;

/// Columns and rows of cells. 16×9 cells are about the size of a face in a half-length portrait; finer ones have too few
/// points, coarser ones mix a person with the background beside.
const COLS: usize = 16;
const ROWS: usize = 9;

/// Leak δ of the drift: memory of about 7 frames. A longer one would accumulate the parallax of a walking camera.
const DRIFT_LEAK: f64 = 0.85;
/// Weight of one frame in the running score: the score of a track that begins to move falls within 10 frames.
const LEARNING: f64 = 0.1;
/// m₀: the sum of squared scores at which a cell has half its weight: two tracks of unknown score.
const HALF_WEIGHT: f64 = 0.5;
/// Weight of a border cell relative to one in the center of the frame.
const BORDER_WEIGHT: f64 = 2.0;
/// Initial score of a track without neighbors: undecided.
const UNKNOWN: f64 = 0.5;
/// Lower bound of the score: if the estimate has locked onto a moving object, the background needs some weight to recover.
const MIN_SCORE: f64 = 0.03;
/// Spreads of the background at which residual and drift count half: beyond 4 medians (3.4 σ of a two-dimensional Gaussian) lie
/// less than 0.4 % of the noise.
const RESIDUAL_SPREADS: f64 = 4.0;
const DRIFT_SPREADS: f64 = 4.0;

/// State of one live track.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    pub(super) id: u32,
    pub(super) position: Point2,
    pub(super) score: f64,
    drift: Vec2,
    age: u32,
}

/// The live tracks by id, and the mean scores of the cells.
#[derive(Clone, Debug)]
pub(super) struct Background {
    width: f64,
    height: f64,
    tracks: Vec<Track>,
    cell_scores: Vec<f64>,
}

impl Background {
    pub(super) fn new(width: u32, height: u32) -> Self {
        let cell_scores = vec![UNKNOWN; COLS * ROWS];
        Self { width: f64::from(width), height: f64::from(height), tracks: Vec::new(), cell_scores }
    }

    /// Clears the state at a new shot.
    pub(super) fn clear(&mut self) {
        self.tracks.clear();
        self.cell_scores.fill(UNKNOWN);
    }

    /// The live tracks, ascending by id.
    pub(super) fn tracks(&self) -> &[Track] {
        &self.tracks
    }

    /// Cell of a position, row-major; positions outside count to the nearest cell.
    pub(super) fn cell(&self, p: Point2) -> usize {
        let at = |v: f64, size: f64, n: usize| ((v / size * n as f64).max(0.0) as usize).min(n - 1);
        at(p.y, self.height, ROWS) * COLS + at(p.x, self.width, COLS)
    }

    /// Number of cells.
    pub(super) const fn cells() -> usize {
        COLS * ROWS
    }

    /// `ωᵢ` of the module's formula for tracks given by score and cell, into `out`.
    pub(super) fn weights(members: &[(f64, usize)], out: &mut Vec<f64>) {
        let mut mass = [0.0; COLS * ROWS];
        for &(score, cell) in members {
            mass[cell] += score * score;
        }
        out.clear();
        out.extend(members.iter().map(|&(s, cell)| border_weight(cell) * s * s / (mass[cell] + HALF_WEIGHT)));
    }

    /// Replaces the live tracks by those of this frame. `residual(k)` is the residual vector, px, of the `k`-th old track,
    /// where it is observed and a motion was measured; `spread_px` the background's spread of residuals.
    pub(super) fn advance(&mut self, points: &[Observation], residuals: &[Option<Vec2>], spread_px: f64) {
        let drift_spread = self.accumulate_drift(residuals, spread_px);
        for (track, residual) in self.tracks.iter_mut().zip(residuals) {
            if let Some(r) = residual {
                let agrees = agreement(r.norm(), RESIDUAL_SPREADS * spread_px)
                    * agreement(track.drift.norm(), DRIFT_SPREADS * drift_spread);
                let rate = (1.0 / (f64::from(track.age) + 2.0)).max(LEARNING);
                track.score = (track.score + rate * (agrees - track.score)).max(MIN_SCORE);
                track.age = track.age.saturating_add(1);
            }
        }
        self.update_cells();
        self.replace_tracks(points);
    }

    /// Adds the residuals to the drifts and returns the background's spread of drift, px.
    fn accumulate_drift(&mut self, residuals: &[Option<Vec2>], spread_px: f64) -> f64 {
        let mut drifts = Vec::with_capacity(self.tracks.len());
        for (track, residual) in self.tracks.iter_mut().zip(residuals) {
            if let Some(r) = residual {
                track.drift = track.drift * DRIFT_LEAK + r;
                drifts.push((track.drift.norm(), track.score * track.score));
            }
        }
        weighted_median(&mut drifts).max(2.0 * spread_px)
    }

    /// Moves the score of each cell towards the mean score of its tracks.
    fn update_cells(&mut self) {
        // Memory of seven frames, as that of the drift.
        const RATE: f64 = 0.15;
        let (mut sum, mut count) = ([0.0; COLS * ROWS], [0.0; COLS * ROWS]);
        for track in &self.tracks {
            let cell = self.cell(track.position);
            sum[cell] += track.score;
            count[cell] += 1.0;
        }
        for (memory, (sum, count)) in self.cell_scores.iter_mut().zip(sum.iter().zip(count)) {
            let mean = if count > 0.0 { sum / count } else { UNKNOWN };
            *memory += RATE * (mean - *memory);
        }
    }

    /// Replaces the tracks by the points of this frame: known ids keep their state, new ones get the score of their surroundings.
    fn replace_tracks(&mut self, points: &[Observation]) {
        let mut next: Vec<Track> = points
            .iter()
            .filter(|p| p.x.is_finite() && p.y.is_finite())
            .map(|p| {
                let position = Point2::new(f64::from(p.x), f64::from(p.y));
                if let Ok(k) = self.tracks.binary_search_by_key(&p.id, |t| t.id) {
                    return Track { position, ..self.tracks[k] };
                }
                Track { id: p.id, position, score: self.surroundings(position), drift: Vec2::zeros(), age: 0 }
            })
            .collect();
        next.sort_by_key(|t| t.id);
        next.dedup_by_key(|t| t.id);
        self.tracks = next;
    }

    /// Mean score of the cell of `p` and its neighbors, a quarter of the way towards [`UNKNOWN`].
    fn surroundings(&self, p: Point2) -> f64 {
        let cell = self.cell(p);
        let (col, row) = (cell % COLS, cell / COLS);
        let (mut sum, mut count) = (0.0, 0.0);
        for r in row.saturating_sub(1)..(row + 2).min(ROWS) {
            for c in col.saturating_sub(1)..(col + 2).min(COLS) {
                sum += self.cell_scores[r * COLS + c];
                count += 1.0;
            }
        }
        0.25 * UNKNOWN + 0.75 * (sum / count)
    }
}

/// 1 at a distance of 0, 1/2 at `half`, decreasing with the fourth power beyond.
fn agreement(distance: f64, half: f64) -> f64 {
    let q = (distance / half).powi(2);
    1.0 / (1.0 + q * q)
}

/// From 1 in the center of the frame to [`BORDER_WEIGHT`] in the outermost cells.
fn border_weight(cell: usize) -> f64 {
    let offset = |i: usize, n: usize| ((i as f64 + 0.5) / n as f64 * 2.0 - 1.0).abs();
    let edge = offset(cell % COLS, COLS).max(offset(cell / COLS, ROWS));
    1.0 + (BORDER_WEIGHT - 1.0) * edge * edge
}

/// The value below which half the weight lies; 0 for nothing. Sorts `items` by value.
pub(super) fn weighted_median(items: &mut [(f64, f64)]) -> f64 {
    items.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = items.iter().map(|i| i.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    for &(value, weight) in items.iter() {
        sum += weight;
        if sum >= half {
            return value;
        }
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crowded_cell_has_no_more_weight_than_a_sparse_one() {
        let mut members = vec![(1.0, 70); 100];
        members.extend([(1.0, 71); 2]);
        let mut weights = Vec::new();
        Background::weights(&members, &mut weights);
        let (crowd, pair) = (weights[..100].iter().sum::<f64>(), weights[100..].iter().sum::<f64>());
        assert!(crowd < 1.4 * pair, "{crowd} against {pair}");
    }

    #[test]
    fn border_cells_outweigh_the_center() {
        assert!(border_weight(0) > 1.7 * border_weight(4 * COLS + 8));
    }

    #[test]
    fn the_weighted_median_splits_the_weight() {
        assert_eq!(weighted_median(&mut [(3.0, 1.0), (1.0, 1.0), (2.0, 1.0)]), 2.0);
        assert_eq!(weighted_median(&mut [(3.0, 5.0), (1.0, 1.0), (2.0, 1.0)]), 3.0);
        assert_eq!(weighted_median(&mut []), 0.0);
    }
}
