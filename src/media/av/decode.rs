//! A video decoder.

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::error::check;
use super::{AvError, AvFrame, Packet, StreamRef};

/// An open decoder.
pub(crate) struct Decoder(NonNull<ffi::AVCodecContext>);

// SAFETY: one owner; codec contexts may move between threads as long as one at a time uses them.
unsafe impl Send for Decoder {}

impl Decoder {
    /// Opens the decoder of `stream` with `threads` threads (0: as many as there are processors), by frame and by slice.
    pub(crate) fn open(stream: StreamRef<'_>, threads: usize) -> Result<Self, AvError> {
        // SAFETY: null or a static codec.
        let codec = unsafe { ffi::avcodec_find_decoder(stream.par().codec_id) };
        if codec.is_null() {
            return Err(AvError::UNKNOWN_CODEC);
        }
        // SAFETY: the codec is static; the context is owned by `this` from its allocation on; the fields are plain
        // integers, set before the codec is opened as FFmpeg asks.
        unsafe {
            let this = Self(NonNull::new(ffi::avcodec_alloc_context3(codec)).ok_or(AvError::NO_MEMORY)?);
            let ctx = this.0.as_ptr();
            check(ffi::avcodec_parameters_to_context(ctx, stream.par()))?;
            (*ctx).thread_count = threads as i32;
            (*ctx).thread_type = ffi::FF_THREAD_FRAME | ffi::FF_THREAD_SLICE;
            (*ctx).pkt_timebase = stream.time_base().into();
            check(ffi::avcodec_open2(ctx, codec, ptr::null_mut()))?;
            Ok(this)
        }
    }

    /// Hands over a packet; `None` announces the end.
    pub(crate) fn send(&mut self, packet: Option<&Packet>) -> Result<(), AvError> {
        let raw = packet.map_or(ptr::null(), Packet::as_ptr);
        // SAFETY: an open context; the packet lives through the call, null means the end.
        check(unsafe { ffi::avcodec_send_packet(self.0.as_ptr(), raw) }).map(|_| ())
    }

    /// The next picture; `Ok(false)` where more input is needed or the end is reached.
    pub(crate) fn receive(&mut self, frame: &mut AvFrame) -> Result<bool, AvError> {
        // SAFETY: an open context and a live frame, which FFmpeg blanks before it fills it.
        match check(unsafe { ffi::avcodec_receive_frame(self.0.as_ptr(), frame.as_mut_ptr()) }) {
            Ok(_) => Ok(true),
            Err(AvError::AGAIN | AvError::EOF) => Ok(false),
            Err(e) => Err(e),
        }
    }

    /// Forgets all state, after a seek.
    pub(crate) fn flush(&mut self) {
        // SAFETY: an open context.
        unsafe { ffi::avcodec_flush_buffers(self.0.as_ptr()) };
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        let mut raw = self.0.as_ptr();
        // SAFETY: allocated by `avcodec_alloc_context3`, freed once.
        unsafe { ffi::avcodec_free_context(&raw mut raw) };
    }
}
