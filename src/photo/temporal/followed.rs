//! Importance followed over time, moment by moment of a shot.
//!
//! Importance at a moment is a temporal mean, motion compensated. With `I_j` the importance found at moment `j`,
//! `M_{jk}` the camera's motion from moment `k` to `j`, `S_k` the map from source to shown picture and `g` a Gaussian
//! of time,
//!
//! ```text
//! Ī_k(q) = Σ_j g(t_j − t_k) I_j(M_{jk} S_k⁻¹ q) / Σ_j g(t_j − t_k),
//! ```
//!
//! the sums over moments of the same shot in whose frame the point lies. Flicker is averaged out, static objects keep
//! their importance under camera shake, and coming objects are anticipated.

use std::ops::Range;

use rayon::prelude::*;

use super::{ClipData, ClipImportance};
use plumbline_image::Plane;
use plumbline_image::feature::Importance;
use plumbline_num::math::{Homography, Point2, PointMap, Similarity2};

/// Cutoff of the Gaussian, standard deviations: its weight has fallen to 4 %.
const CUTOFF: f64 = 2.5;

/// The importance of a shot's moments.
pub(super) struct Followed {
    /// The moments' frames and times; at least one.
    pub(super) frames: Vec<usize>,
    pub(super) times_s: Vec<f64>,
    /// Importance over the picture that is shown.
    pub(super) moments: Vec<Importance>,
    sigma_s: f64,
}

/// A shot's moments as they were judged, and the motions between them.
struct Judged<'a> {
    /// Of the picture that is shown, and of the frames that were judged, px.
    size: (f64, f64),
    seen_size: (f64, f64),
    /// From the frames in which motion was measured to those judged.
    seen_from_src: Option<&'a dyn PointMap>,
    cols: usize,
    rows: usize,
    cells: Vec<&'a [u8]>,
    times_s: Vec<f64>,
    /// To moment `k` from moment `k − 1`, px of the source.
    steps: Vec<Similarity2>,
    /// What undoes the showing at each moment.
    src_from_shown: Vec<Homography>,
}

impl Followed {
    /// Follows the shot of `frames`. One in which no moment was judged is even.
    pub(super) fn new(clip: &ClipData<'_>, importance: &ClipImportance, frames: &Range<usize>, sigma_s: f64) -> Self {
        let known = |f: &usize| frames.contains(f) && *f < clip.times_s.len();
        let within: Vec<&(usize, Vec<u8>)> = importance.moments.iter().filter(|(f, _)| known(f)).collect();
        if within.is_empty() {
            let time = clip.times_s.get(frames.start).copied().unwrap_or(0.0);
            return Self {
                frames: vec![frames.start],
                times_s: vec![time],
                moments: vec![Importance::even()],
                sigma_s,
            };
        }
        let of_frames: Vec<usize> = within.iter().map(|(f, _)| *f).collect();
        let step = |k: usize| {
            let between = if k == 0 { 0..0 } else { of_frames[k - 1] + 1..of_frames[k] + 1 };
            between.filter_map(|f| clip.motion.get(f)).fold(Similarity2::IDENTITY, |chain, m| *m * chain)
        };
        let undo = |f: &usize| clip.shown_from_src.get(*f).and_then(Homography::inverse);
        let px = |size: (usize, usize)| (size.0 as f64, size.1 as f64);
        let judged = Judged {
            size: px(clip.size),
            seen_size: px(clip.judged.map_or(clip.size, |(_, size)| size)),
            seen_from_src: clip.judged.map(|(map, _)| map),
            cols: importance.cols,
            rows: importance.rows,
            cells: within.iter().map(|(_, cells)| cells.as_slice()).collect(),
            times_s: of_frames.iter().map(|f| clip.times_s[*f]).collect(),
            steps: (0..of_frames.len()).map(step).collect(),
            src_from_shown: of_frames.iter().map(|f| undo(f).unwrap_or_else(Homography::identity)).collect(),
        };
        let moments = (0..of_frames.len()).into_par_iter().map(|k| judged.followed(k, sigma_s)).collect();
        Self { frames: of_frames, times_s: judged.times_s, moments, sigma_s }
    }

