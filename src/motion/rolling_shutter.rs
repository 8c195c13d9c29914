//! Rolling shutter: the readout time of a clip from its tracks, and the correction of a point for its own capture time.
//!
//! Row `y` of a frame is captured `τ(y) = (y/H − ½) r` after the frame's center row; `r` is the readout, in frame periods.
//! A point that the frame shows at `p` was, at the time of the center row, at
//!
//! ```text
//! p̃ = p − τ V(p) − ½ τ² A(p),     V = (mₖ + mₖ₊₁)/2,   A = mₖ₊₁ − mₖ,
//! ```
//!
//! with `mₖ(p)` the displacement from frame `k−1` to `k` near `p`.
//!
//! **Estimation.** Constant velocity shifts both frames alike and is invisible; what shows between two frames is the change of
//! velocity. With the similarity `Sₖ` fitted to the pairs `pᵢ → qᵢ`, the residuals `eᵢ = qᵢ − Sₖ pᵢ` contain
//!
//! ```text
//! eᵢ = r bᵢ + …,     bᵢ = (y_q/H − ½) Vₖ(qᵢ) − Lₖ (y_p/H − ½) Vₖ₋₁(pᵢ),
//! ```
//!
//! (`Lₖ`: linear part of `Sₖ`) less what the fit absorbs, so `b` is projected on the complement of the four similarity
//! directions before each frame pair votes `r̂ = Σ b·e / Σ b·b` with weight `Σ b·b`. Parallax grows with velocity, the basis
//! with its change; a hand's velocity and its change are uncorrelated, so parallax scatters the votes but does not shift
//! them. The votes go into a histogram (bounded memory); its weighted median, refined by the mean of the votes around
//! it, is the readout, if it stands clear of its own uncertainty; else the answer is "none", never a guess.
//!
//! # Reference
//! Karpenko, Jacobs, Baek, Levoy, *Digital video stabilization and rolling shutter correction using gyroscopes*, Stanford
//! CSTR 2011-03 (row time model); Forssén, Ringaby, CVPR 2010 (readout from tracks).

use std::collections::VecDeque;

use crate::math::{Homography, Point2, Similarity2, Vec2};

use super::clip::ClipMotion;
use super::frame_motion::MotionQuality;
use super::planar_fit::{self, Pair};

/// Largest readout, frame periods: rows beyond the next frame's first row do not exist; a little slack for its noise.
const LARGEST: f64 = 1.2;
/// The histogram reaches twice as far, so that scattered votes do not pile up at the limits.
const REACH: f64 = 2.4;
const BINS: usize = 480;
/// Standard errors by which a readout must differ from 0. Votes of neighboring frames are not independent: 3 would find
/// readouts in one global-shutter clip in a dozen.
const SIGNIFICANCE: f64 = 5.0;
/// Least readout reported, frame periods: 0.08 is 3 ms at 30 frames/s, invisible.
const LEAST: f64 = 0.08;
/// Motions that a vote looks at: the pair's own and two on either side.
const WINDOW: usize = 5;
/// Fewest votes.
const FEWEST_VOTES: f64 = 20.0;

/// Collects evidence on a clip's readout, frame pair by frame pair, in constant memory.
#[derive(Clone, Debug)]
pub struct ReadoutEstimator {
    height: f64,
    /// The last steps, oldest first: the middle one is judged when the motions on both its sides are known.
    window: VecDeque<Step>,
    histogram: Vec<Bin>,
}

#[derive(Clone, Debug)]
struct Step {
    motion: Similarity2,
    pairs: Vec<Pair>,
}

/// Votes of similar value: their number, weight, and weighted sums.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    count: f64,
    weight: f64,
    weight_squared: f64,
    sum: f64,
}

/// A readout that the tracks support.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readout {
    /// First row to last row, frame periods, in [−1.2, 1.2]; positive where rows are read downwards.
    pub frames: f64,
    /// Its standard error, frame periods.
    pub error: f64,
}

impl ReadoutEstimator {
    /// For frames of `height` px.
    pub fn new(height: u32) -> Self {
        Self { height: f64::from(height), window: VecDeque::new(), histogram: vec![Bin::default(); BINS] }
    }

    /// Takes the background pairs of one frame and the motion fitted to it. Pairs from anything but a measured motion break the
    /// chain: call [`Self::interrupt`].
    pub fn push(&mut self, motion: &Similarity2, pairs: &[Pair]) {
        self.window.push_back(Step { motion: *motion, pairs: pairs.to_vec() });
        if self.window.len() > WINDOW {
            self.window.pop_front();
        }
        if self.window.len() == WINDOW {
            self.vote();
        }
    }

    /// A cut, a gap or a repeated frame: velocities on its two sides do not belong together.
    pub fn interrupt(&mut self) {
        self.window.clear();
    }

    /// The readout the evidence supports; `None` for a global shutter, a camera too steady to tell, or too few frames.
    pub fn estimate(&self) -> Option<Readout> {
        let center = self.median()?;
        let near = |half: f64| self.moments(center, half);
        let scatter = near(REACH).1.sqrt().min(0.5);
        let (mean, variance, effective, count) = near((2.0 * scatter).max(0.1));
        let error = (variance / effective).sqrt().max(1e-3);
        let clear = mean.abs() > SIGNIFICANCE * error && mean.abs() >= LEAST && mean.abs() <= LARGEST;
        (clear && count >= FEWEST_VOTES).then_some(Readout { frames: mean, error })
    }

    /// The weighted median of the votes; `None` without votes.
    fn median(&self) -> Option<f64> {
        let total: f64 = self.histogram.iter().map(|b| b.weight).sum();
        let mut sum = 0.0;
        for bin in &self.histogram {
            sum += bin.weight;
            if total > 0.0 && sum >= total / 2.0 {
                return Some(bin.sum / bin.weight);
            }
        }
        None
    }

