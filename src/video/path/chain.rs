//! The camera's motion through one shot, prepared for smoothing: centered, in frame units, gaps bridged; and its shake.

use std::ops::Range;

use super::lowpass::{half_kernel, lowpass};
use super::pose::{C64, FrameUnits, Pose};
use super::{Clip, InterFrame};

/// Gaps of up to this many unreliable steps are bridged by interpolation; camera motion is smooth over a third of a
/// second, and over more than that a guess is worse than no motion at all.
const MAX_BRIDGE: usize = 10;

/// Time constant (s) that divides shake from intended motion: hand tremor and steps are above 1 Hz, where a Gaussian of
/// 0.5 s keeps less than 1 %; pans last seconds.
const SHAKE_SIGMA_S: f64 = 0.5;

/// Extent (s) over which the local strength of shake is averaged: long against a step, short against a change of
/// activity (standing, walking, running).
const STRENGTH_SIGMA_S: f64 = 4.0;

/// Extent (s) over which speeds are averaged: long against a frame, short against a pan.
const SPEED_SIGMA_S: f64 = 1.0;

/// Motion of one shot of `n` frames. Entry 0 of `step` and `rate` is unused (identity, 1).
#[derive(Debug)]
pub(super) struct Chain {
    /// `this_from_previous`.
    pub(super) step: Vec<Pose>,
    /// Mean frame interval over this frame's: converts steps to velocities per mean frame, for variable frame rates.
    pub(super) rate: Vec<f64>,
    /// Frames per second, mean over the shot.
    pub(super) fps: f64,
}

impl Chain {
    pub(super) fn of_shot(clip: &Clip<'_>, units: &FrameUnits, shot: Range<usize>) -> Self {
        let (rate, fps) = rates(&clip.times_s[shot.clone()]);
        Self { step: bridged(&clip.motion[shot], units, &rate), rate, fps }
    }

    pub(super) fn len(&self) -> usize {
        self.step.len()
    }

    /// The motion from the first frame to every frame.
    pub(super) fn motion_from_first(&self) -> Vec<Pose> {
        self.step.iter().scan(Pose::IDENTITY, |at, s| (*at = s.after(*at), Some(*at)).1).collect()
    }

    /// Time constant of `seconds` in frames.
    pub(super) fn frames(&self, seconds: f64) -> f64 {
        seconds * self.fps
    }

    /// The motion that a virtual camera shows: `out_t ← out_{t−1}`.
    pub(super) fn seen_through(&self, path: &[Pose]) -> Self {
        let step = (0..self.len())
            .map(|t| match t {
                0 => Pose::IDENTITY,
                _ => path[t].inverse().after(self.step[t]).after(path[t - 1]),
            })
            .collect();
        Self { step, rate: self.rate.clone(), fps: self.fps }
    }

    /// Squared deviation of the frame's content from its low-passed path, per frame: the mean over the frame's area of
    /// the squared displacement, in frame units². The area's radius of gyration is `1/√3` in these units.
    pub(super) fn shake(&self) -> Vec<f64> {
        let sigma = self.frames(SHAKE_SIGMA_S);
        let high = |of: fn(&Pose) -> f64| {
            let path: Vec<f64> = self.step.iter().scan(0.0, |sum, s| (*sum += of(s), Some(*sum)).1).collect();
            let low = lowpass(&path, sigma);
            path.into_iter().zip(low).map(|(p, l)| (p - l).powi(2)).collect::<Vec<f64>>()
        };
        let (x, y) = (high(|s| s.d.re), high(|s| s.d.im));
        let (angle, zoom) = (high(|s| s.z.arg()), high(|s| s.z.norm().ln()));
        (0..self.len()).map(|t| x[t] + y[t] + (angle[t] + zoom[t]) / 3.0).collect()
    }

    /// RMS speed over the frame's area, frame units per second, averaged over a second.
    pub(super) fn speed(&self) -> Vec<f64> {
        let squared = |step: &Pose| step.d.norm_sqr() + step.z.ln().norm_sqr() / 3.0;
        let speeds: Vec<f64> =
            self.step.iter().zip(&self.rate).map(|(step, rate)| squared(step).sqrt() * rate * self.fps).collect();
        spread(&speeds, self.frames(SPEED_SIGMA_S))
    }

