//! Which pictures a damaged stream has lost.
//!
//! A packet that the decoder rejects yields no picture, and the clip would come out shorter than it went in. Every packet's
//! display time is therefore remembered until a picture with that time, or a later one, appears. A time that was passed
//! over counts as lost only where the decoder has complained: streams coded by fields have two times per picture.

use std::collections::BTreeSet;

/// Maximum number of pending times; a decoder reorders far fewer.
const MAX_PENDING: usize = 512;

/// Display times still expected, and complaints not yet explained by a missing picture.
#[derive(Debug, Default)]
pub(super) struct Losses {
    expected: BTreeSet<i64>,
    complaints: usize,
}

impl Losses {
    /// A packet with a picture for time `pts` went to the decoder.
    pub(super) fn sent(&mut self, pts: i64) {
        self.expected.insert(pts);
        while self.expected.len() > MAX_PENDING {
            self.expected.pop_first();
        }
    }

    /// The demuxer or the decoder rejected a packet.
    pub(super) fn complained(&mut self) {
        self.complaints += 1;
    }

    /// A picture for time `pts` came out: times before it that were lost, ascending.
    pub(super) fn passed_over(&mut self, pts: i64) -> Vec<i64> {
        let later = self.expected.split_off(&pts);
        let passed = std::mem::replace(&mut self.expected, later);
        self.expected.remove(&pts);
        let lost: Vec<i64> = passed.into_iter().take(self.complaints).collect();
        self.complaints -= lost.len();
        lost
    }

    /// The stream has ended: pictures that never came.
    pub(super) fn at_end(&self) -> usize {
        self.expected.len().min(self.complaints)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_passed_over_is_lost_only_after_a_complaint() {
        let mut losses = Losses::default();
        for t in [0, 3, 1, 2] {
            losses.sent(t);
        }
        assert_eq!(losses.passed_over(1), Vec::<i64>::new(), "field-coded streams have more times than pictures");
        losses.complained();
        assert_eq!(losses.passed_over(3), [2]);
        losses.sent(4);
        losses.complained();
        assert_eq!(losses.at_end(), 1);
    }
}
