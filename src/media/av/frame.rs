//! Pictures in FFmpeg's reference-counted memory, and their planes as a [`FrameBuffer`].

use std::any::Any;
use std::ptr::NonNull;

use ffmpeg_next::ffi;

use super::error::check;
use super::packet::some_ts;
use super::{AvError, Pix, Rational};
use plumbline_image::{ColorDescription, FrameBuffer, PixelFormat, PlaneRows};

/// An owned `AVFrame`; its pixels are reference-counted and may be shared with a decoder or an encoder.
pub(crate) struct AvFrame(NonNull<ffi::AVFrame>);

// SAFETY: one owner of the structure; pixel buffers use atomic counts and are written only while the count is one.
unsafe impl Send for AvFrame {}
// SAFETY: `&AvFrame` only reads; whoever else shares the pixels does not write to them while the count is above one.
unsafe impl Sync for AvFrame {}

impl AvFrame {
    /// A blank frame without pixels.
    pub(crate) fn new() -> Self {
        // SAFETY: no preconditions; null only when memory is exhausted.
        Self(NonNull::new(unsafe { ffi::av_frame_alloc() }).expect("a few hundred bytes can be allocated"))
    }

    pub(super) fn get(&self) -> &ffi::AVFrame {
        // SAFETY: allocated in `new`, freed only in `drop`.
        unsafe { self.0.as_ref() }
    }

    pub(super) fn as_ptr(&self) -> *const ffi::AVFrame {
        self.0.as_ptr()
    }

    pub(super) fn as_mut_ptr(&mut self) -> *mut ffi::AVFrame {
        self.0.as_ptr()
    }

    pub(super) fn get_mut(&mut self) -> &mut ffi::AVFrame {
        // SAFETY: as in `get`, and `&mut self` excludes other users of the structure.
        unsafe { self.0.as_mut() }
    }

    /// A second reference to the same pixels.
    pub(crate) fn share(&self) -> Result<Self, AvError> {
        let mut copy = Self::new();
        // SAFETY: both are live frames, the copy is blank.
        check(unsafe { ffi::av_frame_ref(copy.as_mut_ptr(), self.as_ptr()) })?;
        Ok(copy)
    }

    pub(crate) fn pix(&self) -> Option<Pix> {
        Pix::from_raw(self.get().format)
    }

    pub(crate) fn size(&self) -> (usize, usize) {
        (self.get().width.max(0) as usize, self.get().height.max(0) as usize)
    }

    /// Display time as the decoder best knows it, in the stream's time base.
    pub(crate) fn best_pts(&self) -> Option<i64> {
        some_ts(self.get().best_effort_timestamp).or_else(|| some_ts(self.get().pts))
    }

    /// Duration of the packet that the picture came from; 0 where unknown.
    pub(crate) fn duration(&self) -> i64 {
        self.get().pkt_duration.max(0)
    }

    pub(crate) fn is_interlaced(&self) -> bool {
        self.get().interlaced_frame != 0
    }

    pub(crate) fn is_top_first(&self) -> bool {
        self.get().top_field_first != 0
    }

    /// The decoder concealed errors, or decoded from damaged references.
    pub(crate) fn is_corrupt(&self) -> bool {
        self.get().flags & ffi::AV_FRAME_FLAG_CORRUPT != 0 || self.get().decode_error_flags != 0
    }

    pub(crate) fn sample_aspect(&self) -> Rational {
        self.get().sample_aspect_ratio.into()
    }

    /// Range, primaries, transfer, matrix and siting; `yuvj` formats are full range.
    pub(crate) fn color(&self) -> ColorDescription {
        let f = self.get();
        let full_range = match f.color_range {
            ffi::AVColorRange::AVCOL_RANGE_JPEG => Some(true),
            ffi::AVColorRange::AVCOL_RANGE_MPEG => Some(false),
            _ => self.pix().is_some_and(Pix::is_full_range_by_name).then_some(true),
        };
        ColorDescription {
            full_range,
            primaries: f.color_primaries as i32 as u8,
            transfer: f.color_trc as i32 as u8,
            matrix: f.colorspace as i32 as u8,
            chroma_offset: chroma_offset(f.chroma_location as i32),
        }
    }

    /// FFmpeg's chroma location number; 0 is unspecified.
    pub(crate) fn chroma_location(&self) -> i32 {
        self.get().chroma_location as i32
    }

