//! Writing packets into a container.

use std::ffi::{CStr, OsStr};
use std::ptr::{self, NonNull};

use ffmpeg_next::ffi;

use super::demux::InputFormat;
use super::dict::{c_path, c_string, string};
use super::error::check;
use super::{AvError, Chapter, Demuxer, Dictionary, Encoder, Packet, Rational, StreamRef};
use crate::Codec;

/// A container that FFmpeg can write.
#[derive(Clone, Copy)]
pub(crate) struct OutputFormat(&'static ffi::AVOutputFormat);

impl OutputFormat {
    /// The container of that short name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        let name = c_string(name);
        // SAFETY: zero-terminated or null; null or a static format comes back.
        unsafe { ffi::av_guess_format(name.as_ptr(), ptr::null(), ptr::null()).as_ref() }.map(Self)
    }

    /// The container of a file name's extension.
    pub(crate) fn for_file(file_name: &str) -> Option<Self> {
        let name = c_string(file_name);
        // SAFETY: as above.
        unsafe { ffi::av_guess_format(ptr::null(), name.as_ptr(), ptr::null()).as_ref() }.map(Self)
    }

    pub(crate) fn name(self) -> String {
        // SAFETY: a static name.
        unsafe { string(self.0.name) }
    }

    /// False for a codec that the container does not hold; what FFmpeg does not know is tried.
    pub(crate) fn holds(self, codec: Codec) -> bool {
        let id = match codec {
            Codec::H264 => ffi::AVCodecID::AV_CODEC_ID_H264,
            Codec::Hevc => ffi::AVCodecID::AV_CODEC_ID_HEVC,
            Codec::Av1 => ffi::AVCodecID::AV_CODEC_ID_AV1,
            Codec::Prores => ffi::AVCodecID::AV_CODEC_ID_PRORES,
            Codec::Ffv1 => ffi::AVCodecID::AV_CODEC_ID_FFV1,
        };
        // SAFETY: a static format.
        unsafe { ffi::avformat_query_codec(self.0, id, ffi::FF_COMPLIANCE_NORMAL) != 0 }
    }

    /// Codec headers are separate from the packets.
    pub(crate) fn wants_global_header(self) -> bool {
        self.0.flags & ffi::AVFMT_GLOBALHEADER != 0
    }

    /// The muxer opens its files itself (image sequences).
    pub(crate) fn opens_own_files(self) -> bool {
        self.0.flags & ffi::AVFMT_NOFILE != 0
    }

    /// The encoder of text subtitles that the container takes, where it takes any.
    pub(crate) fn subtitle_encoder(self) -> Option<&'static str> {
        match self.name().as_str() {
            "mp4" | "mov" | "ipod" => Some("mov_text"),
            "matroska" => Some("srt"),
            "webm" => Some("webvtt"),
            _ => None,
        }
    }

    /// Whether the container can hold `stream` as it is, found by trying to write a header with it alone.
    ///
    /// A header of MP4 is read back, too: FFmpeg writes there what it then refuses the whole file for, such as a damaged description of AAC.
    pub(crate) fn accepts(self, stream: StreamRef<'_>) -> bool {
        if !stream.codec_known() || self.header_of(&[stream], Dictionary::new()).is_err() {
            return false;
        }
        let Some(reader) = InputFormat::named(c"mov").filter(|_| self.is_mp4()) else { return true };
        // A file of fragments has the descriptions first, before any packet. FFmpeg makes those of some codecs of packets: then it has no header.
        let header = self.header_of(&[stream], Dictionary::new().with("movflags", "+empty_moov"));
        header.map_or(true, |bytes| Demuxer::opens(bytes, reader))
    }

    /// Whether the container can hold `stream` beside another video.
    pub(crate) fn accepts_as_second(self, stream: StreamRef<'_>) -> bool {
        self.header_of(&[stream, stream], Dictionary::new()).is_ok()
    }

    /// The header of a file of copies of these streams.
    fn header_of(self, streams: &[StreamRef<'_>], options: Dictionary) -> Result<Vec<u8>, AvError> {
        let mut muxer = Muxer::in_memory(self)?;
        for stream in streams {
            muxer.add_copy(*stream)?;
        }
        muxer.write_header(options)?;
        Ok(muxer.take_bytes())
    }

    /// MP4 and the formats that are built like it, which one reader reads.
    fn is_mp4(self) -> bool {
        matches!(self.name().as_str(), "mp4" | "mov" | "ipod" | "3gp" | "3g2" | "psp" | "f4v")
    }
}

/// Where the bytes go, and who closes it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sink {
    File,
    Memory,
    OwnFiles,
}

