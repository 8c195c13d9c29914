//! Streaming decode: frames in display order, each with its own timestamp, memory independent of the clip's length.
//!
//! The frame's pixels are the decoder's own, reference-counted; they return to its pool when the frame is dropped. The
//! first picture is decoded when the clip is opened, because only decoded pixels show the stream's actual properties
//! (format, fields, HDR metadata inside the bitstream).
//!
//! Damaged packets do not end a clip. What the decoder conceals is marked [`Frame::corrupt`]; a picture that is lost
//! altogether is replaced by the one after it under its own time, so that the number of frames stays.

mod span;

use std::collections::VecDeque;

use super::av::{AvError, AvFrame, DOLBY_VISION, Decoder, Demuxer, Packet, Rational, StreamRef};
use super::clock::Clock;
use super::deinterlace::Deinterlacer;
use super::fields::FieldDetector;
use super::info::{FieldOrder, HdrBytes, Ratio, VideoInfo, orientation};
use super::losses::Losses;
use super::probe::kinds;
use super::unpack::{Unpacker, extra};
use super::{FrameSpan, Input, MediaError, ReadOptions, ReadReport};
use plumbline_image::{Frame, FrameBuffer};
use plumbline_num::run::Stopped;
use plumbline_num::time::{Timebase, Timestamp};

/// Consecutive errors of the decoder, without a packet or a picture in between, after which it counts as ended.
const MAX_BAD_PICTURES: u32 = 256;

/// Part of a clip's length that may be missing at its end without a word, and the least such length, s: lengths in headers are
/// rounded, and sound often ends a little later than the pictures.
const TOLERANCE: (f64, f64) = (0.02, 1.0);

/// A clip being decoded.
pub struct VideoReader {
    name: String,
    core: Core,
    unpacker: Unpacker,
    deinterlacer: Deinterlacer,
    fields: FieldDetector,
    info: VideoInfo,
    clock: Clock,
    span: Span,
    ready: VecDeque<Frame>,
    report: ReadReport,
    ended: bool,
    source: Input,
    /// The bytes of the file end before its container says.
    cut: bool,
    /// Where the last frame ends, ticks.
    reached: i64,
    /// The frames that must be read, where they are known, and the times of the first and the last that were.
    expected: Option<FrameSpan>,
    delivered: Option<(i64, i64)>,
    /// Reading began at a key frame before the expected frames.
    from_middle: bool,
    options: ReadOptions,
}

/// The part of the clip that is wanted, in ticks of the stream.
#[derive(Clone, Copy, Debug)]
struct Span {
    start: i64,
    end: i64,
}

impl VideoReader {
    /// Opens the clip and decodes its first picture.
    ///
    /// # Errors
    /// Everything that can be wrong with an input; see [`MediaError`].
    pub fn open(input: &Input, options: &ReadOptions) -> Result<Self, MediaError> {
        Self::open_frames(input, options, None, true)
    }

    fn open_frames(
        input: &Input,
        options: &ReadOptions,
        expected: Option<&FrameSpan>,
        seeks: bool,
    ) -> Result<Self, MediaError> {
        let name = input.name().to_owned();
        let demuxer = input.demux()?;
        let Some(stream) = input.video_of(&demuxer)? else {
            return Err(MediaError::NoVideo { found: kinds(&demuxer), path: name });
        };
        let span = match expected {
            Some(frames) => Span { start: frames.start, end: frames.end.unwrap_or(i64::MAX) },
            None => Span::of(input, &demuxer, stream),
        };
        let cut = input.is_cut(&demuxer);
        let mut core = Core::new(demuxer, stream, options.threads, &name)?;
        if seeks {
            core.seek(span.start);
        }
        let mut report = ReadReport::default();
        let Some(first) = core.next_within(span, &mut report)? else {
            return Err(nothing_decoded(input, &core));
        };
        if cut && options.strict && span.end == i64::MAX {
            return Err(MediaError::cut_short(&name, "the file is cut short: its container is longer than its bytes"));
        }
        let unpacker = Unpacker::new(&first, &name)?;
        let mut info = describe_video(input, &core, &first, &unpacker);
        if let Some(frames) = expected {
            info.frames_estimate = Some(frames.frames.len() as u64);
        }
        let clock = Clock::new(info.mean_ticks());
        let deinterlacer = Deinterlacer::new(options.deinterlace);
        let ready = VecDeque::new();
        let fields = FieldDetector::default();
        let mut this = Self {
            name,
            core,
            unpacker,
            deinterlacer,
            fields,
            info,
            clock,
            span,
            ready,
            report,
            ended: false,
            source: input.clone(),
            cut,
            reached: i64::MIN,
            expected: expected.cloned(),
            delivered: None,
            from_middle: expected.is_some() && seeks,
            options: *options,
        };
        this.accept(first)?;
        Ok(this)
    }

