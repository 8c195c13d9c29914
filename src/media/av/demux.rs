//! Reading packets from a container.

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::dict::{c_string, pairs, string};
use super::error::check;
use super::packet::some_ts;
use super::{AvError, Dictionary, Packet, Rational, StreamRef};

/// An open input container.
pub(crate) struct Demuxer(NonNull<ffi::AVFormatContext>);

// SAFETY: one owner; libavformat contexts may move between threads as long as one at a time uses them.
unsafe impl Send for Demuxer {}

/// A named span of the clip.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chapter {
    pub(crate) id: i64,
    pub(crate) time_base: Rational,
    pub(crate) start: i64,
    pub(crate) end: i64,
    pub(crate) metadata: Vec<(String, String)>,
}

impl Demuxer {
    /// Opens `url`, with `format` forced where given, and reads enough to know every stream.
    pub(crate) fn open(url: &str, format: Option<&str>, mut options: Dictionary) -> Result<Self, AvError> {
        super::log::install();
        let url = c_string(url);
        let format = format.map(c_string);
        let mut raw = ptr::null_mut();
        // SAFETY: all strings end with zero and outlive the calls; `raw` receives a context that `Self` then owns. On
        // failure FFmpeg frees and clears it.
        unsafe {
            let forced = format.as_ref().map_or(ptr::null(), |f| ffi::av_find_input_format(f.as_ptr()));
            check(ffi::avformat_open_input(&raw mut raw, url.as_ptr(), forced, options.as_mut_ptr()))?;
            let this = Self(NonNull::new(raw).ok_or(AvError::NO_MEMORY)?);
            check(ffi::avformat_find_stream_info(raw, ptr::null_mut()))?;
            Ok(this)
        }
    }

    fn get(&self) -> &ffi::AVFormatContext {
        // SAFETY: opened in `open`, closed only in `drop`.
        unsafe { self.0.as_ref() }
    }

    pub(crate) fn stream_count(&self) -> usize {
        self.get().nb_streams as usize
    }

    /// Stream `i`, `i < stream_count()`.
    pub(crate) fn stream(&self, i: usize) -> StreamRef<'_> {
        assert!(i < self.stream_count(), "stream {i} of {}", self.stream_count());
        // SAFETY: the array holds `nb_streams` live streams, borrowed for as long as `self`.
        StreamRef(unsafe { &**self.get().streams.add(i) })
    }

    pub(crate) fn streams(&self) -> impl Iterator<Item = StreamRef<'_>> {
        (0..self.stream_count()).map(|i| self.stream(i))
    }

    /// The video stream that FFmpeg finds most worth showing; attached pictures are never chosen.
    pub(crate) fn best_video(&self) -> Option<usize> {
        let video = |i: &usize| self.stream(*i).kind() == super::Kind::Video && !self.stream(*i).is_attached_picture();
        let kind = ffi::AVMediaType::AVMEDIA_TYPE_VIDEO;
        // SAFETY: a live context; no decoder is asked for.
        let best = unsafe { ffi::av_find_best_stream(self.0.as_ptr(), kind, -1, -1, ptr::null_mut(), 0) };
        usize::try_from(best).ok().filter(video).or_else(|| (0..self.stream_count()).find(video))
    }

    /// Skips the packets of stream `i` while reading.
    pub(crate) fn discard(&mut self, i: usize) {
        assert!(i < self.stream_count(), "stream {i} of {}", self.stream_count());
        // SAFETY: in range; `&mut self` excludes readers.
        unsafe { (**self.0.as_ref().streams.add(i)).discard = ffi::AVDiscard::AVDISCARD_ALL };
    }

    /// The next packet; `Ok(false)` at the end. Other errors are returned: the caller may go on reading after them.
    pub(crate) fn read(&mut self, packet: &mut Packet) -> Result<bool, AvError> {
        packet.clear();
        // SAFETY: a live context and a blank packet.
        match check(unsafe { ffi::av_read_frame(self.0.as_ptr(), packet.as_mut_ptr()) }) {
            Ok(_) => Ok(true),
            Err(AvError::EOF) => Ok(false),
            Err(e) => Err(e),
        }
    }

    /// Goes to the last key frame of `stream` at or before `ts`.
    pub(crate) fn seek(&mut self, stream: usize, ts: i64) -> Result<(), AvError> {
        // SAFETY: a live context.
        let code = unsafe { ffi::av_seek_frame(self.0.as_ptr(), stream as i32, ts, ffi::AVSEEK_FLAG_BACKWARD) };
        check(code).map(|_| ())
    }

    /// Short names of the container, separated by commas.
    pub(crate) fn format_name(&self) -> String {
        // SAFETY: an open input has a format with a static name.
        unsafe { string((*self.get().iformat).name) }
    }

    pub(crate) fn format_long_name(&self) -> String {
        // SAFETY: as above.
        unsafe { string((*self.get().iformat).long_name) }
    }

    /// First presentation time of the file, µs.
    pub(crate) fn start_us(&self) -> Option<i64> {
        some_ts(self.get().start_time)
    }

    /// Length of the file, µs.
    pub(crate) fn duration_us(&self) -> Option<i64> {
        some_ts(self.get().duration).filter(|d| *d > 0)
    }

    pub(crate) fn bit_rate(&self) -> Option<u64> {
        u64::try_from(self.get().bit_rate).ok().filter(|r| *r > 0)
    }

    pub(crate) fn metadata(&self) -> Vec<(String, String)> {
        // SAFETY: the context's own dictionary.
        unsafe { pairs(self.get().metadata) }
    }

    pub(crate) fn chapters(&self) -> Vec<Chapter> {
        (0..self.get().nb_chapters as usize)
            .map(|i| {
                // SAFETY: the array holds `nb_chapters` live chapters.
                let c = unsafe { &**self.get().chapters.add(i) };
                // SAFETY: the chapter's own dictionary.
                let metadata = unsafe { pairs(c.metadata) };
                Chapter { id: c.id, time_base: c.time_base.into(), start: c.start, end: c.end, metadata }
            })
            .collect()
    }
}

impl Drop for Demuxer {
    fn drop(&mut self) {
        let mut raw = self.0.as_ptr();
        // SAFETY: opened by `avformat_open_input`, closed once.
        unsafe { ffi::avformat_close_input(&raw mut raw) };
    }
}
