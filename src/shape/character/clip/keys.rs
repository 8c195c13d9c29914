//! Keyframes and their interpolation.

use std::sync::Arc;

use nalgebra::SVector;

use crate::character::CharacterError;

/// Interpolation between keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Interpolation<const N: usize> {
    /// Constant: the value of the key before.
    Step,
    /// Linear; of rotations the shortest great circle at constant rate (slerp).
    #[default]
    Linear,
    /// A C¹ cubic through the keys, with velocities from finite differences.
    Smooth,
    /// Cubic Hermite with given tangents, per second.
    Cubic {
        /// Incoming tangent of each key.
        arriving: Vec<[f64; N]>,
        /// Outgoing tangent of each key.
        leaving: Vec<[f64; N]>,
    },
}

/// Keyframes of an `N`-dimensional value.
#[derive(Clone, Debug, PartialEq)]
pub struct Keys<const N: usize> {
    /// Shared: the channels of a recorded motion have all the same times.
    pub(super) times: Arc<[f64]>,
    /// Shared by clones: a recorded motion is the largest part of a character, and characters are made from others.
    pub(super) values: Arc<Vec<[f64; N]>>,
    pub(super) interpolation: Interpolation<N>,
}

impl<const N: usize> Keys<N> {
    /// Keyframes at times in seconds. Curves with the same times share them where they are given as an `Arc`.
    ///
    /// # Errors
    /// [`CharacterError::Input`]: a count that differs, times that do not ascend, a value that is not finite.
    pub fn new(
        times: impl Into<Arc<[f64]>>,
        values: Vec<[f64; N]>,
        interpolation: Interpolation<N>,
    ) -> Result<Self, CharacterError> {
        let times = times.into();
        let miscounted = |count: usize| {
            let counts = format!("{} key times and {count} values", times.len());
            CharacterError::Input(format!("{counts}: give at least one key, and one value for each"))
        };
        if times.is_empty() || times.len() != values.len() {
            return Err(miscounted(values.len()));
        }
        let mut rows: Vec<&Vec<[f64; N]>> = vec![&values];
        if let Interpolation::Cubic { arriving, leaving } = &interpolation {
            rows.extend([arriving, leaving]);
        }
        if let Some(row) = rows.iter().find(|row| row.len() != times.len()) {
            return Err(miscounted(row.len()));
        }
        // The negated comparison also rejects NaN.
        let mut before = f64::NEG_INFINITY;
        for (key, &time) in times.iter().enumerate() {
            if !(time > before && time < f64::INFINITY) {
                let expected = "times of keys must be finite and ascend";
                let fault = format!("key {key} is at {time} s, after one at {before} s; {expected}");
                return Err(CharacterError::Input(fault));
            }
            before = time;
        }
        for row in rows {
            if let Some(key) = row.iter().position(|value| !value.iter().all(|x| x.is_finite())) {
                return Err(CharacterError::Input(format!("the value of key {key} is not finite")));
            }
        }
        Ok(Self { times, values: Arc::new(values), interpolation })
    }

    /// Key times, s, strictly increasing; at least one.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Key values.
    pub fn values(&self) -> &[[f64; N]] {
        &self.values
    }

    /// Interpolation between the keys.
    pub fn interpolation(&self) -> &Interpolation<N> {
        &self.interpolation
    }

    /// The key before a time, the normalized parameter toward the next key (0 to 1), and the interval length, s. Before the first and
    /// after the last key the parameter is 0.
    pub(super) fn interval(&self, time: f64) -> (usize, f64, f64) {
        let after = self.times.partition_point(|&t| t <= time);
        if after == 0 || after == self.times.len() {
            return (after.saturating_sub(1), 0.0, 0.0);
        }
        let (from, to) = (self.times[after - 1], self.times[after]);
        (after - 1, (time - from) / (to - from), to - from)
    }

    /// The value at a time.
    pub fn at(&self, time: f64) -> [f64; N] {
        let (k, u, step) = self.interval(time);
        if u == 0.0 {
            return self.values[k];
        }
        let value = |k: usize| SVector::<f64, N>::from(self.values[k]);
        let (a, b) = (value(k), value(k + 1));
        match &self.interpolation {
            Interpolation::Step => self.values[k],
            Interpolation::Linear => (a + (b - a) * u).into(),
            Interpolation::Smooth => hermite([a, b], [self.velocity(k), self.velocity(k + 1)], u, step).into(),
            Interpolation::Cubic { arriving, leaving } => {
                hermite([a, b], [leaving[k].into(), arriving[k + 1].into()], u, step).into()
            }
        }
    }

    /// Velocity of the smooth curve at a key, per second.
    fn velocity(&self, k: usize) -> SVector<f64, N> {
        let rate = |k: usize| {
            let rise = SVector::<f64, N>::from(self.values[k + 1]) - SVector::from(self.values[k]);
            rise / (self.times[k + 1] - self.times[k])
        };
        joined_rate(&self.times, k, rate)
    }
}

/// Velocity at key `k` from the slopes of the two adjacent intervals: the derivative of the parabola through three keys.
pub(super) fn joined_rate<const N: usize>(
    times: &[f64],
    k: usize,
    rate: impl Fn(usize) -> SVector<f64, N>,
) -> SVector<f64, N> {
    let last = times.len() - 1;
    match k {
        _ if last == 0 => SVector::zeros(),
        0 => rate(0),
        k if k == last => rate(last - 1),
        k => {
            let (before, after) = (times[k] - times[k - 1], times[k + 1] - times[k]);
            (rate(k - 1) * after + rate(k) * before) / (before + after)
        }
    }
}

/// Cubic Hermite polynomial with end values `a`, `b` and end velocities `v`, `w`, at the parameter `u` of an interval of `step` seconds.
pub(super) fn hermite<const N: usize>(
    [a, b]: [SVector<f64, N>; 2],
    [v, w]: [SVector<f64, N>; 2],
    u: f64,
    step: f64,
) -> SVector<f64, N> {
    let (u2, u3) = (u * u, u * u * u);
    a * (2.0 * u3 - 3.0 * u2 + 1.0)
        + v * (step * (u3 - 2.0 * u2 + u))
        + b * (3.0 * u2 - 2.0 * u3)
        + w * (step * (u3 - u2))
}
