//! Text subtitles from one codec into another, by way of FFmpeg's common form (ASS events).

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::error::check;
use super::{AvError, Packet, Rational, StreamRef, find_encoder};

/// Buffer for one encoded event, bytes; as in FFmpeg's own tool.
const EVENT_BYTES: usize = 1 << 20;

/// A subtitle decoder and an encoder fed from it.
pub(crate) struct SubtitleTranscoder {
    decoder: NonNull<ffi::AVCodecContext>,
    encoder: NonNull<ffi::AVCodecContext>,
    time_base: Rational,
}

// SAFETY: one owner; codec contexts may move between threads as long as one at a time uses them.
unsafe impl Send for SubtitleTranscoder {}

impl SubtitleTranscoder {
    /// A transcoder for `source`, into what the encoder of that name makes.
    pub(crate) fn open(source: StreamRef<'_>, encoder: &str) -> Result<Self, AvError> {
        let target = find_encoder(encoder).ok_or(AvError::UNKNOWN_ENCODER)?;
        // SAFETY: codecs are static; each context is owned by `this` from its allocation on; the header is copied into
        // memory of FFmpeg's allocator, which frees it with the encoder.
        unsafe {
            let codec = ffi::avcodec_find_decoder(source.par().codec_id);
            let decoder = NonNull::new(ffi::avcodec_alloc_context3(codec)).ok_or(AvError::NO_MEMORY)?;
            let Some(encoder) = NonNull::new(ffi::avcodec_alloc_context3(ptr::null())) else {
                let mut raw = decoder.as_ptr();
                ffi::avcodec_free_context(&raw mut raw);
                return Err(AvError::NO_MEMORY);
            };
            let this = Self { decoder, encoder, time_base: source.time_base() };
            check(ffi::avcodec_parameters_to_context(decoder.as_ptr(), source.par()))?;
            (*decoder.as_ptr()).pkt_timebase = source.time_base().into();
            check(ffi::avcodec_open2(decoder.as_ptr(), codec, ptr::null_mut()))?;
            this.copy_header()?;
            (*encoder.as_ptr()).time_base = Rational::MICRO.into();
            let target = ffi::avcodec_find_encoder(target.id());
            check(ffi::avcodec_open2(encoder.as_ptr(), target, ptr::null_mut()))?;
            Ok(this)
        }
    }

    fn copy_header(&self) -> Result<(), AvError> {
        // SAFETY: both contexts are alive; the decoder is open and its header readable for its size.
        unsafe {
            let (d, e) = (&*self.decoder.as_ptr(), &mut *self.encoder.as_ptr());
            if d.subtitle_header.is_null() {
                return Ok(());
            }
            let size = d.subtitle_header_size.max(0) as usize;
            let copy = ffi::av_mallocz(size + 1).cast::<u8>();
            if copy.is_null() {
                return Err(AvError::NO_MEMORY);
            }
            ptr::copy_nonoverlapping(d.subtitle_header, copy, size);
            (e.subtitle_header, e.subtitle_header_size) = (copy, size as i32);
        }
        Ok(())
    }

    pub(super) fn encoder_ptr(&self) -> *const ffi::AVCodecContext {
        self.encoder.as_ptr()
    }

    /// The event of `packet` in the other codec, at the same times; `None` where the packet carries no text.
    pub(crate) fn convert(&mut self, packet: &mut Packet) -> Result<Option<Packet>, AvError> {
        let (pts, duration) = (packet.pts(), packet.duration());
        let mut event = Event::default();
        let mut got = 0;
        // SAFETY: an open decoder, a live packet; the event is released by its drop.
        unsafe {
            let d = self.decoder.as_ptr();
            check(ffi::avcodec_decode_subtitle2(d, &raw mut event.0, &raw mut got, packet.as_mut_ptr()))?;
        }
        if got == 0 || event.0.num_rects == 0 {
            return Ok(None);
        }
        let length = self.time_base.rescale(duration, Rational { num: 1, den: 1000 });
        (event.0.start_display_time, event.0.end_display_time) = (0, length.clamp(0, i64::from(u32::MAX)) as u32);
        event.0.pts = pts.map_or(0, |t| self.time_base.rescale(t, Rational::MICRO));
        let mut text = vec![0; EVENT_BYTES];
        // SAFETY: an open encoder; the buffer is writable for its length.
        let size = check(unsafe {
            let (e, size) = (self.encoder.as_ptr(), text.len() as i32);
            ffi::avcodec_encode_subtitle(e, text.as_mut_ptr(), size, &raw const event.0)
        })?;
        let mut out = Packet::new();
        out.set_data(&text[..size as usize])?;
        out.set_times(pts, pts);
        out.set_duration(duration);
        out.set_key();
        Ok(Some(out))
    }
}

impl Drop for SubtitleTranscoder {
    fn drop(&mut self) {
        for context in [self.decoder, self.encoder] {
            let mut raw = context.as_ptr();
            // SAFETY: allocated by `avcodec_alloc_context3`, freed once.
            unsafe { ffi::avcodec_free_context(&raw mut raw) };
        }
    }
}

/// A decoded event, whose parts FFmpeg allocates.
struct Event(ffi::AVSubtitle);

impl Default for Event {
    fn default() -> Self {
        // SAFETY: integers and pointers, for all of which zero is valid.
        Self(unsafe { std::mem::zeroed() })
    }
}

impl Drop for Event {
    fn drop(&mut self) {
        // SAFETY: blank or filled by the decoder; released once.
        unsafe { ffi::avsubtitle_free(&raw mut self.0) };
    }
}
