//! Every other stream of the source, packet by packet, through a demuxer of its own.
//!
//! The decoder and the muxer run on different threads, tens of frames apart. Were packets handed from one to the other,
//! they would pile up in between; the source is opened a second time instead, and read just far enough ahead of the video.

use super::av::{AvError, Demuxer, Muxer, OutputFormat, Packet, Rational, StreamRef, SubtitleTranscoder};
use super::packet_times::PacketTimes;
use super::{Input, MediaError};

/// What happens to a stream of the source.
enum Way {
    Copied { out: usize, times: Option<PacketTimes> },
    Converted { out: usize, times: Option<PacketTimes>, transcoder: Box<SubtitleTranscoder> },
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
    /// Packets that the muxer or the converter refused, by stream.
    refused: Vec<u64>,
    /// Streams whose decoder's header changes on the way.
    changed: Vec<bool>,
    pub(super) copied: u64,
}

impl Copier {
    /// A copier for `source`; streams are added by [`Copier::plan`].
    pub(super) fn open(source: &Input) -> Result<Self, MediaError> {
        let demuxer = source.demux()?;
        let span = source.span_us(&demuxer);
        let ways: Vec<Way> = (0..demuxer.stream_count()).map(|_| Way::Left).collect();
        let (refused, changed) = (vec![0; ways.len()], vec![false; ways.len()]);
        Ok(Self {
            clip: source.clone(),
            demuxer,
            ways,
            packet: Packet::new(),
            pending: false,
            ended: false,
            span,
            refused,
            changed,
            copied: 0,
        })
    }

    pub(super) fn source(&self) -> &Demuxer {
        &self.demuxer
    }

    /// The stream that would be processed if the pictures were those of this clip.
    pub(super) fn video(&self) -> Result<Option<usize>, MediaError> {
        self.clip.video_of(&self.demuxer)
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
        let second = self.demuxer.is_video(index);
        if format.accepts(stream) && (!second || format.accepts_as_second(stream)) {
            self.ways[index] = Way::Copied { out: muxer.add_copy(stream)?, times: None };
            return Ok(None);
        }
        let container = format.name();
        let name = describe(index, stream);
        let target = format.subtitle_encoder().filter(|_| stream.is_text_subtitle());
        if let Some(Ok(transcoder)) = target.map(|encoder| SubtitleTranscoder::open(stream, encoder)) {
            let out = muxer.add_subtitle(&transcoder, stream)?;
            self.ways[index] = Way::Converted { out, times: None, transcoder: Box::new(transcoder) };
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
    ///
    /// # Errors
    /// What concerns the result as a whole, such as a full disk, or an interrupt. Packets that the muxer refuses are left out.
    pub(super) fn pump(&mut self, muxer: &mut Muxer, until_us: Option<i64>) -> Result<(), AvError> {
        while self.fetch()? {
            if let (Some(due), Some(until)) = (self.due_us(), until_us)
                && due > until
            {
                return Ok(());
            }
            self.pending = false;
            self.take(muxer)?;
        }
        (0..self.ways.len()).try_for_each(|index| {
            let held = self.times(index).and_then(PacketTimes::flush);
            held.map_or(Ok(()), |packet| self.write(muxer, index, packet))
        })
    }

    /// The video streams that are copied, in words; covers are none.
    pub(super) fn videos(&self) -> Vec<String> {
        let copied = |i: &usize| matches!(self.ways[*i], Way::Copied { .. });
        self.demuxer.videos().filter(copied).map(|i| describe(i, self.demuxer.stream(i))).collect()
    }

    /// What became of packets with odd times and of those that could not be written, one sentence per stream.
    pub(super) fn warnings(&mut self) -> Vec<String> {
        let mut warnings = Vec::new();
        for index in 0..self.ways.len() {
            let (repaired, dropped) = self.times(index).map_or((0, 0), |times| (times.repaired, times.dropped));
            let dropped = dropped + self.refused[index];
            if self.changed[index] {
                let name = describe(index, self.demuxer.stream(index));
                warnings.push(format!("{name}: its header changes on the way; the copy has the first"));
            }
            let counts: Vec<String> = [(repaired, "got another time"), (dropped, "left out")]
                .into_iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, what)| format!("{count} {what}"))
                .collect();
            if !counts.is_empty() {
                let name = describe(index, self.demuxer.stream(index));
                warnings.push(format!("{name}: packets with odd times or contents: {}", counts.join(", ")));
            }
        }
        warnings
    }