    /// What is known of the video.
    pub fn info(&self) -> &VideoInfo {
        &self.info
    }

    /// The next frame in display order; `None` at the end.
    ///
    /// # Errors
    /// [`MediaError::Input`] where the format changes, or a frame is interlaced and deinterlacing is refused;
    /// [`MediaError::NoMemory`].
    pub fn next_frame(&mut self) -> Result<Option<Frame>, MediaError> {
        self.prepare()?;
        if self.from_middle && self.is_doubtful() {
            self.read_from_start()?;
            self.prepare()?;
        }
        let frame = self.ready.pop_front();
        match (&frame, &self.expected) {
            (Some(frame), _) => {
                self.delivered = Some((self.delivered.map_or(frame.pts.0, |(first, _)| first), frame.pts.0));
            }
            (None, Some(span)) => self.check_span(span)?,
            (None, None) => {}
        }
        self.report.frames += u64::from(frame.is_some());
        self.report.corrupt += u64::from(frame.as_ref().is_some_and(|f| f.corrupt));
        Ok(frame)
    }

    /// What has become of the clip so far; complete after the last frame.
    pub fn report(&self) -> ReadReport {
        self.report
    }

    /// Decodes until a frame is ready, or the end is reached.
    fn prepare(&mut self) -> Result<(), MediaError> {
        while self.ready.is_empty() && !self.ended {
            match self.core.next_within(self.span, &mut self.report)? {
                Some(picture) => self.accept(picture)?,
                None => self.end()?,
            }
        }
        Ok(())
    }

    fn end(&mut self) -> Result<(), MediaError> {
        self.ended = true;
        self.report.lost = self.core.losses.at_end() as u64;
        self.report.unflagged_fields = self.fields.verdict();
        // Whatever is missing behind the end of the span was not asked for.
        self.report.truncated = !self.core.passed_span && (self.report.truncated || self.cut || self.is_incomplete());
        if self.report.truncated {
            let header = self.core.demuxer.announced_us().filter(|_| self.span.is_whole()).map(|us| us as f64 * 1e-6);
            let by_time = || header.zip(self.info.frame_rate).map(|(s, rate)| (s * rate.value()).round() as u64);
            self.report.announced = self.info.frames_estimate.or_else(by_time);
        }
        if self.report.bad_packets > 0 || self.report.truncated {
            tracing::warn!("{}: {}", self.name, self.report);
        }
        match self.report.shortfall().filter(|_| self.options.strict) {
            Some(shortfall) => Err(MediaError::cut_short(&self.name, &shortfall)),
            None => Ok(()),
        }
    }

    /// The container announces more than was read: packets by its index, or time by its header.
    fn is_incomplete(&self) -> bool {
        let index = self.info.frames_estimate.filter(|_| self.span.is_whole() && self.core.demuxer.counts_packets());
        index.is_some_and(|n| self.core.packets < n) || self.ends_early()
    }

