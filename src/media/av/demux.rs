//! Reading packets from a container.

use std::ffi::{CStr, CString};
use std::fs::File;
use std::io::Cursor;
use std::ptr::{self, NonNull};
use std::sync::Arc;

use ffmpeg_next::ffi;

use super::dict::{c_string, pairs, string};
use super::error::check;
use super::io::{Bytes, FileIo, Guard, Nested, close_nested, interrupted, open_nested};
use super::packet::some_ts;
use super::{AvError, Dictionary, Packet, Rational, StreamRef};
use plumbline_num::run::Interrupt;

/// Containers and elementary streams that hold everything in one file, by FFmpeg's short names. Left out is what reads or
/// names other files (playlists, manifests, session descriptions, edit lists, subtitles with an index), devices, pictures
/// and text that FFmpeg draws.
const CONTAINERS: &[&str] = &[
    // Containers of video.
    "mov",
    "mp4",
    "matroska",
    "webm",
    "avi",
    "mpegts",
    "mpeg",
    "flv",
    "live_flv",
    "asf",
    "asf_o",
    "mxf",
    "gxf",
    "ogg",
    "nut",
    "wtv",
    "rm",
    "nsv",
    "swf",
    "dv",
    "lxf",
    "pva",
    "ty",
    "nuv",
    "dhav",
    "cine",
    "gif",
    "apng",
    "smjpeg",
    "mpjpeg",
    "pmp",
    // Video without a container.
    "yuv4mpegpipe",
    "ivf",
    "obu",
    "h261",
    "h263",
    "h264",
    "hevc",
    "m4v",
    "mpegvideo",
    "cavsvideo",
    "avs2",
    "avs3",
    "vc1",
    "vc1test",
    "dirac",
    "dnxhd",
    "mjpeg",
    "mjpeg_2000",
    "flic",
    // Sound, which `probe` describes and results may take.
    "wav",
    "w64",
    "mp3",
    "flac",
    "aac",
    "ac3",
    "eac3",
    "aiff",
    "caf",
    "dts",
    "dtshd",
    "truehd",
    "mlp",
    "amr",
    "au",
    "tta",
    "ape",
    "wv",
    "tak",
    "loas",
    "voc",
];

/// Consecutive read errors after which a file counts as ended: a demuxer without progress would never stop.
const MAX_BAD_READS: u32 = 256;

