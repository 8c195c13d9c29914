//! A video encoder.

use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::dict::{c_string, string};
use super::error::check;
use super::{AvError, AvFrame, Dictionary, Packet, Pix, Rational};
use plumbline_image::ColorDescription;

/// An encoder that FFmpeg was built with.
#[derive(Clone, Copy)]
pub(crate) struct EncoderCodec(&'static ffi::AVCodec);

/// The encoder of that name, where FFmpeg was built with it.
pub(crate) fn find_encoder(name: &str) -> Option<EncoderCodec> {
    let name = c_string(name);
    // SAFETY: a zero-terminated name; null or a static codec.
    unsafe { ffi::avcodec_find_encoder_by_name(name.as_ptr()).as_ref() }.map(EncoderCodec)
}

impl EncoderCodec {
    pub(crate) fn name(self) -> String {
        // SAFETY: a static name.
        unsafe { string(self.0.name) }
    }

    pub(super) fn id(self) -> ffi::AVCodecID {
        self.0.id
    }

    /// Pixel formats that the encoder takes; empty where it does not say.
    pub(crate) fn formats(self) -> Vec<Pix> {
        let mut out = Vec::new();
        let mut next = self.0.pix_fmts;
        // SAFETY: null, or a static list that ends with "none".
        while let Some(pix) = unsafe { next.as_ref() }.and_then(|raw| Pix::from_enum(*raw)) {
            out.push(pix);
            // SAFETY: the entry was not the last.
            next = unsafe { next.add(1) };
        }
        out
    }
}

/// What an encoder must know before it opens.
pub(crate) struct EncoderSettings {
    pub(crate) pix: Pix,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) time_base: Rational,
    pub(crate) frame_rate: Rational,
    pub(crate) sample_aspect: Rational,
    pub(crate) color: ColorDescription,
    pub(crate) chroma_location: i32,
    pub(crate) bit_rate: Option<u64>,
    /// 0: the encoder's own choice.
    pub(crate) threads: usize,
    /// The container stores headers apart from the packets.
    pub(crate) global_header: bool,
    /// For tests that compare files: no version strings.
    pub(crate) options: Dictionary,
}

/// An open encoder.
pub(crate) struct Encoder {
    ctx: NonNull<ffi::AVCodecContext>,
    /// Opened, and the end not announced yet.
    running: bool,
    device: Option<super::hardware::Surfaces>,
}

// SAFETY: one owner; codec contexts may move between threads as long as one at a time uses them.
unsafe impl Send for Encoder {}

impl Encoder {
    /// Opens `codec`. Options that it does not know are an error: a misspelt preset must not pass in silence.
    pub(crate) fn open(codec: EncoderCodec, mut settings: EncoderSettings) -> Result<Self, AvError> {
        super::log::install();
        // SAFETY: the codec is static; the context is owned from its allocation on.
        let ctx = NonNull::new(unsafe { ffi::avcodec_alloc_context3(codec.0) }).ok_or(AvError::NO_MEMORY)?;
        let mut this = Self { ctx, running: false, device: None };
        this.apply(&settings);
        if let Some(surfaces) = super::hardware::Surfaces::for_encoder(codec, &settings)? {
            // SAFETY: an unopened context of ours.
            unsafe { surfaces.attach(ctx.as_ptr())? };
            this.device = Some(surfaces);
        }
        // SAFETY: an unopened context and its own codec.
        check(unsafe { ffi::avcodec_open2(ctx.as_ptr(), codec.0, settings.options.as_mut_ptr()) })?;
        this.running = true;
        if settings.options.pairs().is_empty() { Ok(this) } else { Err(AvError(ffi::AVERROR_OPTION_NOT_FOUND)) }
    }