/// An output container under construction.
pub(crate) struct Muxer {
    ctx: NonNull<ffi::AVFormatContext>,
    sink: Sink,
}

// SAFETY: one owner; libavformat contexts may move between threads as long as one at a time uses them.
unsafe impl Send for Muxer {}

impl Muxer {
    /// Starts a file at `url`, which is created or cut to nothing.
    pub(crate) fn create(format: OutputFormat, url: &OsStr) -> Result<Self, AvError> {
        super::log::install();
        let url = c_path(url);
        let mut this = Self::allocate(format, &url)?;
        if format.opens_own_files() {
            return Ok(this);
        }
        // SAFETY: a live context without io; on success it holds the io that `drop` closes.
        check(unsafe { ffi::avio_open(&raw mut (*this.ctx.as_ptr()).pb, url.as_ptr(), ffi::AVIO_FLAG_WRITE) })?;
        this.sink = Sink::File;
        Ok(this)
    }

    fn in_memory(format: OutputFormat) -> Result<Self, AvError> {
        let mut this = Self::allocate(format, c"trial")?;
        if !format.opens_own_files() {
            // SAFETY: a live context without io; the buffer is released in `drop`.
            check(unsafe { ffi::avio_open_dyn_buf(&raw mut (*this.ctx.as_ptr()).pb) })?;
            this.sink = Sink::Memory;
        }
        Ok(this)
    }

    fn allocate(format: OutputFormat, url: &CStr) -> Result<Self, AvError> {
        let mut raw = ptr::null_mut();
        // SAFETY: a static format and a zero-terminated name, copied by FFmpeg.
        check(unsafe { ffi::avformat_alloc_output_context2(&raw mut raw, format.0, ptr::null(), url.as_ptr()) })?;
        Ok(Self { ctx: NonNull::new(raw).ok_or(AvError::NO_MEMORY)?, sink: Sink::OwnFiles })
    }

    fn new_stream(&mut self) -> Result<&mut ffi::AVStream, AvError> {
        // SAFETY: a live context whose header is not written; the stream lives as long as the context.
        unsafe { ffi::avformat_new_stream(self.ctx.as_ptr(), ptr::null()).as_mut() }.ok_or(AvError::NO_MEMORY)
    }

    /// Adds the stream that `encoder` feeds, with the source's tags, disposition and picture-wide side data.
    pub(crate) fn add_encoded(&mut self, encoder: &Encoder, source: StreamRef<'_>) -> Result<usize, AvError> {
        let stream = self.new_stream()?;
        // SAFETY: a fresh stream and an open encoder; both live through the calls.
        unsafe {
            check(ffi::avcodec_parameters_from_context(stream.codecpar, encoder.as_ptr()))?;
            stream.time_base = (*encoder.as_ptr()).time_base;
            stream.avg_frame_rate = (*encoder.as_ptr()).framerate;
            stream.sample_aspect_ratio = (*encoder.as_ptr()).sample_aspect_ratio;
            for kind in KEPT_SIDE_DATA {
                if let Some(bytes) = source.side_data(kind) {
                    put_side_data(stream, kind, bytes)?;
                }
            }
        }
        let tags = source.metadata().into_iter().filter(|(k, _)| !ENCODING_TAGS.contains(&k.as_str()));
        set_tags(&mut stream.metadata, tags.collect());
        stream.disposition = source.0.disposition;
        Ok(stream.index as usize)
    }

    /// Adds a stream whose packets are copied.
    pub(crate) fn add_copy(&mut self, source: StreamRef<'_>) -> Result<usize, AvError> {
        let stream = self.new_stream()?;
        // SAFETY: a fresh stream and a live source; the parameters are copied deeply.
        unsafe {
            check(ffi::avcodec_parameters_copy(stream.codecpar, source.par()))?;
            (*stream.codecpar).codec_tag = 0; // the tag of another container may mean something else in this one
            for i in 0..source.0.nb_side_data.max(0) as usize {
                let side = &*source.0.side_data.add(i);
                put_side_data(stream, side.type_, std::slice::from_raw_parts(side.data, side.size))?;
            }
        }
        stream.time_base = source.0.time_base;
        stream.avg_frame_rate = source.0.avg_frame_rate;
        stream.sample_aspect_ratio = source.0.sample_aspect_ratio;
        stream.disposition = source.0.disposition;
        set_tags(&mut stream.metadata, source.metadata());
        Ok(stream.index as usize)
    }

    /// Adds a text subtitle stream that `transcoder` feeds.
    pub(crate) fn add_subtitle(
        &mut self,
        transcoder: &super::SubtitleTranscoder,
        source: StreamRef<'_>,
    ) -> Result<usize, AvError> {
        let stream = self.new_stream()?;
        // SAFETY: a fresh stream and an open encoder.
        check(unsafe { ffi::avcodec_parameters_from_context(stream.codecpar, transcoder.encoder_ptr()) })?;
        stream.time_base = source.0.time_base;
        stream.disposition = source.0.disposition;
        set_tags(&mut stream.metadata, source.metadata());
        Ok(stream.index as usize)
    }