    /// Weighted mean and variance, effective and true number of the votes within `half` of `center`.
    fn moments(&self, center: f64, half: f64) -> (f64, f64, f64, f64) {
        let near = || self.histogram.iter().filter(|b| b.weight > 0.0 && (b.sum / b.weight - center).abs() <= half);
        let weight: f64 = near().map(|b| b.weight).sum();
        let mean = near().map(|b| b.sum).sum::<f64>() / weight;
        let variance = near().map(|b| b.weight * (b.sum / b.weight - mean).powi(2)).sum::<f64>() / weight;
        let effective = weight * weight / near().map(|b| b.weight_squared).sum::<f64>();
        (mean, variance, effective, near().map(|b| b.count).sum())
    }

    fn vote(&mut self) {
        let Some((value, weight)) = self.judge() else { return };
        if !(value.abs() < REACH && weight > 0.0 && weight.is_finite()) {
            return;
        }
        let k = (((value + REACH) / (2.0 * REACH) * BINS as f64) as usize).min(BINS - 1);
        let bin = &mut self.histogram[k];
        bin.count += 1.0;
        bin.weight += weight;
        bin.weight_squared += weight * weight;
        bin.sum += weight * value;
    }

    /// `r̂` of the window's middle frame pair and its weight.
    fn judge(&self) -> Option<(f64, f64)> {
        let motions: Vec<Similarity2> = self.window.iter().map(|s| s.motion).collect();
        let step = &self.window[WINDOW / 2];
        let (before, now) = (velocity(&motions[..4]), velocity(&motions[1..]));
        let linear = Similarity2 { t: Vec2::zeros(), ..step.motion };
        let basis: Vec<Pair> = step
            .pairs
            .iter()
            .map(|pair| {
                let (p, q) = (pair.previous, pair.this);
                let here = now(q) * (q.y / self.height - 0.5);
                let there = linear.apply(Point2::from(before(p) * (p.y / self.height - 0.5))).coords;
                Pair { previous: p, this: p + (here - there) }
            })
            .collect();
        let fitted = planar_fit::similarity(&basis, &vec![1.0; basis.len()])?;
        let (mut be, mut bb, mut ee) = (0.0, 0.0, 0.0);
        for (pair, b) in step.pairs.iter().zip(&basis) {
            let b = b.this - fitted.apply(b.previous);
            let e = pair.this - step.motion.apply(pair.previous);
            be += b.dot(&e);
            bb += b.norm_squared();
            ee += e.norm_squared();
        }
        // A frame's vote counts by how much of its residual the basis could explain at all: frames full of parallax shout
        // no louder than calm ones.
        (bb > 0.0 && ee > 0.0).then(|| (be / bb, bb / (ee / step.pairs.len() as f64)))
    }
}

/// Velocity field, px per frame, at the frame between the second and the third of four motions, by the central difference of
/// fourth order: the plain one loses a third of a 7 Hz shake at 30 frames/s, and the readout would come out too long.
fn velocity(motions: &[Similarity2]) -> impl Fn(Point2) -> Vec2 + '_ {
    let back = motions[1].inverse().unwrap_or(Similarity2::IDENTITY);
    move |p| {
        let step = |k: usize| motions[k].apply(p) - p;
        let near = (p - back.apply(p)) + step(2);
        (near * 7.0 - step(0) - step(3)) / 12.0
    }
}

/// Moves the points of one frame to where they were at the time of its center row.
#[derive(Clone, Debug, PartialEq)]
pub struct RowMotion {
    back: Homography,
    ahead: Homography,
    readout: f64,
    height: f64,
}

impl RowMotion {
    /// From the motions `prev_from_this` and `next_from_this`, px, and the readout in frame periods.
    pub fn new(prev_from_this: Homography, next_from_this: Homography, readout: f64, height: u32) -> Self {
        Self { back: prev_from_this, ahead: next_from_this, readout, height: f64::from(height) }
    }

    /// Displacement, px, from where the frame shows a point to where it was at the time of the center row.
    pub fn displacement(&self, p: Point2) -> Vec2 {
        let tau = (p.y / self.height - 0.5) * self.readout;
        let (Some(back), Some(ahead)) = (self.back.apply(p), self.ahead.apply(p)) else { return Vec2::zeros() };
        let (arriving, leaving) = (p - back, ahead - p);
        let (v, a) = ((arriving + leaving) / 2.0, leaving - arriving);
        -(v * tau + a * (0.5 * tau * tau))
    }

    /// Where the point shown at `p` was at the time of the center row.
    pub fn center_time(&self, p: Point2) -> Point2 {
        p + self.displacement(p)
    }
}

impl ClipMotion {
    /// The row motion of frame `frame`; `None` without a readout or outside the clip. At the ends of a shot, and beside motions
    /// that were not measured, the known side's velocity is used.
    pub fn row_motion(&self, frame: usize) -> Option<RowMotion> {
        let readout = self.readout_in_frames();
        if readout == 0.0 || frame >= self.frames.len() {
            return None;
        }
        let known = |k: usize| {
            self.frames.get(k).filter(|f| matches!(f.quality, MotionQuality::Measured | MotionQuality::Bridged))
        };
        let back = known(frame).and_then(|f| f.homography.inverse());
        let ahead = known(frame + 1).map(|f| f.homography);
        let (back, ahead) = match (back, ahead) {
            (Some(b), Some(a)) => (b, a),
            (Some(b), None) => (b, b.inverse()?),
            (None, Some(a)) => (a.inverse()?, a),
            (None, None) => return None,
        };
        Some(RowMotion::new(back, ahead, readout, self.height))
    }
}