    /// The header announces more time than was read, and no stream has anything there: sound may well go on longer.
    fn ends_early(&self) -> bool {
        let stream = self.core.demuxer.stream(self.core.stream);
        let Some(unit) = stream.time_base().value() else { return false };
        let (relative, least) = TOLERANCE;
        let Some(length) = self.core.demuxer.announced_us().map(|us| us as f64 * 1e-6) else { return false };
        let slack = (relative * length).max(least);
        let origin = self.core.demuxer.start_us().unwrap_or(0) as f64 * 1e-6;
        let end = origin + self.source.span().1.unwrap_or(length).min(length);
        let short = end - self.reached as f64 * unit > slack;
        short && (self.report.lost > 0 || !self.source.has_packets_at(end - slack))
    }

    fn accept(&mut self, picture: AvFrame) -> Result<(), MediaError> {
        let index = self.report.frames + self.ready.len() as u64;
        if let Some((was, now)) = self.unpacker.differs(&picture) {
            let help = "cut the clip there or bring it to one size first";
            let problem = format!("frame {index} is {now}, all before it are {was}; {help}");
            return Err(MediaError::input(&self.name, problem));
        }
        let lost = picture.best_pts().map(|t| self.core.losses.passed_over(t)).unwrap_or_default();
        let span = self.span;
        for pts in lost.into_iter().filter(|t| (span.start..span.end).contains(t)) {
            let share = picture.share().map_err(|e| MediaError::internal("repeating a frame", e))?;
            let mut repeated = self.deliver(share, index, Some(pts))?;
            repeated.corrupt = true;
            self.report.concealed += 1;
            self.ready.push_back(repeated);
        }
        let pts = picture.best_pts();
        let frame = self.deliver(picture, index, pts)?;
        self.ready.push_back(frame);
        Ok(())
    }

    fn deliver(&mut self, picture: AvFrame, index: u64, pts: Option<i64>) -> Result<Frame, MediaError> {
        let (color, corrupt, duration) = (picture.color(), picture.is_corrupt(), picture.duration());
        let extra = extra(&picture);
        let fields = picture.is_interlaced().then(|| picture.is_top_first());
        let planar = self.unpacker.unpack(picture)?;
        if fields.is_some() && self.deinterlacer.refuses() {
            let help = "allow deinterlacing, or convert it to progressive video first";
            return Err(MediaError::input(&self.name, format!("frame {index} is interlaced; {help}")));
        }
        if fields.is_none() && self.deinterlacer.trusts_flags() {
            let (size, bytes) = (planar.frame().size(), planar.format().bytes_per_sample());
            self.fields.push(planar.plane(0), size, bytes);
        }
        let planar = match self.deinterlacer.order(fields) {
            Some(top_first) => {
                self.report.deinterlaced += 1;
                self.deinterlacer.field(planar, top_first, self.unpacker.blank()?)
            }
            None => self.deinterlacer.whole(planar),
        };
        let (pts, retimed) = self.clock.tick(pts, duration);
        let length = if duration > 0 { duration } else { self.info.mean_ticks() };
        self.reached = self.reached.max(pts.saturating_add(length));
        self.report.retimed += u64::from(retimed);
        let (w, h) = (self.info.width, self.info.height);
        let mut frame = Frame::from_buffer(self.info.format, w, h, Box::new(planar));
        (frame.pts, frame.duration, frame.color) = (Timestamp(pts), duration, color);
        (frame.corrupt, frame.extra) = (corrupt, extra);
        Ok(frame)
    }
}

impl Span {
    fn of(input: &Input, demuxer: &Demuxer, stream: usize) -> Self {
        let base = demuxer.stream(stream).time_base();
        let (start, end) = input.span_us(demuxer);
        Self {
            start: start.map_or(i64::MIN, |t| Rational::MICRO.rescale(t, base)),
            end: end.map_or(i64::MAX, |t| Rational::MICRO.rescale(t, base)),
        }
    }

    fn is_whole(self) -> bool {
        self.start == i64::MIN && self.end == i64::MAX
    }
}

/// Demuxer and decoder of one stream.
struct Core {
    name: String,
    demuxer: Demuxer,
    decoder: Decoder,
    stream: usize,
    packet: Packet,
    losses: Losses,
    /// Packets of the stream that were read.
    packets: u64,
    pictures: u64,
    draining: bool,
    /// A picture behind the wanted span was seen.
    passed_span: bool,
    bad_pictures: u32,
}

