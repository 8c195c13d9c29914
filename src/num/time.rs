//! Exact media time: integer ticks of a rational time base, never `f64` seconds.

/// Ticks of a [`Timebase`]; may be negative (encoder priming, edit lists).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Timestamp(pub i64);

/// Position of a frame in decoding-for-display order, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameIndex(pub u64);

/// Length of one tick, `num/den` seconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Timebase {
    /// Numerator, > 0.
    pub num: i32,
    /// Denominator, > 0.
    pub den: i32,
}

impl Timebase {
    /// Seconds from tick 0 to `t`, for display and for filters whose support is given in seconds.
    pub fn seconds(self, t: Timestamp) -> f64 {
        t.0 as f64 * f64::from(self.num) / f64::from(self.den)
    }

    /// The tick nearest to `seconds`; `None` where it does not fit.
    pub fn nearest(self, seconds: f64) -> Option<Timestamp> {
        let ticks = (seconds * f64::from(self.den) / f64::from(self.num)).round();
        (ticks.abs() < 2f64.powi(62)).then_some(Timestamp(ticks as i64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_and_ticks_are_inverse() {
        let base = Timebase { num: 1001, den: 30_000 };
        for tick in [-5, 0, 1, 107_892] {
            assert_eq!(base.nearest(base.seconds(Timestamp(tick))), Some(Timestamp(tick)));
        }
        assert_eq!(base.nearest(f64::NAN), None);
    }
}