    /// Prepares a picture for an encoder: its time, its length, progressive, and free to be of any type (the decoder's
    /// choice of key frames would otherwise be repeated).
    pub(crate) fn prepare_for_encoder(&mut self, pts: i64, duration: i64) {
        let f = self.get_mut();
        f.pts = pts;
        f.pkt_duration = duration;
        f.pict_type = ffi::AVPictureType::AV_PICTURE_TYPE_NONE;
        f.key_frame = 0;
        f.interlaced_frame = 0;
        f.repeat_pict = 0;
        f.quality = 0;
    }

    /// Calls the same bytes by the name of another format with the same planes (`yuvj420p` and `yuv420p`).
    pub(crate) fn relabel(&mut self, pix: Pix) -> Result<(), AvError> {
        let same = self.pix().is_some_and(|old| old.planar().is_some() && old.planar() == pix.planar());
        if !same {
            return Err(AvError::INVALID);
        }
        self.get_mut().format = pix.number();
        Ok(())
    }

    pub(crate) fn has_side_data(&self) -> bool {
        self.get().nb_side_data > 0
    }

    /// Side data alone (captions, HDR), shared by reference; `None` where there are none.
    pub(crate) fn side_data(&self) -> Option<SideData> {
        if self.get().nb_side_data == 0 {
            return None;
        }
        let mut only = Self::new();
        // SAFETY: both are live frames; properties and side data are copied, no pixels.
        check(unsafe { ffi::av_frame_copy_props(only.as_mut_ptr(), self.as_ptr()) }).ok()?;
        Some(SideData(only))
    }

    /// Takes the side data over; those already there are kept.
    pub(crate) fn attach(&mut self, side: &SideData) -> Result<(), AvError> {
        // SAFETY: both are live frames; see `side_data`.
        check(unsafe { ffi::av_frame_copy_props(self.as_mut_ptr(), side.0.as_ptr()) }).map(|_| ())
    }

    /// Bytes of the side data of one type.
    pub(super) fn side_data_bytes(&self, kind: ffi::AVFrameSideDataType) -> Option<&[u8]> {
        // SAFETY: a live frame; a non-null result is readable for its size while the frame lives.
        unsafe {
            let side = ffi::av_frame_get_side_data(self.as_ptr(), kind).as_ref()?;
            (!side.data.is_null()).then(|| std::slice::from_raw_parts(side.data, side.size))
        }
    }

    /// Names of the metadata of dynamic HDR that the picture has.
    pub(crate) fn dynamic_hdr(&self) -> Vec<&'static str> {
        use ffi::AVFrameSideDataType as T;
        let kinds = [
            (T::AV_FRAME_DATA_DYNAMIC_HDR_PLUS, "HDR10+"),
            (T::AV_FRAME_DATA_DYNAMIC_HDR_VIVID, "HDR Vivid"),
            (T::AV_FRAME_DATA_DOVI_RPU_BUFFER, DOLBY_VISION),
            (T::AV_FRAME_DATA_DOVI_METADATA, DOLBY_VISION),
        ];
        let mut names: Vec<_> =
            kinds.into_iter().filter(|(kind, _)| self.side_data_bytes(*kind).is_some()).map(|(_, name)| name).collect();
        names.dedup();
        names
    }

    /// Mastering display (`AVMasteringDisplayMetadata`) and content light (`AVContentLightMetadata`), as FFmpeg stores them.
    pub(crate) fn hdr_bytes(&self) -> (Option<&[u8]>, Option<&[u8]>) {
        use ffi::AVFrameSideDataType as T;
        (
            self.side_data_bytes(T::AV_FRAME_DATA_MASTERING_DISPLAY_METADATA),
            self.side_data_bytes(T::AV_FRAME_DATA_CONTENT_LIGHT_LEVEL),
        )
    }
}

impl Drop for AvFrame {
    fn drop(&mut self) {
        let mut raw = self.0.as_ptr();
        // SAFETY: allocated by `av_frame_alloc`, freed once.
        unsafe { ffi::av_frame_free(&raw mut raw) };
    }
}

/// Dynamic HDR by Dolby, as warnings name it.
pub(crate) const DOLBY_VISION: &str = "Dolby Vision";