    fn apply(&mut self, s: &EncoderSettings) {
        use ffi::{
            AVChromaLocation as L, AVColorPrimaries as P, AVColorSpace as M, AVColorTransferCharacteristic as T,
        };
        // SAFETY: allocated, not open yet, and borrowed mutably.
        let c = unsafe { self.ctx.as_mut() };
        (c.width, c.height, c.pix_fmt) = (s.width as i32, s.height as i32, s.pix.raw());
        c.time_base = s.time_base.into();
        c.framerate = s.frame_rate.into();
        c.sample_aspect_ratio = s.sample_aspect.into();
        c.thread_count = s.threads as i32;
        c.field_order = ffi::AVFieldOrder::AV_FIELD_PROGRESSIVE;
        c.bit_rate = s.bit_rate.map_or(0, |r| i64::try_from(r).unwrap_or(i64::MAX));
        c.color_range = match s.color.full_range {
            None => ffi::AVColorRange::AVCOL_RANGE_UNSPECIFIED,
            Some(false) => ffi::AVColorRange::AVCOL_RANGE_MPEG,
            Some(true) => ffi::AVColorRange::AVCOL_RANGE_JPEG,
        };
        if s.global_header {
            c.flags |= ffi::AV_CODEC_FLAG_GLOBAL_HEADER as i32;
        }
        // SAFETY: the four fields are 32-bit enumerations; each number is written only if it lies within those that the
        // headers of the linked FFmpeg declare.
        unsafe {
            set_code(&raw mut c.color_primaries, s.color.primaries.into(), P::AVCOL_PRI_NB as i32);
            set_code(&raw mut c.color_trc, s.color.transfer.into(), T::AVCOL_TRC_NB as i32);
            set_code(&raw mut c.colorspace, s.color.matrix.into(), M::AVCOL_SPC_NB as i32);
            set_code(&raw mut c.chroma_sample_location, s.chroma_location, L::AVCHROMA_LOC_NB as i32);
        }
    }

    /// Hands over a picture; `None` announces the end.
    pub(crate) fn send(&mut self, frame: Option<&AvFrame>) -> Result<(), AvError> {
        let uploaded = match (&self.device, frame) {
            (Some(device), Some(frame)) => Some(device.upload(frame)?),
            _ => None,
        };
        self.running = frame.is_some();
        let raw = uploaded.as_ref().or(frame).map_or(ptr::null(), AvFrame::as_ptr);
        // SAFETY: an open context; the frame lives through the call, the encoder keeps its own reference.
        check(unsafe { ffi::avcodec_send_frame(self.ctx.as_ptr(), raw) }).map(|_| ())
    }

    /// The next packet; `Ok(false)` where more pictures are needed or the end is reached.
    pub(crate) fn receive(&mut self, packet: &mut Packet) -> Result<bool, AvError> {
        // SAFETY: an open context and a live packet, which FFmpeg blanks before it fills it.
        match check(unsafe { ffi::avcodec_receive_packet(self.ctx.as_ptr(), packet.as_mut_ptr()) }) {
            Ok(_) => Ok(true),
            Err(AvError::AGAIN | AvError::EOF) => Ok(false),
            Err(e) => Err(e),
        }
    }

    /// What decoders need besides the packets; empty where the packets have it.
    pub(crate) fn header(&self) -> &[u8] {
        // SAFETY: an open context.
        let (data, size) = unsafe { ((*self.ctx.as_ptr()).extradata, (*self.ctx.as_ptr()).extradata_size) };
        if data.is_null() || size <= 0 {
            return &[];
        }
        // SAFETY: an open encoder keeps its header, of that many bytes, until it is closed.
        unsafe { std::slice::from_raw_parts(data, size as usize) }
    }

    pub(super) fn as_ptr(&self) -> *const ffi::AVCodecContext {
        self.ctx.as_ptr()
    }
}

/// # Safety
/// `field` points to a 32-bit enumeration in which every number from 0 below `end`, holes apart, is a variant.
unsafe fn set_code<E>(field: *mut E, code: i32, end: i32) {
    const { assert!(size_of::<E>() == 4) };
    if (0..end).contains(&code) {
        // SAFETY: by contract; FFmpeg alone reads the field.
        unsafe { field.cast::<i32>().write(code) };
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // SVT-AV1 waits for its threads, which wait for the end of the stream: it must be announced and fetched.
        if self.running && self.send(None).is_ok() {
            let mut packet = Packet::new();
            while self.receive(&mut packet).unwrap_or(false) {}
        }
        let mut raw = self.ctx.as_ptr();
        // SAFETY: allocated by `avcodec_alloc_context3`, freed once.
        unsafe { ffi::avcodec_free_context(&raw mut raw) };
    }
}