    /// Gives stream `index` HDR mastering and content light data, as FFmpeg stores them.
    pub(crate) fn set_hdr(
        &mut self,
        index: usize,
        mastering: Option<&[u8]>,
        light: Option<&[u8]>,
    ) -> Result<(), AvError> {
        use ffi::AVPacketSideDataType as T;
        let stream = self.stream_mut(index);
        for (kind, bytes) in
            [(T::AV_PKT_DATA_MASTERING_DISPLAY_METADATA, mastering), (T::AV_PKT_DATA_CONTENT_LIGHT_LEVEL, light)]
        {
            if let Some(bytes) = bytes {
                // SAFETY: a live stream; the bytes are FFmpeg's own structure of that type.
                unsafe { put_side_data(stream, kind, bytes)? };
            }
        }
        Ok(())
    }

    fn stream_mut(&mut self, index: usize) -> &mut ffi::AVStream {
        // SAFETY: a live context, borrowed mutably.
        let ctx = unsafe { self.ctx.as_mut() };
        assert!(index < ctx.nb_streams as usize, "stream {index} of {}", ctx.nb_streams);
        // SAFETY: the array holds `nb_streams` live streams.
        unsafe { &mut **ctx.streams.add(index) }
    }

    /// Sets the tags of the whole file.
    pub(crate) fn set_metadata(&mut self, tags: Vec<(String, String)>) {
        // SAFETY: a live context, borrowed mutably.
        set_tags(&mut unsafe { self.ctx.as_mut() }.metadata, tags);
    }

    /// Sets the chapters; FFmpeg frees them with the context.
    pub(crate) fn set_chapters(&mut self, chapters: &[Chapter]) -> Result<(), AvError> {
        if chapters.is_empty() {
            return Ok(());
        }
        let bytes = |n: usize| n * size_of::<*mut ffi::AVChapter>();
        // SAFETY: both allocations are zeroed and of the size of what is stored in them; the count follows the entries,
        // so that FFmpeg frees exactly those that are there.
        unsafe {
            let ctx = self.ctx.as_mut();
            ctx.chapters = ffi::av_mallocz(bytes(chapters.len())).cast();
            if ctx.chapters.is_null() {
                return Err(AvError::NO_MEMORY);
            }
            for chapter in chapters {
                let raw = ffi::av_mallocz(size_of::<ffi::AVChapter>()).cast::<ffi::AVChapter>();
                let c = raw.as_mut().ok_or(AvError::NO_MEMORY)?;
                c.id = chapter.id;
                c.time_base = chapter.time_base.into();
                (c.start, c.end) = (chapter.start, chapter.end);
                set_tags(&mut c.metadata, chapter.metadata.clone());
                *ctx.chapters.add(ctx.nb_chapters as usize) = raw;
                ctx.nb_chapters += 1;
            }
        }
        Ok(())
    }

    /// Writes the header; the streams' time bases are the container's from here on.
    ///
    /// Without the random identifiers of Matroska and the version of FFmpeg: the same streams give the same bytes.
    pub(crate) fn write_header(&mut self, mut options: Dictionary) -> Result<(), AvError> {
        options.set("fflags", "+bitexact");
        // SAFETY: a live context with its streams added.
        check(unsafe { ffi::avformat_write_header(self.ctx.as_ptr(), options.as_mut_ptr()) }).map(|_| ())
    }

    /// Time base of stream `index`.
    pub(crate) fn time_base(&mut self, index: usize) -> Rational {
        self.stream_mut(index).time_base.into()
    }

    /// Two packets of a stream may have the same time.
    pub(crate) fn allows_equal_times(&self) -> bool {
        // SAFETY: a live context with a static format.
        unsafe { (*self.ctx.as_ref().oformat).flags & ffi::AVFMT_TS_NONSTRICT != 0 }
    }

    /// Writes a packet, in the stream's time base, sorted in among the other streams. The packet is blank afterwards.
    pub(crate) fn write(&mut self, packet: &mut Packet) -> Result<(), AvError> {
        // SAFETY: a live context after its header; the packet's reference is taken over.
        check(unsafe { ffi::av_interleaved_write_frame(self.ctx.as_ptr(), packet.as_mut_ptr()) })?;
        self.io_state()
    }

