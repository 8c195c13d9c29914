//! Frames whose memory is used again.

use std::ptr::NonNull;

use ffmpeg_next::ffi;

use super::frame::PlanarFrame;
use super::{AvError, AvFrame, Pix};
use plumbline_image::PixelFormat;

/// Rows start at multiples of this many bytes, the widest vector register.
const ROW_ALIGN: usize = 64;

/// A pool of pictures of one format and size. A picture's memory comes back when its last reference is dropped, on
/// whatever thread; the pool itself lives on until then.
pub(crate) struct FramePool {
    pool: NonNull<ffi::AVBufferPool>,
    pix: Pix,
    width: usize,
    height: usize,
    /// Offset and stride of each plane, bytes.
    planes: Vec<(usize, usize)>,
}

// SAFETY: FFmpeg's buffer pools are locked inside.
unsafe impl Send for FramePool {}
// SAFETY: as above; all methods take `&self` and only call locked functions.
unsafe impl Sync for FramePool {}

impl FramePool {
    /// A pool of `width × height` pictures; planes of a packed format are as wide as FFmpeg says.
    pub(crate) fn new(pix: Pix, width: usize, height: usize) -> Result<Self, AvError> {
        let mut strides = [0_i32; 4];
        let w = i32::try_from(width.next_multiple_of(16)).map_err(|_| AvError::INVALID)?;
        let h = i32::try_from(height).map_err(|_| AvError::INVALID)?;
        // SAFETY: the array has the four entries that FFmpeg fills.
        super::error::check(unsafe { ffi::av_image_fill_linesizes(strides.as_mut_ptr(), pix.raw(), w) })?;
        let (mut planes, mut size) = (Vec::new(), 0);
        for (i, stride) in strides.into_iter().take_while(|s| *s > 0).enumerate() {
            let stride = (stride as usize).next_multiple_of(ROW_ALIGN);
            let chroma = i == 1 || i == 2;
            let rows = if chroma { height.div_ceil(1 << pix.chroma_shift().1) } else { height };
            planes.push((size, stride));
            size += stride * rows.next_multiple_of(2);
        }
        // SAFETY: no preconditions. Memory starts as zeros: no picture ever shows another program's bytes.
        let pool = unsafe { ffi::av_buffer_pool_init(size + 2 * ROW_ALIGN, Some(ffi::av_buffer_allocz)) };
        let pool = NonNull::new(pool).ok_or(AvError::NO_MEMORY)?;
        let _ = h;
        Ok(Self { pool, pix, width, height, planes })
    }

    /// A writable picture; its samples are those of whoever used it last.
    pub(crate) fn get(&self) -> Result<AvFrame, AvError> {
        // SAFETY: a live pool.
        let buffer = unsafe { ffi::av_buffer_pool_get(self.pool.as_ptr()) };
        if buffer.is_null() {
            return Err(AvError::NO_MEMORY);
        }
        let mut frame = AvFrame::new();
        let raw = frame.get_mut();
        raw.buf[0] = buffer; // owned by the frame from here on
        // SAFETY: the buffer holds `size + 2·ROW_ALIGN` bytes; rounding its start up leaves every plane inside.
        let start = unsafe { (*buffer).data.add((*buffer).data.align_offset(ROW_ALIGN)) };
        for (i, (offset, stride)) in self.planes.iter().enumerate() {
            // SAFETY: offsets lie below `size`.
            raw.data[i] = unsafe { start.add(*offset) };
            raw.linesize[i] = *stride as i32;
        }
        (raw.width, raw.height) = (self.width as i32, self.height as i32);
        raw.format = self.pix.raw() as i32;
        raw.extended_data = raw.data.as_mut_ptr();
        Ok(frame)
    }

    /// A writable picture with planes as `format` says; the pool's format must be its equal.
    pub(crate) fn get_planar(&self, format: PixelFormat) -> Result<PlanarFrame, AvError> {
        PlanarFrame::new(self.get()?, format).map_err(|_| AvError::INVALID)
    }
}

impl Drop for FramePool {
    fn drop(&mut self) {
        let mut raw = self.pool.as_ptr();
        // SAFETY: made by `av_buffer_pool_init`; pictures still out keep the memory alive.
        unsafe { ffi::av_buffer_pool_uninit(&raw mut raw) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::{FrameBuffer, Layout};

    #[test]
    fn memory_is_used_again_and_outlives_the_pool() {
        let format = PixelFormat::opaque(Layout::Yuv420, 10);
        let pool = FramePool::new(Pix::from_planar(format).expect("known"), 641, 361).expect("pool");
        let mut a = pool.get_planar(format).expect("frame");
        let first = a.plane(0).0.as_ptr();
        for i in 0..3 {
            let (rows, stride) = a.plane_mut(i).expect("sole owner");
            assert_eq!(stride % ROW_ALIGN, 0);
            rows.fill(7);
        }
        drop(a);
        let b = pool.get_planar(format).expect("frame");
        assert_eq!(b.plane(0).0.as_ptr(), first);
        drop(pool);
        assert_eq!(b.plane(2).0[0], 7);
    }

    #[test]
    fn shared_pixels_cannot_be_written() {
        let format = PixelFormat::opaque(Layout::Gray, 8);
        let pool = FramePool::new(Pix::from_planar(format).expect("known"), 16, 16).expect("pool");
        let mut frame = pool.get_planar(format).expect("frame");
        let other = frame.frame().share().expect("reference");
        assert!(frame.plane_mut(0).is_none());
        drop(other);
        assert!(frame.plane_mut(0).is_some());
    }
}
