//! Reading some frames of a clip, which must have the times that are known of them.

use super::VideoReader;
use crate::{FrameSpan, Input, MediaError, ReadOptions};

impl VideoReader {
    /// Opens the clip at some of its frames, which are the only ones that are read: from the last key frame before the first of them,
    /// where the container can go there and its times are exact, else from the start of the clip.
    ///
    /// # Errors
    /// As of [`Self::open`]; [`MediaError::Input`] where no frame has the time of the first. Reading ends with the same error where
    /// their number or the time of the last is another, and where they had to be deinterlaced, which depends on the frame before.
    pub fn open_span(input: &Input, options: &ReadOptions, span: &FrameSpan) -> Result<Self, MediaError> {
        let begins = |reader: &Self| reader.ready.front().is_some_and(|frame| frame.pts.0 == span.start);
        match Self::open_frames(input, options, Some(span), true) {
            Ok(reader) if begins(&reader) => return Ok(reader),
            Err(stopped @ MediaError::Interrupted(_)) => return Err(stopped),
            // Not every index is right, and not every frame after a key frame can be decoded without those before.
            _ => {}
        }
        let reader = Self::open_frames(input, options, Some(span), false)?;
        if begins(&reader) { Ok(reader) } else { Err(reader.differs_from(span)) }
    }

    /// The next frame has damage, or is missing, which may be for want of the frames before the key frame: open groups of pictures at the
    /// end of a clip lose their last frames.
    pub(super) fn is_doubtful(&self) -> bool {
        let missing = || self.expected.as_ref().is_some_and(|span| self.check_span(span).is_err());
        self.ready.front().map_or_else(missing, |frame| frame.corrupt)
    }

    /// Goes on with the next frame, read from the start of the clip.
    pub(super) fn read_from_start(&mut self) -> Result<(), MediaError> {
        let Some(span) = self.expected.clone() else { return Ok(()) };
        let next = self.delivered.map_or(span.start, |(_, last)| last.saturating_add(1));
        let rest = FrameSpan { start: next, ..span.clone() };
        let again = Self::open_frames(&self.source, &self.options, Some(&rest), false);
        let mut again =
            again.map_err(|e| if matches!(e, MediaError::Interrupted(_)) { e } else { self.differs_from(&span) })?;
        again.report.frames += self.report.frames;
        again.info = self.info.clone();
        (again.expected, again.delivered) = (Some(span), self.delivered);
        *self = again;
        Ok(())
    }

    /// Refuses frames other than those expected.
    pub(super) fn check_span(&self, span: &FrameSpan) -> Result<(), MediaError> {
        let (first, last) = self.delivered.unwrap_or((i64::MIN, i64::MIN));
        if self.report.deinterlaced > 0 {
            let problem = "has interlaced frames, which cannot be read from the middle; work on the clip as a whole";
            return Err(MediaError::input(&self.name, problem.to_owned()));
        }
        if span.is_of(self.report.frames, first, last) { Ok(()) } else { Err(self.differs_from(span)) }
    }

    fn differs_from(&self, span: &FrameSpan) -> MediaError {
        let found = match self.delivered {
            Some((first, last)) => format!("{} frames from {first} to {last}", self.report.frames),
            None => self.ready.front().map_or("none".to_owned(), |frame| format!("one at {}", frame.pts.0)),
        };
        let (frames, start, last) = (&span.frames, span.start, span.last);
        let expected =
            format!("frames {} to {} from {start} to {last} ticks", frames.start, frames.end.saturating_sub(1));
        let help = "its packets have other times than its frames: work on the clip as a whole";
        MediaError::input(&self.name, format!("expected {expected}, found {found}; {help}"))
    }
}
