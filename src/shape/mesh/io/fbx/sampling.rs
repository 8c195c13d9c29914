//! Sampling of animated values.
//!
//! The values between two keys of the file (Euler angles, cubic curves, pivots) are not those between two keys of a clip (linear,
//! spherical linear). Each interval between keys of the file is halved until the interpolation deviates at its quarters by no more than
//!
//! ```text
//! rotation            5 · 10⁻⁴ rad (0.03°)
//! translation, scale  10⁻⁴ of the range of the values
//! ```
//!
//! or has 2⁸ parts. A jump becomes a ramp of 2⁻¹² s (0.24 ms): less than a frame, and still more than the spacing of 32-bit times.

use super::curve::Side;

/// Largest angle between an interpolated rotation and the true one, rad. Ten times as much is seen at the end of a limb; a tenth of it
/// gives three times as many keys.
pub(super) const MAX_ANGLE: f64 = 5e-4;
/// Largest difference of other values, over their range.
pub(super) const MAX_DEVIATION: f64 = 1e-4;
/// Maximum number of times that an interval is halved.
const MAX_DEPTH: u32 = 8;
/// Duration of a jump, s; no more than half an interval.
const JUMP: f64 = 1.0 / 4096.0;
/// Angle of rotation, degrees, that an interval has before it is compared with an interpolation, which takes the shortest path.
const MAX_SWING: f64 = 90.0;
/// Maximum number of parts of an interval for that reason.
const MAX_PARTS: f64 = 4096.0;

/// Interpolation of two values.
pub(super) type Between<'a, const N: usize> = dyn Fn(&[f64; N], &[f64; N], f64) -> [f64; N] + 'a;

/// A value over time.
pub(super) struct Source<'a, const N: usize> {
    /// Times of the keys of the file: ascending, at least one.
    pub(super) keys: &'a [f64],
    pub(super) at: &'a dyn Fn(f64, Side) -> [f64; N],
    /// Interpolation of the clip, and the difference of two values.
    pub(super) between: &'a Between<'a, N>,
    pub(super) difference: &'a dyn Fn(&[f64; N], &[f64; N]) -> f64,
    pub(super) tolerance: f64,
    /// Degrees of rotation in an interval.
    pub(super) swing: &'a dyn Fn(f64, f64) -> f64,
    /// Whether the value is constant between keys.
    pub(super) stepped: bool,
}

/// Samples of a value.
#[derive(Debug, PartialEq)]
pub(super) struct Samples<const N: usize> {
    /// Ascending.
    pub(super) times: Vec<f64>,
    pub(super) values: Vec<[f64; N]>,
}

