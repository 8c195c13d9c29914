//! A frame: planes in native depth, a timestamp and a color description.
//!
//! The pixels live behind [`FrameBuffer`], so that a decoder can hand on its own reference-counted memory without a copy
//! and this layer stays ignorant of where it came from.

use std::any::Any;
use std::ops::Range;
use std::sync::Arc;

use super::{ColorDescription, PixelFormat, PlaneMut, PlaneRef};
use plumbline_num::time::Timestamp;

/// Raw rows of one plane: bytes from the first sample of the first row, and the distance between rows in **bytes**.
pub type PlaneRows<'a> = (&'a [u8], usize);

/// Memory that holds the planes of a frame.
pub trait FrameBuffer: Send + Sync {
    /// Plane `i`, `i < format.planes()`.
    fn plane(&self, i: usize) -> PlaneRows<'_>;

    /// Plane `i` for writing; `None` where the memory is shared (a decoder's reference frame).
    fn plane_mut(&mut self, i: usize) -> Option<(&mut [u8], usize)>;

    /// All planes for writing, in their order; `None` where the memory is shared, or planes overlap.
    fn planes_mut(&mut self) -> Option<Vec<(&mut [u8], usize)>>;

    /// The buffer itself, so that the layer that made it can have its own type back.
    fn as_any(&mut self) -> &mut dyn Any;
}

/// Planes in memory of our own: rows start at multiples of 64 bytes.
#[derive(Clone, Debug)]
pub struct OwnedBuffer {
    planes: Vec<(Vec<u64>, usize)>,
}

impl OwnedBuffer {
    fn new(format: PixelFormat, width: usize, height: usize) -> Self {
        let plane = |i| {
            let (w, h) = format.plane_size(i, width, height);
            let stride = (w * format.bytes_per_sample()).next_multiple_of(64);
            (vec![0_u64; stride * h / 8], stride)
        };
        Self { planes: (0..format.planes()).map(plane).collect() }
    }
}

impl FrameBuffer for OwnedBuffer {
    fn plane(&self, i: usize) -> PlaneRows<'_> {
        let (data, stride) = &self.planes[i];
        (bytemuck::cast_slice(data), *stride)
    }

    fn plane_mut(&mut self, i: usize) -> Option<(&mut [u8], usize)> {
        let (data, stride) = &mut self.planes[i];
        Some((bytemuck::cast_slice_mut(data), *stride))
    }

    fn planes_mut(&mut self) -> Option<Vec<(&mut [u8], usize)>> {
        Some(self.planes.iter_mut().map(|(data, stride)| (bytemuck::cast_slice_mut(data), *stride)).collect())
    }

    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
}

/// One picture.
pub struct Frame {
    /// Layout, depth and alpha.
    pub format: PixelFormat,
    /// Width of the luma plane, px, in coded orientation.
    pub width: usize,
    /// Height of the luma plane, px, in coded orientation.
    pub height: usize,
    /// Display time in the stream's time base.
    pub pts: Timestamp,
    /// Display duration in the stream's time base; 0 where the container does not say.
    pub duration: i64,
    /// Meaning of the sample values.
    pub color: ColorDescription,
    /// The decoder concealed errors in this picture.
    pub corrupt: bool,
    /// What else travels with the picture (captions, HDR metadata): opaque here, known to the layer that made it.
    pub extra: Option<Arc<dyn Any + Send + Sync>>,
    buffer: Box<dyn FrameBuffer>,
}

impl Frame {
    /// A black-or-garbage-free frame of zeros in memory of our own.
    pub fn new(format: PixelFormat, width: usize, height: usize) -> Self {
        Self::from_buffer(format, width, height, Box::new(OwnedBuffer::new(format, width, height)))
    }

    /// A frame over memory that another layer holds.
    pub fn from_buffer(format: PixelFormat, width: usize, height: usize, buffer: Box<dyn FrameBuffer>) -> Self {
        let (pts, color) = (Timestamp(0), ColorDescription::default());
        Self { format, width, height, pts, duration: 0, color, corrupt: false, extra: None, buffer }
    }

    /// The memory behind the planes.
    pub fn buffer(&self) -> &dyn FrameBuffer {
        &*self.buffer
    }

    /// The memory behind the planes, for the layer that made it.
    pub fn buffer_mut(&mut self) -> &mut dyn FrameBuffer {
        &mut *self.buffer
    }

    /// Takes time, duration, color, the corruption mark and whatever else travels with `other`; the pixels stay.
    pub fn copy_properties(&mut self, other: &Self) {
        self.pts = other.pts;
        self.duration = other.duration;
        self.color = other.color;
        self.corrupt = other.corrupt;
        self.extra.clone_from(&other.extra);
    }