/// What travels with a picture besides its pixels.
pub(crate) struct SideData(AvFrame);

/// A picture whose planes are laid out as [`PixelFormat`] says: checked when made.
pub(crate) struct PlanarFrame {
    frame: AvFrame,
    format: PixelFormat,
}

impl PlanarFrame {
    /// `None` where a plane is missing, runs upwards, or is not aligned to its samples.
    pub(crate) fn new(frame: AvFrame, format: PixelFormat) -> Result<Self, AvFrame> {
        let (w, h) = frame.size();
        let sound = (0..format.planes()).all(|i| {
            let (data, stride) = (frame.get().data[i], frame.get().linesize[i]);
            let row = format.plane_size(i, w, h).0 * format.bytes_per_sample();
            let even = format.bytes_per_sample() == 1 || (data.align_offset(2) == 0 && stride % 2 == 0);
            !data.is_null() && stride >= row as i32 && even
        });
        let native = frame.pix().is_some_and(|p| p.planar() == Some(format));
        if sound && native && w > 0 && h > 0 { Ok(Self { frame, format }) } else { Err(frame) }
    }

    pub(crate) fn frame(&self) -> &AvFrame {
        &self.frame
    }

    pub(crate) fn frame_mut(&mut self) -> &mut AvFrame {
        &mut self.frame
    }

    pub(crate) fn format(&self) -> PixelFormat {
        self.format
    }

    /// Bytes from the first sample to the last of plane `i`, and the stride.
    fn extent(&self, i: usize) -> (usize, usize) {
        let (w, h) = self.frame.size();
        let (pw, ph) = self.format.plane_size(i, w, h);
        let stride = self.frame.get().linesize[i] as usize;
        (stride * (ph - 1) + pw * self.format.bytes_per_sample(), stride)
    }
}

impl FrameBuffer for PlanarFrame {
    fn plane(&self, i: usize) -> PlaneRows<'_> {
        assert!(i < self.format.planes(), "plane {i} of {}", self.format.planes());
        let (len, stride) = self.extent(i);
        // SAFETY: `new` checked pointer and stride of every plane of the format, and `frame.pix()` to be that format, so
        // FFmpeg allocated at least `len` bytes; they live as long as the frame and nobody writes (see `Sync`).
        (unsafe { std::slice::from_raw_parts(self.frame.get().data[i], len) }, stride)
    }

    fn plane_mut(&mut self, i: usize) -> Option<(&mut [u8], usize)> {
        assert!(i < self.format.planes(), "plane {i} of {}", self.format.planes());
        // SAFETY: a live frame.
        if unsafe { ffi::av_frame_is_writable(self.frame.as_mut_ptr()) } <= 0 {
            return None;
        }
        let (len, stride) = self.extent(i);
        // SAFETY: as in `plane`; the only reference to the pixels is this frame, and it is borrowed mutably.
        Some((unsafe { std::slice::from_raw_parts_mut(self.frame.get().data[i], len) }, stride))
    }

    fn planes_mut(&mut self) -> Option<Vec<(&mut [u8], usize)>> {
        let count = self.format.planes();
        let range = |i: usize| {
            let start = self.plane(i).0.as_ptr() as usize;
            start..start + self.extent(i).0
        };
        let apart = |i: usize, j: usize| range(i).end <= range(j).start || range(j).end <= range(i).start;
        let overlap = (0..count).any(|i| (0..i).any(|j| !apart(i, j)));
        if overlap || self.plane_mut(0).is_none() {
            return None;
        }
        let plane = |i: usize| {
            let (len, stride) = self.extent(i);
            // SAFETY: as in `plane_mut`, which found the frame writable; no two of the planes overlap.
            (unsafe { std::slice::from_raw_parts_mut(self.frame.get().data[i], len) }, stride)
        };
        Some((0..count).map(plane).collect())
    }

    fn as_any(&mut self) -> &mut dyn Any {
        self
    }
}

/// Offset of the first chroma sample from the first luma sample, luma px, by FFmpeg's location number.
pub(crate) fn chroma_offset(location: i32) -> [f32; 2] {
    match location {
        2 => [0.5, 0.5],
        3 => [0.0, 0.0],
        4 => [0.5, 0.0],
        5 => [0.0, 1.0],
        6 => [0.5, 1.0],
        _ => [0.0, 0.5],
    }
}
