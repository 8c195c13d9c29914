//! Conversion between pixel formats of one size, for encoders that cannot take the source's own.
//!
//! Between YUV formats only depth and chroma resolution change. To and from RGB the matrix is given, never assumed.

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::{AvError, AvFrame, Pix};
use plumbline_image::ColorDescription;

/// A converter from one format to another at one size.
pub(crate) struct Scaler(NonNull<ffi::SwsContext>);

// SAFETY: one owner; the context may move between threads as long as one at a time uses it.
unsafe impl Send for Scaler {}

impl Scaler {
    /// A converter; `color` gives the YUV side's matrix and both sides' range (RGB is always full).
    pub(crate) fn new(from: Pix, to: Pix, size: (usize, usize), color: &ColorDescription) -> Result<Self, AvError> {
        let (w, h) = (size.0 as i32, size.1 as i32);
        let flags = ffi::SWS_BICUBIC | ffi::SWS_ACCURATE_RND | ffi::SWS_FULL_CHR_H_INT | ffi::SWS_FULL_CHR_H_INP;
        let full = |pix: Pix| i32::from(pix.is_rgb() || color.full_range == Some(true));
        // SAFETY: both formats are valid; the context is owned by `this`; the coefficient tables are static.
        unsafe {
            let none = ptr::null_mut();
            let ctx = ffi::sws_getContext(w, h, from.raw(), w, h, to.raw(), flags, none, none, ptr::null());
            let this = Self(NonNull::new(ctx).ok_or(AvError::INVALID)?);
            let table = ffi::sws_getCoefficients(matrix(color.matrix));
            ffi::sws_setColorspaceDetails(ctx, table, full(from), table, full(to), 0, 1 << 16, 1 << 16);
            Ok(this)
        }
    }

    /// Converts the pixels of `src` into `dst`; both have the size and the format the converter was made for.
    pub(crate) fn convert(&mut self, src: &AvFrame, dst: &mut AvFrame) -> Result<(), AvError> {
        if src.size() != dst.size() {
            return Err(AvError::INVALID);
        }
        let (s, rows) = (src.get(), src.size().1 as i32);
        let d = dst.get_mut();
        // SAFETY: both frames hold pictures of the converter's formats and size; `dst` has no other reference.
        let done = unsafe {
            let (src, dst) = (s.data.as_ptr().cast(), d.data.as_ptr());
            ffi::sws_scale(self.0.as_ptr(), src, s.linesize.as_ptr(), 0, rows, dst, d.linesize.as_ptr())
        };
        if done == rows { Ok(()) } else { Err(AvError::INVALID) }
    }
}

/// The scaler's number for an H.273 matrix; unspecified and exotic ones count as BT.601.
fn matrix(code: u8) -> i32 {
    match code {
        1 | 4 | 7 | 9 => i32::from(code),
        10 => 9,
        _ => 5,
    }
}

impl Drop for Scaler {
    fn drop(&mut self) {
        // SAFETY: made by `sws_getContext`, freed once.
        unsafe { ffi::sws_freeContext(self.0.as_ptr()) };
    }
}