impl Core {
    fn new(mut demuxer: Demuxer, stream: usize, threads: usize, name: &str) -> Result<Self, MediaError> {
        (0..demuxer.stream_count()).filter(|i| *i != stream).for_each(|i| demuxer.discard(i));
        let decoder = Decoder::open(demuxer.stream(stream), threads).map_err(|e| {
            let codec = demuxer.stream(stream).codec_name();
            let reason = format!("no decoder for {codec}: {}", super::error::reason(e));
            MediaError::NotMedia { path: name.to_owned(), reason }
        })?;
        let (packet, losses, name) = (Packet::new(), Losses::default(), name.to_owned());
        Ok(Self {
            name,
            demuxer,
            decoder,
            stream,
            packet,
            losses,
            packets: 0,
            pictures: 0,
            draining: false,
            passed_span: false,
            bad_pictures: 0,
        })
    }

    /// Goes near `start`; where the container cannot seek, everything before it is decoded and dropped.
    fn seek(&mut self, start: i64) {
        if start != i64::MIN && self.demuxer.seek(self.stream, start).is_ok() {
            self.decoder.flush();
        }
    }

    /// The next picture whose time lies in `span`; pictures without a time count as inside.
    fn next_within(&mut self, span: Span, report: &mut ReadReport) -> Result<Option<AvFrame>, MediaError> {
        while let Some(picture) = self.next_picture(report)? {
            match picture.best_pts() {
                Some(t) if t < span.start => drop(self.losses.passed_over(t)),
                Some(t) if t >= span.end => {
                    self.passed_span = true;
                    return Ok(None);
                }
                _ => return Ok(Some(picture)),
            }
        }
        Ok(None)
    }

    fn next_picture(&mut self, report: &mut ReadReport) -> Result<Option<AvFrame>, MediaError> {
        let mut picture = AvFrame::new();
        loop {
            match self.decoder.receive(&mut picture) {
                Ok(true) => {
                    self.pictures += 1;
                    self.bad_pictures = 0;
                    return Ok(Some(picture));
                }
                Ok(false) if self.draining => return Ok(None),
                Ok(false) => self.feed(report)?,
                Err(e) => {
                    self.complain(e, report)?;
                    self.bad_pictures += 1;
                    if self.bad_pictures > MAX_BAD_PICTURES {
                        return Ok(None);
                    }
                }
            }
        }
    }

    /// Hands the next packet of the stream, or the end, to the decoder.
    fn feed(&mut self, report: &mut ReadReport) -> Result<(), MediaError> {
        let sent = if self.read_packet(report)? {
            self.packets += 1;
            self.bad_pictures = 0;
            if let Some(pts) = self.packet.pts().filter(|_| !self.packet.is_discarded()) {
                self.losses.sent(pts);
            }
            report.bad_packets += u64::from(self.packet.is_corrupt());
            self.decoder.send(Some(&self.packet))
        } else {
            self.draining = true;
            self.decoder.send(None)
        };
        sent.or_else(|e| self.complain(e, report))
    }

    fn read_packet(&mut self, report: &mut ReadReport) -> Result<bool, MediaError> {
        loop {
            match self.demuxer.read(&mut self.packet) {
                Ok(true) if self.packet.stream() != self.stream => {}
                Ok(found) => return Ok(found),
                Err(AvError::INVALID_DATA) => {
                    report.bad_packets += 1;
                    self.losses.complained();
                }
                Err(AvError::EXIT) => return Err(Stopped::Interrupted.into()),
                Err(e) if self.pictures == 0 => return Err(self.read_error(e)),
                Err(_) => break,
            }
        }
        report.truncated = true;
        Ok(false)
    }

