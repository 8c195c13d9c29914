//! Values at times, and the curve between them.

use nalgebra::SVector;

use super::ClipError;

/// How values between keys are found.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Between<const N: usize> {
    /// The last key's.
    Step,
    /// On the shortest way, at a constant rate.
    #[default]
    Linear,
    /// Through the keys with one velocity on both sides of each.
    Smooth,
    /// Cubic Hermite: velocities, per second, with which the curve comes to each key and leaves it.
    Cubic {
        /// Before each key.
        arriving: Vec<[f64; N]>,
        /// After each key.
        leaving: Vec<[f64; N]>,
    },
}

/// `N` numbers over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Keys<const N: usize> {
    pub(super) times: Vec<f64>,
    pub(super) values: Vec<[f64; N]>,
    pub(super) between: Between<N>,
}

impl<const N: usize> Keys<N> {
    /// Values at times in seconds.
    ///
    /// # Errors
    /// [`ClipError`]: `Keys`, `Order`, `Value`.
    pub fn new(times: Vec<f64>, values: Vec<[f64; N]>, between: Between<N>) -> Result<Self, ClipError> {
        let miscounted = |count: usize| ClipError::Keys { times: times.len(), values: count };
        if times.is_empty() || times.len() != values.len() {
            return Err(miscounted(values.len()));
        }
        let mut rows: Vec<&Vec<[f64; N]>> = vec![&values];
        if let Between::Cubic { arriving, leaving } = &between {
            rows.extend([arriving, leaving]);
        }
        if let Some(row) = rows.iter().find(|row| row.len() != times.len()) {
            return Err(miscounted(row.len()));
        }
        // NaN fails the comparison.
        let mut before = f64::NEG_INFINITY;
        for (key, &time) in times.iter().enumerate() {
            if !(time > before && time < f64::INFINITY) {
                return Err(ClipError::Order { key, time, before });
            }
            before = time;
        }
        for row in rows {
            if let Some(key) = row.iter().position(|value| !value.iter().all(|x| x.is_finite())) {
                return Err(ClipError::Value { key, what: "not finite" });
            }
        }
        Ok(Self { times, values, between })
    }

    /// One value for all times.
    ///
    /// # Errors
    /// [`ClipError::Value`].
    pub fn constant(value: [f64; N]) -> Result<Self, ClipError> {
        Self::new(vec![0.0], vec![value], Between::Step)
    }

    /// Times of the keys, s, ascending; at least one.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Values at the keys.
    pub fn values(&self) -> &[[f64; N]] {
        &self.values
    }

    /// How values between them are found.
    pub fn between(&self) -> &Between<N> {
        &self.between
    }

    /// The key before a time, how far the time is toward the next (0 to 1), and how long the step is; the first and the last key
    /// hold beyond.
    pub(super) fn place(&self, time: f64) -> (usize, f64, f64) {
        let after = self.times.partition_point(|&t| t <= time);
        if after == 0 || after == self.times.len() {
            return (after.saturating_sub(1), 0.0, 0.0);
        }
        let (from, to) = (self.times[after - 1], self.times[after]);
        (after - 1, (time - from) / (to - from), to - from)
    }

    /// The value at a time.
    pub fn at(&self, time: f64) -> [f64; N] {
        let (k, u, step) = self.place(time);
        if u == 0.0 {
            return self.values[k];
        }
        let value = |k: usize| SVector::<f64, N>::from(self.values[k]);
        let (a, b) = (value(k), value(k + 1));
        match &self.between {
            Between::Step => self.values[k],
            Between::Linear => (a + (b - a) * u).into(),
            Between::Smooth => hermite([a, b], [self.velocity(k), self.velocity(k + 1)], u, step).into(),
            Between::Cubic { arriving, leaving } => {
                hermite([a, b], [leaving[k].into(), arriving[k + 1].into()], u, step).into()
            }
        }
    }

    /// Velocity of the smooth curve at a key.
    fn velocity(&self, k: usize) -> SVector<f64, N> {
        let rate = |k: usize| {
            let rise = SVector::<f64, N>::from(self.values[k + 1]) - SVector::from(self.values[k]);
            rise / (self.times[k + 1] - self.times[k])
        };
        joined_rate(&self.times, k, rate)
    }
}

/// The velocity at key `k`, of the rates of the steps on both sides of it.
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

/// The cubic with these ends and velocities there, `u` of a step of `step` seconds along.
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
