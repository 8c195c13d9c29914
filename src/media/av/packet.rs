//! One encoded packet.

use std::ptr::NonNull;

use ffmpeg_next::ffi;

use super::error::check;
use super::{AvError, Rational};

/// An owned `AVPacket`; its data are reference-counted.
pub(crate) struct Packet(NonNull<ffi::AVPacket>);

// SAFETY: the packet has one owner, and its reference-counted data use atomic counts.
unsafe impl Send for Packet {}

impl Packet {
    pub(crate) fn new() -> Self {
        // SAFETY: no preconditions; null only when memory is exhausted.
        Self(NonNull::new(unsafe { ffi::av_packet_alloc() }).expect("a few hundred bytes can be allocated"))
    }

    pub(super) fn as_ptr(&self) -> *const ffi::AVPacket {
        self.0.as_ptr()
    }

    pub(super) fn as_mut_ptr(&mut self) -> *mut ffi::AVPacket {
        self.0.as_ptr()
    }

    fn get(&self) -> &ffi::AVPacket {
        // SAFETY: allocated in `new`, freed only in `drop`.
        unsafe { self.0.as_ref() }
    }

    fn get_mut(&mut self) -> &mut ffi::AVPacket {
        // SAFETY: as in `get`, and `&mut self` excludes other users.
        unsafe { self.0.as_mut() }
    }

    /// Releases the data; the packet can be filled again.
    pub(crate) fn clear(&mut self) {
        // SAFETY: a live packet.
        unsafe { ffi::av_packet_unref(self.as_mut_ptr()) };
    }

    /// Takes the decoder's new header out of the packet, where it brings one.
    pub(crate) fn take_new_header(&mut self) -> Option<Vec<u8>> {
        let (kind, mut size) = (ffi::AVPacketSideDataType::AV_PKT_DATA_NEW_EXTRADATA, 0);
        // SAFETY: a live packet; the result is null or readable for `size` bytes until the packet changes. Of size 0 it is none to muxers.
        unsafe {
            let data = ffi::av_packet_get_side_data(self.as_ptr(), kind, &raw mut size);
            if data.is_null() || size == 0 {
                return None;
            }
            let header = std::slice::from_raw_parts(data, size).to_vec();
            ffi::av_packet_shrink_side_data(self.as_mut_ptr(), kind, 0);
            Some(header)
        }
    }

    /// Fills the packet with a copy of `bytes`.
    pub(crate) fn set_data(&mut self, bytes: &[u8]) -> Result<(), AvError> {
        self.clear();
        let size = i32::try_from(bytes.len()).map_err(|_| AvError::INVALID)?;
        // SAFETY: a live blank packet; on success `data` is writable for `size` bytes.
        unsafe {
            check(ffi::av_new_packet(self.as_mut_ptr(), size))?;
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.get().data, bytes.len());
        }
        Ok(())
    }

    /// The encoded bytes.
    pub(crate) fn data(&self) -> &[u8] {
        let (data, size) = (self.get().data, self.get().size);
        if data.is_null() || size <= 0 {
            return &[];
        }
        // SAFETY: a live packet holds `size` readable bytes, which stay as long as it is not changed.
        unsafe { std::slice::from_raw_parts(data, size as usize) }
    }

    /// Decoding can begin with it.
    pub(crate) fn is_key(&self) -> bool {
        self.get().flags & ffi::AV_PKT_FLAG_KEY != 0
    }

    pub(crate) fn stream(&self) -> usize {
        self.get().stream_index.max(0) as usize
    }

    pub(crate) fn set_stream(&mut self, index: usize) {
        self.get_mut().stream_index = index as i32;
        self.get_mut().pos = -1;
    }

    pub(crate) fn pts(&self) -> Option<i64> {
        some_ts(self.get().pts)
    }

    pub(crate) fn dts(&self) -> Option<i64> {
        some_ts(self.get().dts)
    }

    pub(crate) fn duration(&self) -> i64 {
        self.get().duration
    }

    pub(crate) fn set_duration(&mut self, duration: i64) {
        self.get_mut().duration = duration;
    }

    pub(crate) fn set_times(&mut self, pts: Option<i64>, dts: Option<i64>) {
        self.get_mut().pts = pts.unwrap_or(ffi::AV_NOPTS_VALUE);
        self.get_mut().dts = dts.unwrap_or(ffi::AV_NOPTS_VALUE);
    }

    /// Moves both times by `ticks`.
    pub(crate) fn shift(&mut self, ticks: i64) {
        self.set_times(self.pts().map(|t| t.saturating_add(ticks)), self.dts().map(|t| t.saturating_add(ticks)));
    }

    pub(crate) fn rescale(&mut self, from: Rational, to: Rational) {
        // SAFETY: a live packet; both bases come from FFmpeg and have positive denominators.
        unsafe { ffi::av_packet_rescale_ts(self.as_mut_ptr(), from.into(), to.into()) };
    }

    pub(crate) fn set_key(&mut self) {
        self.get_mut().flags |= ffi::AV_PKT_FLAG_KEY;
    }

    pub(crate) fn is_corrupt(&self) -> bool {
        self.get().flags & ffi::AV_PKT_FLAG_CORRUPT != 0
    }

    /// The container says that this packet is decoded but not shown (edit lists).
    pub(crate) fn is_discarded(&self) -> bool {
        self.get().flags & ffi::AV_PKT_FLAG_DISCARD != 0
    }
}

impl Drop for Packet {
    fn drop(&mut self) {
        let mut raw = self.0.as_ptr();
        // SAFETY: allocated by `av_packet_alloc`, freed once.
        unsafe { ffi::av_packet_free(&raw mut raw) };
    }
}

/// A time of FFmpeg's, where it is known.
pub(super) fn some_ts(ts: i64) -> Option<i64> {
    (ts != ffi::AV_NOPTS_VALUE).then_some(ts)
}
