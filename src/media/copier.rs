//! Every other stream of the source, packet by packet, through a demuxer of its own.
//!
//! The decoder and the muxer run on different threads, tens of frames apart. Were packets handed from one to the other,
//! they would pile up in between; the source is opened a second time instead, and read just far enough ahead of the video.

use super::av::{AvError, Demuxer, Muxer, OutputFormat, Packet, Rational, StreamRef, SubtitleTranscoder};
use super::{Input, MediaError};

/// What happens to a stream of the source.
enum Way {
    Copied { out: usize },
    Converted { out: usize, transcoder: Box<SubtitleTranscoder> },
    Left,
}

/// Copies the other streams' packets into a muxer.
pub(super) struct Copier {
    clip: Input,
    demuxer: Demuxer,
    ways: Vec<Way>,
    packet: Packet,
    pending: bool,
    ended: bool,
    /// Wanted span on the source's clock and the start that everything moves by, µs.
    span: (Option<i64>, Option<i64>),
    pub(super) copied: u64,
}

impl Copier {
    /// A copier for `source`; streams are added by [`Copier::plan`].
    pub(super) fn open(source: &Input) -> Result<Self, MediaError> {
        let demuxer = source.demux()?;
        let span = source.span_us(&demuxer);
        let ways = (0..demuxer.stream_count()).map(|_| Way::Left).collect();
        Ok(Self {
            clip: source.clone(),
            demuxer,
            ways,
            packet: Packet::new(),
            pending: false,
            ended: false,
            span,
            copied: 0,
        })
    }

    pub(super) fn source(&self) -> &Demuxer {
        &self.demuxer
    }

    /// The clip that the packets come from.
    pub(super) fn clip(&self) -> &Input {
        &self.clip
    }

    /// Start of the wanted span on the source's clock, µs; everything moves by its negative.
    pub(super) fn start_us(&self) -> i64 {
        self.span.0.unwrap_or(0)
    }

    /// Adds stream `index` to `muxer` as `format` can hold it. Returns what is lost, in words.
    pub(super) fn plan(
        &mut self,
        index: usize,
        muxer: &mut Muxer,
        format: OutputFormat,
    ) -> Result<Option<String>, AvError> {
        let stream = self.demuxer.stream(index);
        if stream.is_chapter_track() {
            return Ok(None); // written anew from the chapters
        }
        if format.accepts(stream) {
            self.ways[index] = Way::Copied { out: muxer.add_copy(stream)? };
            return Ok(None);
        }
        let container = format.name();
        let name = describe(index, stream);
        let target = format.subtitle_encoder().filter(|_| stream.is_text_subtitle());
        if let Some(Ok(transcoder)) = target.map(|encoder| SubtitleTranscoder::open(stream, encoder)) {
            let out = muxer.add_subtitle(&transcoder, stream)?;
            self.ways[index] = Way::Converted { out, transcoder: Box::new(transcoder) };
            return Ok(None);
        }
        self.demuxer.discard(index);
        Ok(Some(format!("{name} is left out: {container} cannot hold it")))
    }

    /// Leaves stream `index` out: the video that is encoded anew.
    pub(super) fn skip(&mut self, index: usize) {
        self.demuxer.discard(index);
    }

    /// Writes all packets up to `until_us` on the result's clock; all that are left where `None`.
    pub(super) fn pump(&mut self, muxer: &mut Muxer, until_us: Option<i64>) -> Result<(), AvError> {
        while self.fetch() {
            let base = self.demuxer.stream(self.packet.stream()).time_base();
            let time = self.packet.dts().or(self.packet.pts()).map(|t| base.rescale(t, Rational::MICRO));
            let due = time.map(|t| t - self.start_us());
            if let (Some(due), Some(until)) = (due, until_us)
                && due > until
            {
                return Ok(());
            }
            self.pending = false;
            self.write(muxer, base)?;
        }
        Ok(())
    }

    /// Makes sure that a packet is waiting; false at the end.
    fn fetch(&mut self) -> bool {
        while !self.pending && !self.ended {
            match self.demuxer.read(&mut self.packet) {
                Ok(true) => self.pending = self.is_wanted(),
                Err(AvError::INVALID_DATA) => {}
                Ok(false) | Err(_) => self.ended = true,
            }
        }
        self.pending
    }

    fn is_wanted(&self) -> bool {
        let index = self.packet.stream();
        // Containers without a header may grow streams while they are read.
        if index >= self.ways.len() || matches!(self.ways[index], Way::Left) {
            return false;
        }
        let stream = self.demuxer.stream(index);
        let base = stream.time_base();
        let Some(pts) = self.packet.pts().or(self.packet.dts()).filter(|_| !stream.is_attached_picture()) else {
            return true;
        };
        let micro = |t| base.rescale(t, Rational::MICRO);
        let (start, end) = self.span;
        start.is_none_or(|s| micro(pts + self.packet.duration().max(1)) > s) && end.is_none_or(|e| micro(pts) < e)
    }

    fn write(&mut self, muxer: &mut Muxer, base: Rational) -> Result<(), AvError> {
        let index = self.packet.stream();
        let shift = Rational::MICRO.rescale(-self.start_us(), base);
        let picture = self.demuxer.stream(index).is_attached_picture();
        let (out, mut packet) = match &mut self.ways[index] {
            Way::Left => return Ok(()),
            Way::Copied { out } => (*out, std::mem::replace(&mut self.packet, Packet::new())),
            Way::Converted { out, transcoder } => match transcoder.convert(&mut self.packet)? {
                Some(packet) => (*out, packet),
                None => return Ok(()),
            },
        };
        if picture {
            packet.set_times(Some(0), Some(0));
        } else {
            packet.shift(shift);
        }
        packet.rescale(base, muxer.time_base(out));
        packet.set_stream(out);
        self.copied += 1;
        muxer.write(&mut packet)
    }
}

/// A stream in words, as warnings name it.
fn describe(index: usize, stream: StreamRef<'_>) -> String {
    let kind = super::probe::kind_name(stream);
    let codec = if stream.codec_known() { stream.codec_name() } else { "unknown codec".into() };
    let language = stream.metadata().into_iter().find(|(k, _)| k == "language").map(|(_, v)| format!(", {v}"));
    format!("stream {index} ({kind}, {codec}{})", language.unwrap_or_default())
}
