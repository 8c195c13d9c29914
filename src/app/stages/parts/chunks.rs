//! The chunks that the frames of a clip are divided into.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Most chunks of a clip: the cameras of each wait for those in front of it, which makes half a million lines of a plan.
pub(crate) const MAX_CHUNKS: usize = 999;

/// Chunks of a clip, equal to within a frame: the longest one decides when the clip is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub(crate) struct Chunks {
    /// Frames of the clip
    pub(crate) frames: usize,
    /// Number of chunks
    pub(crate) count: usize,
}

impl Default for Chunks {
    fn default() -> Self {
        Self { frames: 1, count: 1 }
    }
}

impl Chunks {
    /// `count` chunks of a clip, or as many as it has frames.
    pub(crate) fn new(frames: usize, count: usize) -> Self {
        Self { frames, count: count.min(frames).min(MAX_CHUNKS) }
    }

    /// The frames of a chunk; none of one beyond the last, which a plan of another machine may name.
    pub(crate) fn range(self, chunk: usize) -> Range<usize> {
        let start = |chunk: usize| part(chunk.min(self.count), self.count, self.frames);
        start(chunk)..start(chunk.saturating_add(1))
    }

    /// The frames of each chunk, in order.
    pub(crate) fn ranges(self) -> impl Iterator<Item = Range<usize>> {
        (0..self.count).map(move |chunk| self.range(chunk))
    }

    /// The chunks that have one of `frames`.
    pub(crate) fn overlapping(self, frames: &Range<usize>) -> Range<usize> {
        let with_frame = |frame: usize| {
            // Rounded down as the starts of chunks are: the estimate is the chunk or the one in front of it.
            let chunk = (frame as u128 * self.count as u128 / self.frames as u128) as usize;
            if self.range(chunk).end <= frame { chunk + 1 } else { chunk }
        };
        if frames.is_empty() || frames.start >= self.frames {
            return 0..0;
        }
        with_frame(frames.start)..with_frame(frames.end.min(self.frames) - 1) + 1
    }
}

/// Where part `from` of `of` equal ones begins in `total`.
fn part(from: usize, of: usize, total: usize) -> usize {
    (from as u128 * total as u128 / of as u128) as usize
}

impl<'de> Deserialize<'de> for Chunks {
    /// Plans come from other machines: names of files are made of the chunks before anything is opened.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Numbers {
            frames: usize,
            count: usize,
        }
        let Numbers { frames, count } = Numbers::deserialize(deserializer)?;
        if (1..=MAX_CHUNKS.min(frames)).contains(&count) {
            return Ok(Self { frames, count });
        }
        Err(serde::de::Error::custom(format!("{count} chunks of {frames} frames (expected 1 to {MAX_CHUNKS})")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_a_clip_and_are_found_by_their_frames() {
        for (frames, count) in [(1, 1), (7, 3), (100, 7), (100, 100), (6000, 11)] {
            let chunks = Chunks::new(frames, count);
            let ranges: Vec<Range<usize>> = chunks.ranges().collect();
            assert!(ranges[0].start == 0 && ranges[count - 1].end == frames);
            assert!(ranges.windows(2).all(|w| w[0].end == w[1].start));
            let lengths = || ranges.iter().map(ExactSizeIterator::len);
            assert!(lengths().min() >= Some(1) && lengths().max() <= lengths().min().map(|least| least + 1));
            for (chunk, range) in ranges.iter().enumerate() {
                assert_eq!(chunks.overlapping(range), chunk..chunk + 1);
                assert_eq!(chunks.overlapping(&(0..range.end)), 0..chunk + 1);
                assert_eq!(chunks.overlapping(&(range.start..frames + 9)), chunk..count);
            }
            assert!(chunks.range(count).is_empty() && chunks.range(usize::MAX).is_empty());
            assert!(chunks.overlapping(&(frames..frames + 1)).is_empty() && chunks.overlapping(&(0..0)).is_empty());
        }
    }

    #[test]
    fn chunks_that_no_clip_has_are_refused_when_they_are_read() {
        for (frames, count, valid) in
            [(9, 3, true), (9, 9, true), (9, 10, false), (9, 0, false), (0, 0, false), (9_000_000, 1_000_000, false)]
        {
            let text = format!(r#"{{"frames": {frames}, "count": {count}}}"#);
            assert_eq!(serde_json::from_str::<Chunks>(&text).is_ok(), valid, "{text}");
        }
    }
}