    fn times(&mut self, index: usize) -> Option<&mut PacketTimes> {
        match &mut self.ways[index] {
            Way::Copied { times, .. } | Way::Converted { times, .. } => times.as_mut(),
            Way::Left => None,
        }
    }

    /// When the waiting packet is due, µs on the result's clock; `None` where it has no time, or one behind the clip's end.
    fn due_us(&self) -> Option<i64> {
        let base = self.demuxer.stream(self.packet.stream()).time_base();
        let time = base.rescale(self.packet.dts().or(self.packet.pts())?, Rational::MICRO);
        let end = self.demuxer.start_us().unwrap_or(0).saturating_add(self.demuxer.duration_us().unwrap_or(i64::MAX));
        (time <= end).then(|| time.saturating_sub(self.start_us()))
    }

    /// Makes sure that a packet is waiting; false at the end.
    fn fetch(&mut self) -> Result<bool, AvError> {
        while !self.pending && !self.ended {
            match self.demuxer.read(&mut self.packet) {
                Ok(true) => self.pending = self.is_wanted(),
                Err(AvError::INVALID_DATA) => {}
                Err(AvError::EXIT) => return Err(AvError::EXIT),
                Ok(false) | Err(_) => self.ended = true,
            }
        }
        Ok(self.pending)
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
        start.is_none_or(|s| micro(pts.saturating_add(self.packet.duration().max(1))) > s)
            && end.is_none_or(|e| micro(pts) < e)
    }

    /// Converts the waiting packet where its stream is converted, mends its times, and writes what is ready.
    fn take(&mut self, muxer: &mut Muxer) -> Result<(), AvError> {
        let index = self.packet.stream();
        let base = self.demuxer.stream(index).time_base();
        let shift = Rational::MICRO.rescale(self.start_us().saturating_neg(), base);
        let kind = self.demuxer.stream(index).kind();
        let picture = self.demuxer.stream(index).is_attached_picture();
        self.keep_first_header(index);
        let (out, mut packet, times) = match &mut self.ways[index] {
            Way::Left => return Ok(()),
            Way::Copied { out, times } => (*out, std::mem::replace(&mut self.packet, Packet::new()), times),
            Way::Converted { out, times, transcoder } => match transcoder.convert(&mut self.packet) {
                Ok(Some(packet)) => (*out, packet, times),
                Ok(None) => return Ok(()),
                Err(AvError::NO_MEMORY) => return Err(AvError::NO_MEMORY),
                Err(_) => {
                    self.refused[index] += 1;
                    return Ok(());
                }
            },
        };
        let to = muxer.time_base(out);
        if picture {
            packet.set_times(Some(0), Some(0));
            packet.rescale(base, to);
            return self.write(muxer, index, packet);
        }
        packet.shift(shift);
        packet.rescale(base, to);
        let duration = self.demuxer.duration_us();
        let strict = !muxer.allows_equal_times();
        let ready = times.get_or_insert_with(|| PacketTimes::new(kind, to, duration, strict)).push(packet);
        ready.map_or(Ok(()), |packet| self.write(muxer, index, packet))
    }

    /// A stream that has a header keeps it. Some containers repeat it within the stream (FLV of live streams), and FFmpeg's Matroska muxer
    /// then writes a longer description of an AAC stream over the one it has, and over what follows: the video is no longer found.
    fn keep_first_header(&mut self, index: usize) {
        let known = self.demuxer.stream(index).header();
        if known.is_empty() {
            return;
        }
        let repeated = self.packet.take_new_header();
        self.changed[index] |= repeated.is_some_and(|header| header != known);
    }

    fn write(&mut self, muxer: &mut Muxer, index: usize, mut packet: Packet) -> Result<(), AvError> {
        let (Way::Copied { out, .. } | Way::Converted { out, .. }) = self.ways[index] else { return Ok(()) };
        packet.set_stream(out);
        match muxer.write(&mut packet) {
            Ok(()) => self.copied += 1,
            Err(AvError::INVALID | AvError::INVALID_DATA | AvError::OUT_OF_RANGE) => self.refused[index] += 1,
            Err(e) => return Err(e),
        }
        Ok(())
    }
}

/// A stream in words, as warnings name it.
fn describe(index: usize, stream: StreamRef<'_>) -> String {
    let kind = super::probe::kind_name(stream);
    let codec = if stream.codec_known() { stream.codec_name() } else { "unknown codec".into() };
    let language = stream.metadata().into_iter().find(|(k, _)| k == "language").map(|(_, v)| format!(", {v}"));
    format!("stream {index} ({kind}, {codec}{})", language.unwrap_or_default())
}