    /// Shake energy around each frame, averaged over seconds; never negative.
    pub(super) fn shake_strength(&self) -> Vec<f64> {
        spread(&self.shake(), self.frames(STRENGTH_SIGMA_S))
    }
}

/// Gaussian mean that reflects at the ends, so that a non-negative signal stays so and its sum is kept.
pub(super) fn spread(x: &[f64], sigma: f64) -> Vec<f64> {
    let (n, kernel) = (x.len(), half_kernel(sigma.max(0.3)));
    // Sample i of the signal …, x₁, x₀ | x₀, x₁, …, xₙ₋₁ | xₙ₋₁, …, whose period is 2n; `i` counts from one period before.
    let periods = kernel.len() / (2 * n) + 1;
    let mirrored = |i: usize| {
        let k = i % (2 * n);
        x[if k < n { k } else { 2 * n - 1 - k }]
    };
    (0..n)
        .map(|i| {
            let i = i + 2 * n * periods;
            let sides = kernel.iter().enumerate().skip(1);
            kernel[0] * mirrored(i) + sides.map(|(k, w)| w * (mirrored(i - k) + mirrored(i + k))).sum::<f64>()
        })
        .collect()
}

/// Velocity factors and the mean frame rate. A step of no or negative duration counts as a mean one.
fn rates(times_s: &[f64]) -> (Vec<f64>, f64) {
    let steps: Vec<f64> = times_s.windows(2).map(|w| w[1] - w[0]).filter(|dt| *dt > 0.0 && dt.is_finite()).collect();
    if steps.is_empty() {
        return (vec![1.0; times_s.len()], 30.0);
    }
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    // Timestamps are rounded to ticks, sometimes to milliseconds (3 % of a frame at 30 fps): equal intervals must not look
    // uneven for that. Beyond a factor of ten a timestamp is wrong rather than the rate.
    let rate = |dt: f64| if dt > 0.0 && (dt / mean - 1.0).abs() > 0.1 { (mean / dt).clamp(0.1, 10.0) } else { 1.0 };
    let rates = std::iter::once(1.0).chain(times_s.windows(2).map(|w| rate(w[1] - w[0]))).collect();
    (rates, 1.0 / mean)
}

/// Steps as poses; velocities of short unreliable runs interpolated between their neighbors, of long ones zero.
fn bridged(motion: &[InterFrame], units: &FrameUnits, rate: &[f64]) -> Vec<Pose> {
    let known: Vec<Option<Pose>> = motion
        .iter()
        .enumerate()
        .map(|(t, m)| (t > 0 && m.reliable).then(|| units.pose(m.similarity)).filter(Pose::is_finite))
        .collect();
    let velocity = |t: usize| known[t].map(|p| (p.z.ln() * rate[t], p.d * rate[t]));
    let zero = (C64::new(0.0, 0.0), C64::new(0.0, 0.0));
    let mut steps = vec![Pose::IDENTITY; motion.len()];
    let mut t = 1;
    while t < motion.len() {
        if let Some(p) = known[t] {
            steps[t] = p;
            t += 1;
            continue;
        }
        let end = (t..motion.len()).find(|&k| known[k].is_some()).unwrap_or(motion.len());
        let after = (end < motion.len()).then(|| velocity(end)).flatten();
        let before = velocity(t - 1);
        let short = end - t <= MAX_BRIDGE;
        let (from, to) = if short { (before.or(after), after.or(before)) } else { (None, None) };
        let (from, to) = (from.unwrap_or(zero), to.unwrap_or(zero));
        for k in t..end {
            let fraction = (k + 1 - t) as f64 / (end + 1 - t) as f64;
            let mix = |a: C64, b: C64| (a + (b - a) * fraction) / rate[k];
            steps[k] = Pose { z: mix(from.0, to.0).exp(), d: mix(from.1, to.1) };
        }
        t = end;
    }
    steps
}