    /// Plane `i` of an 8-bit frame; `None` where the frame is deeper or the buffer too short.
    pub fn plane8(&self, i: usize) -> Option<PlaneRef<'_, u8>> {
        let (data, stride) = self.buffer.plane(i);
        let (w, h) = self.format.plane_size(i, self.width, self.height);
        if self.format.bytes_per_sample() == 1 { PlaneRef::new(data, w, h, stride) } else { None }
    }

    /// Plane `i` of a 9- to 16-bit frame; `None` where the frame is 8-bit, or the memory is not aligned to samples.
    pub fn plane16(&self, i: usize) -> Option<PlaneRef<'_, u16>> {
        let (data, stride) = self.buffer.plane(i);
        let (w, h) = self.format.plane_size(i, self.width, self.height);
        if self.format.bytes_per_sample() == 1 || stride % 2 != 0 {
            return None;
        }
        let even = &data[..data.len() & !1];
        PlaneRef::new(bytemuck::try_cast_slice(even).ok()?, w, h, stride / 2)
    }

    /// Plane `i` of an 8-bit frame for writing; `None` also where the memory is shared.
    pub fn plane8_mut(&mut self, i: usize) -> Option<PlaneMut<'_, u8>> {
        let (w, h) = self.format.plane_size(i, self.width, self.height);
        if self.format.bytes_per_sample() != 1 {
            return None;
        }
        let (data, stride) = self.buffer.plane_mut(i)?;
        PlaneMut::new(data, w, h, stride)
    }

    /// Plane `i` of a deeper frame for writing; `None` also where the memory is shared.
    pub fn plane16_mut(&mut self, i: usize) -> Option<PlaneMut<'_, u16>> {
        let (w, h) = self.format.plane_size(i, self.width, self.height);
        if self.format.bytes_per_sample() == 1 {
            return None;
        }
        let (data, stride) = self.buffer.plane_mut(i)?;
        words_mut(data, (w, h), stride)
    }

    /// Some planes of an 8-bit frame for writing; `None` also where the memory is shared, or planes overlap.
    pub(crate) fn planes8_mut(&mut self, planes: Range<usize>) -> Option<Vec<PlaneMut<'_, u8>>> {
        let (format, width, height) = (self.format, self.width, self.height);
        let size = |i: usize| format.plane_size(i, width, height);
        let own = self.buffer.planes_mut().filter(|_| format.bytes_per_sample() == 1)?;
        let wanted = own.into_iter().enumerate().skip(planes.start).take(planes.len());
        wanted.map(|(i, (data, stride))| PlaneMut::new(data, size(i).0, size(i).1, stride)).collect()
    }

    /// Some planes of a deeper frame for writing; `None` also where the memory is shared, or planes overlap.
    pub(crate) fn planes16_mut(&mut self, planes: Range<usize>) -> Option<Vec<PlaneMut<'_, u16>>> {
        let (format, width, height) = (self.format, self.width, self.height);
        let size = |i: usize| format.plane_size(i, width, height);
        let own = self.buffer.planes_mut().filter(|_| format.bytes_per_sample() > 1)?;
        let wanted = own.into_iter().enumerate().skip(planes.start).take(planes.len());
        wanted.map(|(i, (data, stride))| words_mut(data, size(i), stride)).collect()
    }
}

/// Bytes as a plane of 16-bit samples; `None` where they are not aligned to samples. The stride is in bytes.
fn words_mut(data: &mut [u8], (width, height): (usize, usize), stride: usize) -> Option<PlaneMut<'_, u16>> {
    let even = data.len() & !1;
    let words = bytemuck::try_cast_slice_mut(&mut data[..even]).ok().filter(|_| stride.is_multiple_of(2))?;
    PlaneMut::new(words, width, height, stride / 2)
}

impl std::fmt::Debug for Frame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Frame {{ {}×{} {:?} pts {} }}", self.width, self.height, self.format, self.pts.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Layout;

    #[test]
    fn depth_decides_which_view_exists() {
        let f8 = Frame::new(PixelFormat::opaque(Layout::Yuv420, 8), 33, 17);
        assert!(f8.plane8(2).is_some() && f8.plane16(2).is_none());
        let mut f10 = Frame::new(PixelFormat::opaque(Layout::Yuv420, 10), 33, 17);
        assert!(f10.plane8(0).is_none());
        f10.plane16_mut(1).expect("own memory").row_mut(8)[16] = 1023;
        assert_eq!(f10.plane16(1).expect("10 bit").row(8)[16], 1023);
    }
}