    /// Bad data are counted; anything else ends the reading.
    fn complain(&mut self, error: AvError, report: &mut ReadReport) -> Result<(), MediaError> {
        match error.errno() {
            Some(libc::ENOMEM) => Err(MediaError::NoMemory { what: format!("decoding {}", self.name) }),
            _ if error == AvError::EOF => Ok(()),
            _ => {
                report.bad_packets += 1;
                self.losses.complained();
                Ok(())
            }
        }
    }

    fn read_error(&self, error: AvError) -> MediaError {
        let (frames, reason) = (self.pictures, super::error::reason(error));
        MediaError::input(&self.name, format!("reading failed after {frames} frames: {reason}"))
    }
}

fn nothing_decoded(input: &Input, core: &Core) -> MediaError {
    let path = input.name().to_owned();
    if input.is_trimmed() && core.pictures > 0 {
        let (start, end) = input.span();
        let length = core.demuxer.duration_us().map_or(f64::NAN, |d| d as f64 * 1e-6);
        return MediaError::empty_span(&path, start, end.unwrap_or(f64::INFINITY), length);
    }
    MediaError::NoFrames { path, codec: core.demuxer.stream(core.stream).codec_name() }
}

fn describe_video(input: &Input, core: &Core, first: &AvFrame, unpacker: &Unpacker) -> VideoInfo {
    let stream = core.demuxer.stream(core.stream);
    let base = stream.time_base();
    let (rotation_deg, mirrored) = stream.display_matrix().map_or((0.0, false), |m| orientation(&m));
    let (width, height) = first.size();
    let order = if first.is_interlaced() { Some(first.is_top_first()) } else { stream.declared_field_order() };
    let (mastering, light) = first.hdr_bytes();
    let owned = |b: Option<&[u8]>| b.map(<[u8]>::to_vec);
    let frame_rate = Ratio::known(stream.average_rate()).or_else(|| Ratio::known(stream.base_rate()));
    let duration_s = span_seconds(input, &core.demuxer, core.stream);
    let of_span = || duration_s.zip(frame_rate).map(|(seconds, rate)| (seconds * rate.value()).round() as u64);
    VideoInfo {
        width,
        height,
        format: unpacker.format(),
        source_format: unpacker.source_format(),
        timebase: Timebase { num: base.num, den: base.den },
        frame_rate,
        sample_aspect: Ratio::known(stream.sample_aspect()).or_else(|| Ratio::known(first.sample_aspect())),
        rotation_deg,
        mirrored,
        color: first.color(),
        field_order: FieldOrder::from_top_first(order),
        codec: stream.codec_name(),
        frames_estimate: if input.is_trimmed() { of_span() } else { stream.frames() },
        duration_s,
        stream: core.stream,
        other_videos: core.demuxer.videos().filter(|i| *i != core.stream).collect(),
        chroma_location: first.chroma_location(),
        hdr: HdrBytes { mastering: owned(mastering), light: owned(light), dynamic: dynamic_hdr(stream, first) },
    }
}

/// Dynamic HDR metadata of the first frame, or announced by the container, by name.
fn dynamic_hdr(stream: StreamRef<'_>, first: &AvFrame) -> Vec<&'static str> {
    let mut found = first.dynamic_hdr();
    if stream.has_dolby_vision() && !found.contains(&DOLBY_VISION) {
        found.push(DOLBY_VISION);
    }
    found
}

/// Length of the wanted span, s.
fn span_seconds(input: &Input, demuxer: &Demuxer, stream: usize) -> Option<f64> {
    let stream = demuxer.stream(stream);
    let own = stream.duration().zip(stream.time_base().value()).map(|(d, unit)| d as f64 * unit);
    let whole = own.or_else(|| demuxer.duration_us().map(|d| d as f64 * 1e-6));
    let (start, end) = input.span();
    match (whole, end) {
        (Some(whole), end) => Some((end.unwrap_or(whole).min(whole) - start).max(0.0)),
        (None, Some(end)) => Some(end - start),
        (None, None) => None,
    }
}

impl std::fmt::Debug for VideoReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "VideoReader {{ {}: {} }}", self.name, self.unpacker.describe())
    }
}
