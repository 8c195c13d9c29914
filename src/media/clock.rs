//! Strictly increasing frame times where a container gives none, or gives them twice.

/// Keeps the times of a clip's frames increasing.
#[derive(Debug)]
pub(super) struct Clock {
    mean: i64,
    last: Option<(i64, i64)>,
}

impl Clock {
    /// A clock for frames that are `mean ≥ 1` ticks apart on average.
    pub(super) fn new(mean: i64) -> Self {
        Self { mean, last: None }
    }

    /// The time of the next frame, and whether it had to be made up. A frame without a time follows its predecessor by
    /// that one's duration; one that does not come later than it follows by one tick, so that later times still fit.
    pub(super) fn tick(&mut self, pts: Option<i64>, duration: i64) -> (i64, bool) {
        let step = if duration > 0 { duration } else { self.mean };
        let (time, made_up) = match (pts, self.last) {
            (Some(t), None) => (t, false),
            (None, None) => (0, true),
            (Some(t), Some((last, _))) if t > last => (t, false),
            (Some(_), Some((last, _))) => (last + 1, true),
            (None, Some((last, step))) => (last + step, true),
        };
        self.last = Some((time, step));
        (time, made_up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_that_increase_are_left_alone() {
        let mut clock = Clock::new(40);
        for t in [-80, -40, 3, 4, 1000] {
            assert_eq!(clock.tick(Some(t), 0), (t, false));
        }
    }

    #[test]
    fn missing_and_repeated_times_are_made_up_and_reported() {
        let mut clock = Clock::new(40);
        assert_eq!(clock.tick(None, 0), (0, true));
        assert_eq!(clock.tick(None, 25), (40, true));
        assert_eq!(clock.tick(None, 0), (65, true));
        assert_eq!(clock.tick(Some(60), 0), (66, true));
        assert_eq!(clock.tick(Some(120), 0), (120, false));
    }
}