impl<const N: usize> Source<'_, N> {
    /// Samples at the keys and between them. `spend` counts samples beyond the keys, and ends refinement by `false`; the second result is
    /// whether it did.
    pub(super) fn samples(&self, spend: &dyn Fn(usize) -> bool) -> (Samples<N>, bool) {
        let mut samples = Samples { times: Vec::with_capacity(self.keys.len()), values: Vec::new() };
        let mut refused = false;
        let mut push = |time: f64, value: [f64; N]| {
            if samples.times.last().is_none_or(|&last| last < time) {
                samples.times.push(time);
                samples.values.push(value);
            }
        };
        for interval in self.keys.windows(2) {
            let (start, end) = (interval[0], interval[1]);
            push(start, (self.at)(start, Side::After));
            if self.stepped {
                continue;
            }
            // The end of the interval, before the value jumps.
            let (last, next) = ((self.at)(end, Side::Before), (self.at)(end, Side::After));
            let jumps = (self.difference)(&last, &next) > self.tolerance;
            let before = if jumps { end - JUMP.min(0.5 * (end - start)) } else { end };
            let parts = ((self.swing)(start, end) / MAX_SWING).ceil().clamp(1.0, MAX_PARTS) as usize;
            let parts = if parts == 1 || spend(parts) { parts } else { 1 };
            let time = |k: usize| start + (before - start) * (k as f64 / parts as f64);
            let at = |t: f64| if t >= before { (self.at)(t, Side::Before) } else { (self.at)(t, Side::After) };
            for part in 0..parts {
                // Halves that are still to be compared, the first on top.
                let mut open = vec![(time(part), time(part + 1), 0)];
                while let Some((a, b, depth)) = open.pop() {
                    let [from, to] = [at(a), at(b)];
                    let off = |u: f64| (self.difference)(&(self.between)(&from, &to, u), &at(a + (b - a) * u));
                    let middle = 0.5 * (a + b);
                    let halved = depth < MAX_DEPTH
                        && a < middle
                        && middle < b
                        && [0.25, 0.5, 0.75].into_iter().any(|u| off(u) > self.tolerance);
                    if halved && spend(1) {
                        open.push((middle, b, depth + 1));
                        open.push((a, middle, depth + 1));
                        continue;
                    }
                    refused |= halved;
                    if b < end {
                        push(b, to);
                    }
                }
            }
        }
        let end = self.keys[self.keys.len() - 1];
        push(end, (self.at)(end, Side::After));
        (samples, refused)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(keys: &[f64], stepped: bool, at: &dyn Fn(f64, Side) -> [f64; 1]) -> Samples<1> {
        let source = Source {
            keys,
            at,
            between: &|a, b, u| [a[0] * (1.0 - u) + b[0] * u],
            difference: &|a, b| (a[0] - b[0]).abs(),
            tolerance: 1e-3,
            swing: &|_, _| 0.0,
            stepped,
        };
        source.samples(&|_| true).0
    }

    fn at(samples: &Samples<1>, t: f64) -> f64 {
        let k = samples.times.partition_point(|&s| s <= t).clamp(1, samples.times.len() - 1);
        let (a, b) = (samples.times[k - 1], samples.times[k]);
        let u = (t - a) / (b - a);
        samples.values[k - 1][0] * (1.0 - u) + samples.values[k][0] * u
    }

    #[test]
    fn lines_get_no_samples_between_their_keys() {
        let samples = sampled(&[0.0, 1.0, 4.0], false, &|t, _| [2.0 * t]);
        assert_eq!(samples, Samples { times: vec![0.0, 1.0, 4.0], values: vec![[0.0], [2.0], [8.0]] });
    }

    #[test]
    fn curves_are_followed_to_the_tolerance() {
        let samples = sampled(&[0.0, 3.0], false, &|t, _| [t.sin()]);
        assert!(samples.times.len() < 80, "{}", samples.times.len());
        for t in (0..=300).map(|k| 0.01 * f64::from(k)) {
            assert!((at(&samples, t) - t.sin()).abs() < 1.3e-3, "{t}");
        }
    }

    #[test]
    fn jumps_become_short_ramps_and_steps_stay_steps() {
        let jump = |t: f64, side: Side| [if t > 1.0 || t == 1.0 && side == Side::After { 5.0 } else { t }];
        let samples = sampled(&[0.0, 1.0, 2.0], false, &jump);
        assert_eq!(samples.times, [0.0, 1.0 - JUMP, 1.0, 2.0]);
        assert_eq!((at(&samples, 0.5), at(&samples, 1.5)), (0.5, 5.0));
        let step = |t: f64, side: Side| [if t > 1.0 || t == 1.0 && side == Side::After { 5.0 } else { 0.0 }];
        assert_eq!(sampled(&[0.0, 1.0], true, &step).values, [[0.0], [5.0]]);
    }

    #[test]
    fn refinement_ends_where_no_more_samples_are_allowed() {
        let source = Source {
            keys: &[0.0, 1.0],
            at: &|t, _| [t * t],
            between: &|a, b, u| [a[0] * (1.0 - u) + b[0] * u],
            difference: &|a, b| (a[0] - b[0]).abs(),
            tolerance: 0.0,
            swing: &|_, _| 0.0,
            stepped: false,
        };
        let (samples, refused) = source.samples(&|_| false);
        assert_eq!((samples.times, refused), (vec![0.0, 1.0], true));
    }
}
