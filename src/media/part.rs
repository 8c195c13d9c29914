//! Part files: the encoded pictures of some successive frames of a clip, written by one process and joined by another.
//!
//! A line of JSON, then the packets in the order of the encoder, in little-endian binary. It is no format for exchange: times are the
//! encoder's own ticks and what decoders need is beside the packets, so that nothing is rounded or guessed when parts are joined, as it
//! would be on the way through a container.
//!
//! ```text
//! {"format":"plumbline.part","version":1,"encoder":"libx264","time_base":[1,15360],"header":[1,100,…]}
//! per packet:  i64 pts,  i64 dts,  i64 duration,  u32 flags (1: key),  u32 n,  n bytes
//! end:         three i64 of 0,  u32 2,  u32 number of packets
//! ```

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::av::{Encoder, Packet, Rational};
use super::{FrameSpan, MediaError};
use plumbline_num::files::open_regular;

/// The name in a file's `format` field.
const FORMAT: &str = "plumbline.part";
/// The only version.
const VERSION: u32 = 1;
/// Longest first line, bytes: headers of codecs have some hundred bytes, with up to four digits each.
const MAX_HEADER: u64 = 1 << 20;
/// Bytes of a packet without its data.
const RECORD: usize = 32;
const KEY: u32 = 1;
const END: u32 = 2;

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PartHeader {
    format: String,
    version: u32,
    encoder: String,
    time_base: [i32; 2],
    header: Vec<u8>,
}

impl PartHeader {
    /// Of what `encoder`, of this name, gives with times in `base`.
    pub(super) fn of(name: &str, encoder: &Encoder, base: Rational) -> Self {
        let (format, time_base) = (FORMAT.to_owned(), [base.num, base.den]);
        Self { format, version: VERSION, encoder: name.to_owned(), time_base, header: encoder.header().to_vec() }
    }

    /// Writes the beginning of a part file.
    pub(super) fn write(&self, mut out: impl Write) -> io::Result<()> {
        serde_json::to_writer(&mut out, self)?;
        out.write_all(b"\n")
    }
}

/// Writes a packet to a part file.
pub(super) fn write_packet(mut out: impl Write, packet: &Packet) -> io::Result<()> {
    let pts = packet.pts().unwrap_or_default();
    let times = [pts, packet.dts().unwrap_or(pts), packet.duration()];
    let size = u32::try_from(packet.data().len()).map_err(io::Error::other)?;
    write_record(&mut out, times, if packet.is_key() { KEY } else { 0 }, size)?;
    out.write_all(packet.data())
}

/// Writes the end of a part file.
pub(super) fn write_end(mut out: impl Write, packets: u64) -> io::Result<()> {
    write_record(&mut out, [0; 3], END, u32::try_from(packets).map_err(io::Error::other)?)
}

fn write_record(out: &mut impl Write, times: [i64; 3], flags: u32, size: u32) -> io::Result<()> {
    times.iter().try_for_each(|time| out.write_all(&time.to_le_bytes()))?;
    out.write_all(&flags.to_le_bytes())?;
    out.write_all(&size.to_le_bytes())
}

/// A packet without its data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PacketRecord {
    pub(super) pts: i64,
    pub(super) dts: i64,
    pub(super) duration: i64,
    pub(super) is_key: bool,
    size: u32,
}

/// A part file being read.
pub(super) struct PartReader {
    path: PathBuf,
    file: BufReader<File>,
    /// Of the first line, bytes.
    body: u64,
    pub(super) header: PartHeader,
}

impl PartReader {
    /// Opens a part file.
    pub(super) fn open(path: &Path) -> Result<Self, MediaError> {
        let refused = |problem: String| MediaError::input(&path.display().to_string(), problem);
        let file = open_regular(path).map_err(|e| refused(format!("the encoded part cannot be read: {e}")))?;
        let mut file = BufReader::new(file);
        let mut line = Vec::new();
        let read = file.by_ref().take(MAX_HEADER).read_until(b'\n', &mut line);
        read.map_err(|e| refused(format!("the encoded part cannot be read: {e}")))?;
        let header: PartHeader =
            serde_json::from_slice(&line).map_err(|e| refused(format!("no encoded part ({e})")))?;
        if header.format != FORMAT || header.version != VERSION {
            return Err(refused(format!("no encoded part of version {VERSION}; render it again")));
        }
        Ok(Self { path: path.to_owned(), file, body: line.len() as u64, header })
    }

    /// An error of this part.
    pub(super) fn refused(&self, problem: impl Into<String>) -> MediaError {
        MediaError::input(&self.path.display().to_string(), problem.into())
    }

