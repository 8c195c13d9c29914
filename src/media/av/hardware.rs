//! Surfaces of a graphics device, for the encoders that take nothing else (VAAPI).

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::encode::{EncoderCodec, EncoderSettings};
use super::error::check;
use super::{AvError, AvFrame, Pix};

/// A device and its pool of surfaces.
pub(super) struct Surfaces(NonNull<ffi::AVBufferRef>);

/// Number of surfaces: more than the encoder's reordering depth, few enough for small devices.
const POOL: i32 = 24;

impl Surfaces {
    /// Surfaces where `codec` asks for them by taking only hardware formats; `None` for all others.
    pub(super) fn for_encoder(codec: EncoderCodec, settings: &EncoderSettings) -> Result<Option<Self>, AvError> {
        let formats = codec.formats();
        let Some(surface) = formats.first().copied().filter(|_| formats.iter().all(|f| f.is_hardware())) else {
            return Ok(None);
        };
        let kind = c"vaapi";
        // SAFETY: a static name; every object made here is released on all ways out.
        unsafe {
            let kind = ffi::av_hwdevice_find_type_by_name(kind.as_ptr());
            let mut device = ptr::null_mut();
            check(ffi::av_hwdevice_ctx_create(&raw mut device, kind, ptr::null(), ptr::null_mut(), 0))?;
            let frames = ffi::av_hwframe_ctx_alloc(device);
            ffi::av_buffer_unref(&raw mut device); // the surfaces keep their own reference
            let this = Self(NonNull::new(frames).ok_or(AvError::NO_MEMORY)?);
            this.configure(surface, settings);
            check(ffi::av_hwframe_ctx_init(this.0.as_ptr()))?;
            Ok(Some(this))
        }
    }

    fn configure(&self, surface: Pix, settings: &EncoderSettings) {
        // SAFETY: a buffer made by `av_hwframe_ctx_alloc` holds an `AVHWFramesContext`, not yet initialised or shared.
        let c = unsafe { &mut *(*self.0.as_ptr()).data.cast::<ffi::AVHWFramesContext>() };
        (c.format, c.sw_format) = (surface.raw(), settings.pix.raw());
        (c.width, c.height) = (settings.width as i32, settings.height as i32);
        c.initial_pool_size = POOL;
    }

    /// Makes an unopened encoder take these surfaces.
    ///
    /// # Safety
    /// `encoder` is a live context that is not open yet.
    pub(super) unsafe fn attach(&self, encoder: *mut ffi::AVCodecContext) -> Result<(), AvError> {
        // SAFETY: by contract; the context owns the new reference and releases it when freed. The surfaces' format is a
        // field of their own context.
        unsafe {
            let shared = NonNull::new(ffi::av_buffer_ref(self.0.as_ptr())).ok_or(AvError::NO_MEMORY)?;
            (*encoder).pix_fmt = (*(*self.0.as_ptr()).data.cast::<ffi::AVHWFramesContext>()).format;
            (*encoder).hw_frames_ctx = shared.as_ptr();
        }
        Ok(())
    }

    /// A copy of `frame` on the device.
    pub(super) fn upload(&self, frame: &AvFrame) -> Result<AvFrame, AvError> {
        let mut surface = AvFrame::new();
        // SAFETY: a live pool and two live frames, one of them blank.
        unsafe {
            check(ffi::av_hwframe_get_buffer(self.0.as_ptr(), surface.as_mut_ptr(), 0))?;
            check(ffi::av_hwframe_transfer_data(surface.as_mut_ptr(), frame.as_ptr(), 0))?;
            check(ffi::av_frame_copy_props(surface.as_mut_ptr(), frame.as_ptr()))?;
        }
        Ok(surface)
    }
}

impl Drop for Surfaces {
    fn drop(&mut self) {
        let mut raw = self.0.as_ptr();
        // SAFETY: one reference, released once.
        unsafe { ffi::av_buffer_unref(&raw mut raw) };
    }
}
