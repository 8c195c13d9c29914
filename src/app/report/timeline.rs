//! Frames on the axis of time, alike for all plots of a page.

use std::ops::Range;

use super::axis::Axis;
use super::data::{Report, Segment};

/// Where frames lie from left to right, as shares of the width.
pub(super) struct Timeline<'a> {
    pub(super) times_s: &'a [f64],
    pub(super) shots: &'a [Range<usize>],
    pub(super) segments: &'a [Segment],
    pub(super) axis: Axis,
}

/// Ticks along the time: as many labels as a phone has room for.
const TICKS: usize = 6;

impl<'a> Timeline<'a> {
    pub(super) fn of(report: &'a Report) -> Self {
        let (first, last) = (report.times_s.first().copied(), report.times_s.last().copied());
        let axis = Axis::exact(first.unwrap_or(0.0), last.unwrap_or(0.0), TICKS);
        Self { times_s: &report.times_s, shots: &report.shots, segments: &report.segments, axis }
    }

    /// Where a frame lies.
    pub(super) fn at(&self, frame: usize) -> f64 {
        self.times_s.get(frame).map_or(1.0, |t| self.axis.share(*t))
    }

    /// Left end and width of a stretch of frames, which lasts until the next one begins.
    pub(super) fn span(&self, frames: &Range<usize>) -> (f64, f64) {
        let start = if frames.start == 0 { 0.0 } else { self.at(frames.start) };
        let end = if frames.end >= self.times_s.len() { 1.0 } else { self.at(frames.end) };
        (start, (end - start).max(0.0))
    }

    /// Frames and seconds of a stretch, in words.
    pub(super) fn words(&self, frames: &Range<usize>) -> (String, String) {
        let last = frames.end.saturating_sub(1).max(frames.start);
        let seconds = |frame: usize| self.times_s.get(frame).map_or_else(|| "–".to_owned(), |t| format!("{t:.1}"));
        (format!("{}–{last}", frames.start), format!("{}–{} s", seconds(frames.start), seconds(last)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_fill_the_width_without_gaps() {
        let report = Report { times_s: vec![0.0, 0.1, 0.4, 0.5], ..Report::default() };
        let line = Timeline::of(&report);
        let spans = [0..1, 1..3, 3..4].map(|r| line.span(&r));
        assert_eq!(spans[0].0, 0.0);
        assert!(spans.windows(2).all(|w| (w[0].0 + w[0].1 - w[1].0).abs() < 1e-12), "{spans:?}");
        assert!((spans[2].0 + spans[2].1 - 1.0).abs() < 1e-12);
        assert_eq!(line.words(&(1..3)), ("1–2".to_owned(), "0.1–0.4 s".to_owned()));
    }

    #[test]
    fn a_single_frame_takes_all_of_it() {
        let report = Report { times_s: vec![2.0], ..Report::default() };
        let line = Timeline::of(&report);
        assert_eq!((line.at(0), line.span(&(0..1))), (0.5, (0.0, 1.0)));
    }
}
