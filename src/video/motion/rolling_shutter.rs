//! Rolling shutter: the readout time of a clip from its tracks, and the correction of a point for its own capture time.
//!
//! Row `y` of a frame is captured `τ(y) = (y/H − ½) r` after the frame's center row; `r` is the readout, in frame periods.
//! A point observed at `p` was, at the time of the center row, at
//!
//! ```text
//! p̃ = p − Σⱼ Lⱼ(τ) (Mⱼ p − p),     j = −2, −1, 1, 2,
//! ```
//!
//! with `Mⱼ` the chained motion from this frame to the `j`-th after it and `Lⱼ` the quartic Lagrange weights: nearly linear for a
//! pan, and accurate for a shake of several cycles per second, which linear interpolation attenuates.
//!
//! **Estimation.** Constant velocity displaces both frames alike and is not observable; the change of velocity is. With the
//! similarity `Sₖ` fitted to the pairs `pᵢ → qᵢ`, the residuals `eᵢ = qᵢ − Sₖ pᵢ` contain
//!
//! ```text
//! eᵢ = r bᵢ + …,     bᵢ = (y_q/H − ½) Vₖ(qᵢ) − Lₖ (y_p/H − ½) Vₖ₋₁(pᵢ),
//! ```
//!
//! (`Lₖ`: linear part of `Sₖ`) minus the part that the fit absorbs, so `b` is projected on the complement of the four similarity
//! directions before each frame pair gives an estimate `r̂ = Σ b·e / Σ b·b` with weight `Σ b·b`. Parallax grows with velocity,
//! the basis with its change; a hand's velocity and its change are uncorrelated, so parallax adds variance to the estimates but no
//! bias. Horizontal motion (shear) and vertical motion (stretch) are estimated separately: the vertical oscillation of a runner
//! couples forward speed to vertical acceleration and biases one of them, never both. The estimates go into histograms (bounded
//! memory); their weighted median, refined by the mean of the estimates around it, is the readout time, if it is significant
//! against its standard error; otherwise none is reported.
//!
//! # Reference
//! Karpenko, Jacobs, Baek, Levoy, *Digital video stabilization and rolling shutter correction using gyroscopes*, Stanford
//! CSTR 2011-03 (row time model); Forssén, Ringaby, CVPR 2010 (readout from tracks).

use std::collections::VecDeque;

use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};

use super::clip::ClipMotion;
use super::frame_motion::MotionQuality;
use super::planar_fit::{self, Pair};

/// Largest readout, frame periods: at most one, since the next frame follows; 20 % are tolerance for noise.
const MAX_READOUT: f64 = 1.2;
/// Range of the histogram, twice that, so that scattered estimates do not accumulate at its limits.
const RANGE: f64 = 2.0 * MAX_READOUT;
/// Bins of the histogram: steps of 0.01 frame periods, an eighth of [`MIN_READOUT`].
const BINS: usize = 480;
/// Standard errors by which a readout must differ from 0. Estimates of neighboring frames are not independent: at 3, one
/// global-shutter clip in a dozen would get a readout.
const SIGNIFICANCE: f64 = 5.0;
/// Least readout reported, frame periods: 0.08 is 3 ms at 30 frames/s, invisible.
const MIN_READOUT: f64 = 0.08;
/// Motions per estimate: the pair's own and two on either side.
const WINDOW: usize = 5;
/// Difference between the readouts from horizontal and vertical motion, frame periods, attributed to model error; a larger one,
/// plus three standard errors, rejects both.
const MAX_DISAGREEMENT: f64 = 0.15;
/// Least number of estimates: with 20 a standard error is known to a sixth.
const MIN_VOTES: f64 = 20.0;

/// Collects evidence on a clip's readout, frame pair by frame pair, in constant memory.
#[derive(Clone, Debug)]
pub struct ReadoutEstimator {
    height: f64,
    /// The last steps, oldest first: the middle one is used when the motions on both its sides are known.
    window: VecDeque<Step>,
    /// From horizontal and from vertical motion.
    votes: [Votes; 2],
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
        Self { height: f64::from(height), window: VecDeque::new(), votes: [Votes::new(), Votes::new()] }
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

    /// Interrupts the chain at a cut, a gap or a repeated frame.
    pub fn interrupt(&mut self) {
        self.window.clear();
    }