/// What FFmpeg takes a file for.
#[derive(Clone, Copy)]
pub(crate) struct InputFormat(&'static ffi::AVInputFormat);

impl InputFormat {
    /// Recognizes the beginning of `file`; `extension` is a hint for streams without a signature.
    pub(crate) fn recognize(file: File, extension: &str, guard: &Guard) -> Result<Self, AvError> {
        super::log::install();
        let name = hint(extension);
        let mut found: *const ffi::AVInputFormat = ptr::null();
        // SAFETY: the guard outlives the io, which lives through the call; a format that is found is static.
        unsafe {
            let io = FileIo::new(Box::new(file), guard)?;
            let code = ffi::av_probe_input_buffer2(io.as_ptr(), &raw mut found, name.as_ptr(), ptr::null_mut(), 0, 0);
            check(code).map_err(|e| guard.stopped().unwrap_or(e))?;
            found.as_ref().map(Self).ok_or(AvError::INVALID_DATA)
        }
    }

    /// The format of that short name.
    pub(crate) fn named(name: &CStr) -> Option<Self> {
        // SAFETY: zero-terminated; null or a static format comes back.
        unsafe { ffi::av_find_input_format(name.as_ptr()).as_ref() }.map(Self)
    }

    /// Short names, separated by commas.
    pub(crate) fn name(self) -> String {
        // SAFETY: a static name.
        unsafe { string(self.0.name) }
    }

    pub(crate) fn long_name(self) -> String {
        // SAFETY: as above.
        unsafe { string(self.0.long_name) }
    }

    /// Everything that such a file shows is in it.
    pub(crate) fn is_container(self) -> bool {
        self.name().split(',').any(|name| CONTAINERS.contains(&name))
    }
}

/// A name that carries nothing but an extension.
fn hint(extension: &str) -> CString {
    let plain = extension.len() <= 8 && extension.bytes().all(|b| b.is_ascii_alphanumeric());
    c_string(&if plain { format!("clip.{extension}") } else { "clip".to_owned() })
}

/// An open input container.
pub(crate) struct Demuxer {
    ctx: NonNull<ffi::AVFormatContext>,
    bad_reads: u32,
    /// Dropped after the context, and before the guard.
    _io: Option<FileIo>,
    guard: Arc<Guard>,
}

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
    /// Opens `file`, which is of `format` and has this extension, and reads enough to know every stream.
    pub(crate) fn open(file: File, extension: &str, format: InputFormat, guard: Arc<Guard>) -> Result<Self, AvError> {
        Self::open_as(Some(Box::new(file)), &hint(extension), format, Dictionary::new(), guard)
    }

    /// Whether a file of these bytes can be opened.
    pub(super) fn opens(bytes: Vec<u8>, format: InputFormat) -> bool {
        let guard = Guard::new(&Interrupt::default(), Nested::Refused, bytes.len() as u64);
        Self::open_as(Some(Box::new(Cursor::new(bytes))), c"trial", format, Dictionary::new(), guard).is_ok()
    }

    /// Opens what names other files: `url` is what their names are relative to, and the guard says which may be opened.
    pub(crate) fn open_as(
        file: Option<Box<dyn Bytes>>,
        url: &CStr,
        format: InputFormat,
        options: Dictionary,
        guard: Arc<Guard>,
    ) -> Result<Self, AvError> {
        super::log::install();
        let formats = format!("{},{}", CONTAINERS.join(","), format.name());
        let mut options = options.with("format_whitelist", &formats);
        // SAFETY: the guard lives as long as the io; nothing else keeps it.
        let io = file.map(|file| unsafe { FileIo::new(file, Arc::as_ptr(&guard)) }).transpose()?;
        // SAFETY: the context is ours until `avformat_open_input`, which frees it on failure and else leaves it to `Self`;
        // io and guard are on the heap and outlive it; all strings end with zero and outlive the calls.
        unsafe {
            let mut raw = ffi::avformat_alloc_context();
            let ctx = raw.as_mut().ok_or(AvError::NO_MEMORY)?;
            ctx.pb = io.as_ref().map_or(ptr::null_mut(), FileIo::as_ptr);
            ctx.opaque = Arc::as_ptr(&guard).cast_mut().cast();
            ctx.interrupt_callback = ffi::AVIOInterruptCB { callback: Some(interrupted), opaque: ctx.opaque };
            ctx.io_open = Some(open_nested);
            ctx.io_close2 = Some(close_nested);
            let opened = ffi::avformat_open_input(&raw mut raw, url.as_ptr(), format.0, options.as_mut_ptr());
            check(opened).map_err(|e| guard.stopped().unwrap_or(e))?;
            let ctx = NonNull::new(raw).ok_or(AvError::NO_MEMORY)?;
            let this = Self { ctx, bad_reads: 0, _io: io, guard };
            check(ffi::avformat_find_stream_info(raw, ptr::null_mut()))
                .map_err(|e| this.guard.stopped().unwrap_or(e))?;
            match this.guard.stopped() {
                Some(stopped) => Err(stopped),
                None => Ok(this),
            }
        }
    }

    fn get(&self) -> &ffi::AVFormatContext {
        // SAFETY: opened in `open`, closed only in `drop`.
        unsafe { self.ctx.as_ref() }
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

    /// The streams that show moving pictures.
    pub(crate) fn videos(&self) -> impl Iterator<Item = usize> {
        (0..self.stream_count()).filter(|i| self.is_video(*i))
    }

    /// Stream `i` is there and shows moving pictures.
    pub(crate) fn is_video(&self, i: usize) -> bool {
        i < self.stream_count() && self.stream(i).kind() == super::Kind::Video && !self.stream(i).is_attached_picture()
    }

    /// The video stream that FFmpeg finds most worth showing; attached pictures are never chosen.
    ///
    /// FFmpeg compares the flag "default", then how many frames it has seen, then the bit rate. Where the container has no bit
    /// rates, it would take the first of several; the largest picture is taken then, as FFmpeg's own program does.
    pub(crate) fn best_video(&self) -> Option<usize> {
        let kind = ffi::AVMediaType::AVMEDIA_TYPE_VIDEO;
        // SAFETY: a live context; no decoder is asked for.
        let best = unsafe { ffi::av_find_best_stream(self.ctx.as_ptr(), kind, -1, -1, ptr::null_mut(), 0) };
        let best = usize::try_from(best).ok().filter(|i| self.is_video(*i)).or_else(|| self.videos().next())?;
        let equal = |i: &usize| {
            let (a, b) = (self.stream(*i), self.stream(best));
            a.is_default() == b.is_default() && a.bit_rate().is_none() && b.bit_rate().is_none()
        };
        let pixels = |i: usize| {
            let (width, height) = self.stream(i).size();
            i64::from(width) * i64::from(height)
        };
        let larger = self.videos().filter(equal).filter(|i| pixels(*i) > pixels(best));
        Some(larger.fold(best, |a, b| if pixels(b) > pixels(a) { b } else { a }))
    }

    /// Skips the packets of stream `i` while reading.
    pub(crate) fn discard(&mut self, i: usize) {
        assert!(i < self.stream_count(), "stream {i} of {}", self.stream_count());
        // SAFETY: in range; `&mut self` excludes readers.
        unsafe { (**self.ctx.as_ref().streams.add(i)).discard = ffi::AVDiscard::AVDISCARD_ALL };
    }

    /// The next packet; `Ok(false)` at the end. After [`AvError::INVALID_DATA`] the caller may go on reading; there is an end
    /// to such errors.
    pub(crate) fn read(&mut self, packet: &mut Packet) -> Result<bool, AvError> {
        packet.clear();
        // SAFETY: a live context and a blank packet.
        let code = check(unsafe { ffi::av_read_frame(self.ctx.as_ptr(), packet.as_mut_ptr()) });
        if let Some(stopped) = self.guard.stopped() {
            return Err(stopped);
        }
        match code {
            Ok(_) => {
                self.bad_reads = 0;
                self.guard.progressed();
                Ok(true)
            }
            Err(AvError::EOF) => Ok(false),
            Err(AvError::INVALID_DATA | AvError::AGAIN) if self.bad_reads < MAX_BAD_READS => {
                self.bad_reads += 1;
                Err(AvError::INVALID_DATA)
            }
            Err(AvError::INVALID_DATA | AvError::AGAIN) => Err(AvError::NO_PROGRESS),
            Err(e) => Err(e),
        }
    }

    /// Goes to the last key frame of `stream` at or before `ts`.
    pub(crate) fn seek(&mut self, stream: usize, ts: i64) -> Result<(), AvError> {
        // SAFETY: a live context.
        let code = unsafe { ffi::av_seek_frame(self.ctx.as_ptr(), stream as i32, ts, ffi::AVSEEK_FLAG_BACKWARD) };
        check(code).map(|_| ()).map_err(|e| self.guard.stopped().unwrap_or(e))
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

    /// Length of the file that its header announces, µs; `None` where FFmpeg measured or guessed it from what is there.
    pub(crate) fn announced_us(&self) -> Option<i64> {
        let by_header = ffi::AVDurationEstimationMethod::AVFMT_DURATION_FROM_STREAM;
        self.duration_us().filter(|_| self.get().duration_estimation_method == by_header)
    }

    /// The number of frames of a stream is that of its packets. With edit lists it is not: those outside are left out.
    pub(crate) fn counts_packets(&self) -> bool {
        !self.format_name().split(',').any(|name| name == "mov")
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
        let mut raw = self.ctx.as_ptr();
        // SAFETY: opened by `avformat_open_input`, closed once; its io and its guard are dropped afterwards.
        unsafe { ffi::avformat_close_input(&raw mut raw) };
    }
}