    /// Errors that the io layer has met so far, which FFmpeg's muxers may report late.
    fn io_state(&self) -> Result<(), AvError> {
        // SAFETY: a live context; its io is null or alive.
        let pb = unsafe { self.ctx.as_ref().pb.as_ref() };
        check(pb.map_or(0, |pb| pb.error)).map(|_| ())
    }

    /// Writes the trailer and closes the file.
    pub(crate) fn finish(mut self) -> Result<(), AvError> {
        // SAFETY: a live context after its header.
        check(unsafe { ffi::av_write_trailer(self.ctx.as_ptr()) })?;
        self.io_state()?;
        self.close()
    }

    fn close(&mut self) -> Result<(), AvError> {
        let sink = std::mem::replace(&mut self.sink, Sink::OwnFiles);
        // SAFETY: a live context whose io is of the kind that `sink` says, released once.
        unsafe {
            let pb = &raw mut (*self.ctx.as_ptr()).pb;
            match sink {
                Sink::OwnFiles => Ok(()),
                Sink::File => check(ffi::avio_closep(pb)).map(|_| ()),
                Sink::Memory => {
                    ffi::av_free(close_buffer(pb).0.cast());
                    Ok(())
                }
            }
        }
    }

    /// What was written to memory; nothing more can be written.
    fn take_bytes(&mut self) -> Vec<u8> {
        if self.sink != Sink::Memory {
            return Vec::new();
        }
        self.sink = Sink::OwnFiles;
        // SAFETY: a live context whose io is a buffer, closed once; its bytes are copied, then freed.
        unsafe {
            let (bytes, length) = close_buffer(&raw mut (*self.ctx.as_ptr()).pb);
            let copy = if bytes.is_null() { Vec::new() } else { std::slice::from_raw_parts(bytes, length).to_vec() };
            ffi::av_free(bytes.cast());
            copy
        }
    }
}

impl Drop for Muxer {
    fn drop(&mut self) {
        let _ = self.close(); // whoever wanted to know called `finish`
        // SAFETY: allocated by `avformat_alloc_output_context2`, freed once.
        unsafe { ffi::avformat_free_context(self.ctx.as_ptr()) };
    }
}

/// Closes a buffer in memory and gives its bytes and their number to the caller, who frees them.
///
/// # Safety
/// `pb` is of `avio_open_dyn_buf`.
unsafe fn close_buffer(pb: *mut *mut ffi::AVIOContext) -> (*mut u8, usize) {
    let mut bytes = ptr::null_mut();
    // SAFETY: open, as the caller says, and not used any more.
    unsafe {
        let length = ffi::avio_close_dyn_buf(*pb, &raw mut bytes);
        *pb = ptr::null_mut();
        (bytes, usize::try_from(length).unwrap_or(0))
    }
}

/// Side data of the source video that stay true for the encoded one; others describe the old bitstream.
const KEPT_SIDE_DATA: [ffi::AVPacketSideDataType; 5] = [
    ffi::AVPacketSideDataType::AV_PKT_DATA_DISPLAYMATRIX,
    ffi::AVPacketSideDataType::AV_PKT_DATA_MASTERING_DISPLAY_METADATA,
    ffi::AVPacketSideDataType::AV_PKT_DATA_CONTENT_LIGHT_LEVEL,
    ffi::AVPacketSideDataType::AV_PKT_DATA_STEREO3D,
    ffi::AVPacketSideDataType::AV_PKT_DATA_SPHERICAL,
];

/// Tags that describe the old bitstream.
const ENCODING_TAGS: [&str; 8] = [
    "encoder",
    "BPS",
    "BPS-eng",
    "NUMBER_OF_BYTES",
    "NUMBER_OF_BYTES-eng",
    "NUMBER_OF_FRAMES",
    "DURATION",
    "vendor_id",
];

fn set_tags(slot: &mut *mut ffi::AVDictionary, tags: Vec<(String, String)>) {
    let mut old = std::mem::replace(slot, tags.into_iter().collect::<Dictionary>().into_raw());
    // SAFETY: the dictionary that stood in a structure of FFmpeg's, or null; nothing else points to it.
    unsafe { ffi::av_dict_free(&raw mut old) };
}

/// # Safety
/// `bytes` are what FFmpeg expects for `kind`.
unsafe fn put_side_data(
    stream: &mut ffi::AVStream,
    kind: ffi::AVPacketSideDataType,
    bytes: &[u8],
) -> Result<(), AvError> {
    // SAFETY: a live stream; the result is null or writable for the size asked for.
    unsafe {
        let data = ffi::av_stream_new_side_data(stream, kind, bytes.len());
        if data.is_null() {
            return Err(AvError::NO_MEMORY);
        }
        ptr::copy_nonoverlapping(bytes.as_ptr(), data, bytes.len());
    }
    Ok(())
}