    /// All packets without their data. Reading begins with the first packet then.
    pub(super) fn records(&mut self) -> Result<Vec<PacketRecord>, MediaError> {
        let mut records = Vec::new();
        while let Some(record) = self.record(records.len())? {
            let skipped = self.file.seek_relative(i64::from(record.size));
            skipped.map_err(|e| self.refused(format!("the encoded part cannot be read: {e}")))?;
            records.push(record);
        }
        let back = self.file.seek(SeekFrom::Start(self.body));
        back.map_err(|e| self.refused(format!("the encoded part cannot be read: {e}")))?;
        Ok(records)
    }

    /// Fills `packet` with the next one of the file, whose place is `index`; false at the end.
    pub(super) fn next(&mut self, index: usize, packet: &mut Packet) -> Result<bool, MediaError> {
        let Some(record) = self.record(index)? else { return Ok(false) };
        let mut bytes = Vec::new();
        // Memory grows with the bytes that are there, whatever the size says.
        let read = self.file.by_ref().take(u64::from(record.size)).read_to_end(&mut bytes);
        let read = read.map_err(|e| self.refused(format!("the encoded part cannot be read: {e}")))?;
        if read < record.size as usize {
            return Err(self.refused(format!("the encoded part ends within packet {index}; render it again")));
        }
        packet.set_data(&bytes).map_err(|e| MediaError::internal("a packet", e))?;
        packet.set_times(Some(record.pts), Some(record.dts));
        packet.set_duration(record.duration);
        if record.is_key {
            packet.set_key();
        }
        Ok(true)
    }

    /// The head of the packet `index`; `None` at the end.
    fn record(&mut self, index: usize) -> Result<Option<PacketRecord>, MediaError> {
        let mut bytes = [0; RECORD];
        let read = self.file.read_exact(&mut bytes);
        read.map_err(|_| self.refused(format!("the encoded part ends at packet {index}; render it again")))?;
        let word = |k: usize| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
        let long = |k: usize| (u64::from(word(k)) | u64::from(word(k + 4)) << 32) as i64;
        let (flags, size) = (word(24), word(28));
        if flags & END == 0 {
            let (pts, dts, duration) = (long(0), long(8), long(16));
            return Ok(Some(PacketRecord { pts, dts, duration, is_key: flags & KEY != 0, size }));
        }
        if size as usize == index {
            return Ok(None);
        }
        Err(self.refused(format!("the encoded part has {index} of {size} packets; render it again")))
    }
}

/// What was joined so far: times of the frames, for the decoding times of those that follow.
#[derive(Debug, Default)]
pub(super) struct Seam {
    /// Times of all frames, ascending, ticks.
    times: Vec<i64>,
    /// Frames by which decoding is ahead of showing.
    delay: usize,
}

impl Seam {
    /// Adds a part, which must have the frames `span`; gives the decoding times of its packets.
    ///
    /// An encoder that begins anew states for its first packets times before the frames of its part, with the distances of the frames
    /// behind them: where those are not evenly spaced, they would not increase across the seam. In a clip encoded at once the packet at
    /// position `i` is decoded when frame `i − delay` is shown, and so it is here.
    pub(super) fn add(
        &mut self,
        part: &PartReader,
        records: &[PacketRecord],
        span: &FrameSpan,
    ) -> Result<Vec<i64>, MediaError> {
        let mut times: Vec<i64> = records.iter().map(|r| r.pts).collect();
        times.sort_unstable();
        let (Some(&first), Some(&last)) = (times.first(), times.last()) else {
            return Err(part.refused("the encoded part has no frame; render it again"));
        };
        if !span.is_of(times.len() as u64, first, last) || !times.is_sorted_by(|a, b| a < b) {
            let expected = format!("{} frames from {} to {} ticks", span.frames.len(), span.start, span.last);
            let found = format!("{} from {first} to {last}", times.len());
            return Err(
                part.refused(format!("the encoded part does not fit its seams: expected {expected}, found {found}"))
            );
        }
        if let Some(before) = self.times.last().filter(|before| **before >= first) {
            return Err(
                part.refused(format!("the encoded part begins at {first} ticks, and the one before ends at {before}"))
            );
        }
        if !records[0].is_key {
            return Err(part.refused("the encoded part does not begin with a key frame; render it again"));
        }
        let at = self.times.len();
        if at == 0 {
            self.delay = records.iter().take_while(|r| r.dts < first).count();
        }
        self.times.extend(times);
        let dts = |(k, record): (usize, &PacketRecord)| {
            let shown = (at + k).checked_sub(self.delay).map(|i| self.times[i]);
            let dts = shown.unwrap_or(record.dts);
            let late = || part.refused(format!("packet {k} is shown at {} ticks and decoded at {dts}", record.pts));
            if dts <= record.pts { Ok(dts) } else { Err(late()) }
        };
        records.iter().enumerate().map(dts).collect()
    }
}