    /// The readout estimate; `None` for a global shutter, a camera too steady for an estimate, too few frames, or where
    /// horizontal and vertical motion contradict each other.
    pub fn estimate(&self) -> Option<Readout> {
        let found: Vec<Readout> = self.votes.iter().filter_map(Votes::summary).collect();
        let weight = |r: &Readout| 1.0 / (r.error * r.error);
        let total: f64 = found.iter().map(weight).sum();
        let frames = found.iter().map(|r| weight(r) * r.frames).sum::<f64>() / total;
        let error = (1.0 / total).sqrt();
        if let [x, y] = &found[..] {
            let apart = (x.frames - y.frames).abs();
            if !(apart <= MAX_DISAGREEMENT + 3.0 * x.error.hypot(y.error)) {
                return None;
            }
        }
        let clear = frames.abs() > SIGNIFICANCE * error && frames.abs() >= MIN_READOUT && frames.abs() <= MAX_READOUT;
        clear.then_some(Readout { frames, error })
    }

    fn vote(&mut self) {
        let motions: Vec<Similarity2> = self.window.iter().map(|s| s.motion).collect();
        for (axis, votes) in [Vec2::x(), Vec2::y()].into_iter().zip(&mut self.votes) {
            if let Some((value, weight)) = estimate(&self.window[WINDOW / 2], &motions, self.height, axis) {
                votes.add(value, weight);
            }
        }
    }
}

/// Votes for a readout, by value.
#[derive(Clone, Debug)]
struct Votes {
    bins: Vec<Bin>,
}

impl Votes {
    fn new() -> Self {
        Self { bins: vec![Bin::default(); BINS] }
    }

    fn add(&mut self, value: f64, weight: f64) {
        if !(value.abs() < RANGE && weight > 0.0 && weight.is_finite()) {
            return;
        }
        let k = (((value + RANGE) / (2.0 * RANGE) * BINS as f64) as usize).min(BINS - 1);
        let bin = &mut self.bins[k];
        bin.count += 1.0;
        bin.weight += weight;
        bin.weight_squared += weight * weight;
        bin.sum += weight * value;
    }

    /// Mean of the votes around their weighted median, with its standard error; `None` for too few.
    fn summary(&self) -> Option<Readout> {
        let center = self.median()?;
        let scatter = self.moments(center, RANGE).1.sqrt().min(0.5);
        let (frames, variance, effective, count) = self.moments(center, (2.0 * scatter).max(0.1));
        let error = (variance / effective).sqrt().max(1e-3);
        (count >= MIN_VOTES && error.is_finite()).then_some(Readout { frames, error })
    }

    /// The weighted median of the votes; `None` without votes.
    fn median(&self) -> Option<f64> {
        let total: f64 = self.bins.iter().map(|b| b.weight).sum();
        let mut sum = 0.0;
        for bin in &self.bins {
            sum += bin.weight;
            if total > 0.0 && sum >= total / 2.0 {
                return Some(bin.sum / bin.weight);
            }
        }
        None
    }

    /// Weighted mean and variance, effective and true number of the votes within `half` of `center`.
    fn moments(&self, center: f64, half: f64) -> (f64, f64, f64, f64) {
        let near = || self.bins.iter().filter(|b| b.weight > 0.0 && (b.sum / b.weight - center).abs() <= half);
        let weight: f64 = near().map(|b| b.weight).sum();
        let mean = near().map(|b| b.sum).sum::<f64>() / weight;
        let variance = near().map(|b| b.weight * (b.sum / b.weight - mean).powi(2)).sum::<f64>() / weight;
        let effective = weight * weight / near().map(|b| b.weight_squared).sum::<f64>();
        (mean, variance, effective, near().map(|b| b.count).sum())
    }
}