    /// Series of values, one per moment, evened out as the importance was.
    pub(super) fn smoothed(&self, series: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let at = |k: usize| {
            let near = near(&self.times_s, k, self.sigma_s);
            let weights: Vec<f64> =
                near.clone().map(|j| gauss(self.times_s[j] - self.times_s[k], self.sigma_s)).collect();
            let total: f64 = weights.iter().sum();
            let own = &series[k];
            let mean = |i: usize| {
                let sum: f64 = near.clone().zip(&weights).map(|(j, w)| w * (series[j][i] - own[i])).sum();
                own[i] + sum / total
            };
            (0..own.len()).map(mean).collect()
        };
        (0..series.len()).map(at).collect()
    }
}

/// Moments within reach of moment `k`.
fn near(times_s: &[f64], k: usize, sigma_s: f64) -> Range<usize> {
    let within = |j: &usize| (times_s[*j] - times_s[k]).abs() <= CUTOFF * sigma_s;
    let first = (0..k).rev().take_while(within).last().unwrap_or(k);
    let last = (k..times_s.len()).take_while(within).last().unwrap_or(k);
    first..last + 1
}

fn gauss(t: f64, sigma: f64) -> f64 {
    (-0.5 * (t / sigma) * (t / sigma)).exp()
}

impl Judged<'_> {
    /// `Ī_k`.
    fn followed(&self, k: usize, sigma_s: f64) -> Importance {
        let near = near(&self.times_s, k, sigma_s);
        let motions = self.motions(k, &near);
        let weights: Vec<f64> = near.clone().map(|j| gauss(self.times_s[j] - self.times_s[k], sigma_s)).collect();
        let value = |x: usize, y: usize| {
            let shown = Point2::new(
                (x as f64 + 0.5) / self.cols as f64 * self.size.0,
                (y as f64 + 0.5) / self.rows as f64 * self.size.1,
            );
            let Some(src) = self.src_from_shown[k].apply(shown) else { return 0.0 };
            let (mut sum, mut total) = (0.0, 0.0);
            for ((j, motion), weight) in near.clone().zip(&motions).zip(&weights) {
                if let Some(value) = self.sample(j, motion.apply(src)) {
                    sum += weight * value;
                    total += weight;
                }
            }
            if total > 0.0 { (sum / total).clamp(0.0, 1.0) as f32 } else { 0.0 }
        };
        Importance::from_plane(Plane::from_fn(self.cols, self.rows, value)).expect("means of values in [0, 1]")
    }

    /// `M_{jk}` for every `j` of `near`.
    fn motions(&self, k: usize, near: &Range<usize>) -> Vec<Similarity2> {
        let mut motions = vec![Similarity2::IDENTITY; near.len()];
        for j in k + 1..near.end {
            motions[j - near.start] = self.steps[j] * motions[j - 1 - near.start];
        }
        for j in (near.start..k).rev() {
            let back = self.steps[j + 1].inverse().unwrap_or(Similarity2::IDENTITY);
            motions[j - near.start] = back * motions[j + 1 - near.start];
        }
        motions
    }

    /// The importance at a point of moment `j`, px; bilinear between the centers of cells, `None` outside.
    fn sample(&self, j: usize, p: Point2) -> Option<f64> {
        let p = self.seen_from_src.map_or(Some(p), |map| map.map(p))?;
        let (s, t) = (p.x / self.seen_size.0, p.y / self.seen_size.1);
        let inside = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
        if !inside {
            return None;
        }
        let place = |fraction: f64, count: usize| {
            let at = (fraction * count as f64 - 0.5).clamp(0.0, (count - 1) as f64);
            let first = (at as usize).min(count.saturating_sub(2));
            (first, (first + 1).min(count - 1), at - first as f64)
        };
        let ((left, right, u), (above, below, v)) = (place(s, self.cols), place(t, self.rows));
        let cell = |x: usize, y: usize| f64::from(self.cells[j][y * self.cols + x]) / 255.0;
        let row = |y: usize| cell(left, y) + u * (cell(right, y) - cell(left, y));
        Some(row(above) + v * (row(below) - row(above)))
    }
}
