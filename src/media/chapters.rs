//! Chapters of a trimmed clip.

use super::Input;
use super::av::{Chapter, Demuxer, Rational};

/// The source's chapters on the result's clock: shifted by the start, clipped to the span, without those outside.
pub(super) fn trimmed(demuxer: &Demuxer, source: &Input) -> Vec<Chapter> {
    let (start, end) = source.span_us(demuxer);
    demuxer.chapters().into_iter().filter_map(|c| cut(c, start.unwrap_or(0), end)).collect()
}

fn cut(chapter: Chapter, start_us: i64, end_us: Option<i64>) -> Option<Chapter> {
    let base = chapter.time_base;
    let start = Rational::MICRO.rescale(start_us, base);
    let end = end_us.map_or(i64::MAX, |e| Rational::MICRO.rescale(e, base));
    let (from, to) = (chapter.start.max(start), chapter.end.min(end));
    let inside = if start_us == 0 { to >= from } else { to > from };
    inside.then(|| Chapter { start: from - start, end: to - start, ..chapter })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chapters_are_moved_and_cut_with_the_span() {
        let chapter =
            |start, end| Chapter { id: 1, time_base: Rational { num: 1, den: 1000 }, start, end, metadata: Vec::new() };
        let spans = |c: Option<Chapter>| c.map(|c| (c.start, c.end));
        assert_eq!(spans(cut(chapter(0, 4000), 0, None)), Some((0, 4000)));
        assert_eq!(spans(cut(chapter(1000, 4000), 2_000_000, Some(3_000_000))), Some((0, 1000)));
        assert_eq!(spans(cut(chapter(0, 1000), 2_000_000, None)), None);
        assert_eq!(spans(cut(chapter(3000, 4000), 0, Some(3_000_000))), Some((3000, 3000)));
    }
}