/// `r̂` of one frame pair and its weight, from the motion along `axis`; `motions` are its own and two on either side.
fn estimate(step: &Step, motions: &[Similarity2], height: f64, axis: Vec2) -> Option<(f64, f64)> {
    let (before, now) = (velocity(&motions[..4]), velocity(&motions[1..]));
    let linear = Similarity2 { t: Vec2::zeros(), ..step.motion };
    let along = |v: Vec2| axis * axis.dot(&v);
    let basis = step.pairs.iter().map(|pair| {
        let (p, q) = (pair.previous, pair.this);
        let here = along(now(q)) * (q.y / height - 0.5);
        let there = linear.apply(Point2::from(along(before(p)) * (p.y / height - 0.5))).coords;
        Pair { previous: p, this: p + (here - there) }
    });
    let basis: Vec<Pair> = basis.collect();
    let fitted = planar_fit::similarity(&basis, &vec![1.0; basis.len()])?;
    let (mut be, mut bb, mut ee) = (0.0, 0.0, 0.0);
    for (pair, b) in step.pairs.iter().zip(&basis) {
        let b = b.this - fitted.apply(b.previous);
        let e = pair.this - step.motion.apply(pair.previous);
        be += b.dot(&e);
        bb += b.norm_squared();
        ee += e.norm_squared();
    }
    // The weight is relative to the residual: frames with much parallax get no more than calm ones.
    (bb > 0.0 && ee > 0.0).then(|| (be / bb, bb / (ee / step.pairs.len() as f64)))
}

/// Velocity field, px per frame, at the frame between the second and the third of four motions, by the central difference of
/// fourth order: that of second order attenuates a 7 Hz shake at 30 frames/s by a third, which would bias the readout upwards.
fn velocity(motions: &[Similarity2]) -> impl Fn(Point2) -> Vec2 + '_ {
    let back = motions[1].inverse().unwrap_or(Similarity2::IDENTITY);
    move |p| {
        let step = |k: usize| motions[k].apply(p) - p;
        let near = (p - back.apply(p)) + step(2);
        (near * 7.0 - step(0) - step(3)) / 12.0
    }
}

/// Maps the points of one frame to their positions at the time of its center row.
#[derive(Clone, Debug, PartialEq)]
pub struct RowMotion {
    /// Maps from this frame to those two before, one before, one after and two after.
    others_from_this: [Homography; 4],
    readout: f64,
    height: f64,
}

impl RowMotion {
    /// From the inter-frame motions around frame `k`, each from its previous frame: those to `k−1`, `k`, `k+1` and `k+2`; the
    /// readout in frame periods. `None` where a motion has no inverse.
    pub fn new(steps: [Homography; 4], readout: f64, height: u32) -> Option<Self> {
        let before = steps[1].inverse()?;
        let others_from_this = [steps[0].inverse()? * before, before, steps[2], steps[3] * steps[2]];
        Some(Self { others_from_this, readout, height: f64::from(height) })
    }

    /// Displacement, px, from the observed position of a point to that at the time of the center row.
    pub fn displacement(&self, p: Point2) -> Vec2 {
        let tau = (p.y / self.height - 0.5) * self.readout;
        let mut moved = Vec2::zeros();
        for (map, weight) in self.others_from_this.iter().zip(lagrange(tau)) {
            match map.apply(p) {
                Some(q) => moved += (q - p) * weight,
                None => return Vec2::zeros(),
            }
        }
        -moved
    }

    /// Position at the time of the center row of the point observed at `p`.
    pub fn center_time(&self, p: Point2) -> Point2 {
        p + self.displacement(p)
    }
}

/// Weights of the positions at −2, −1, 1 and 2 in the quartic through them and 0, at `t`.
fn lagrange(t: f64) -> [f64; 4] {
    let (one, two) = (t * t - 1.0, t * t - 4.0);
    [t * one * (t - 2.0) / 24.0, -t * two * (t - 1.0) / 6.0, -t * two * (t + 1.0) / 6.0, t * one * (t + 2.0) / 24.0]
}

impl ClipMotion {
    /// The row motion of frame `frame`; `None` without a readout, outside the clip, or where neither neighboring motion is known.
    /// Motions that were not measured are replaced by the nearest measured one.
    pub fn row_motion(&self, frame: usize) -> Option<RowMotion> {
        let readout = self.readout_in_frames();
        if readout == 0.0 || frame >= self.frames.len() {
            return None;
        }
        let known = |k: usize| {
            let frame = self.frames.get(k)?;
            matches!(frame.quality, MotionQuality::Measured | MotionQuality::Bridged).then_some(frame.homography)
        };
        let (arriving, leaving) = (known(frame), known(frame + 1));
        let (arriving, leaving) = (arriving.or(leaving)?, leaving.or(arriving)?);
        // An unknown motion marks another shot or a gap.
        let earlier = known(frame).and(frame.checked_sub(1)).and_then(known).unwrap_or(arriving);
        let later = known(frame + 1).and(known(frame + 2)).unwrap_or(leaving);
        RowMotion::new([earlier, arriving, leaving, later], readout, self.height)
    }
}
