//! The tracks of a whole clip on disk: appended frame by frame, read by frame or window, in bounded memory.
//!
//! Two anonymous temporary files, which the system removes with the store: records of a fixed size, one per frame, and the
//! observations, 8 bytes each in the common case:
//!
//! ```text
//! u16  id − id of the observation before, 0x7fff and a u32 behind the eight bytes where that does not fit;
//!      bit 15: not background
//! u24  x / RESOLUTION,   u24  y / RESOLUTION
//! ```
//!
//! An hour at 30 frames/s with 400 points is 350 MB there. The resolution of 1/256 px is a tenth of the best that tracking
//! reaches.

use std::fs::File;
use std::ops::Range;
use std::os::unix::fs::FileExt;

use super::{FrameQuality, FrameTracks, Observation};
use plumbline_num::time::Timestamp;

/// Step of stored positions, px; they are off by at most half of it.
pub const RESOLUTION_PX: f32 = 1.0 / 256.0;

/// Positions below this can be stored, px: 24 bits of steps.
const LIMIT_PX: f32 = 65_535.0;

/// Errors of the track store.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The environment is at fault: the temporary folder is full or cannot be written.
    #[error(
        "cannot keep tracks in the temporary folder {folder}: {source}; free space there or set TMPDIR to another folder"
    )]
    Io {
        /// Folder of temporary files.
        folder: String,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The caller is at fault: a frame that is not stored, or an observation that the format cannot represent.
    #[error("{0}")]
    Invalid(String),
}

impl StoreError {
    fn io(source: std::io::Error) -> Self {
        Self::Io { folder: std::env::temp_dir().display().to_string(), source }
    }
}

/// Tracks of a clip, frame by frame.
#[derive(Debug)]
pub struct TrackStore {
    records: File,
    observations: File,
    frames: usize,
    /// Bytes of observations written.
    end: u64,
    scratch: Vec<u8>,
}

/// Bytes of a frame's record.
const RECORD: usize = 40;

/// A frame's record.
struct Record {
    pts: i64,
    start: u64,
    bytes: u32,
    count: u32,
    quality: FrameQuality,
}

impl Record {
    fn to_bytes(&self) -> [u8; RECORD] {
        let q = &self.quality;
        let mut bytes = [0; RECORD];
        bytes[..8].copy_from_slice(&self.pts.to_le_bytes());
        bytes[8..16].copy_from_slice(&self.start.to_le_bytes());
        for (k, word) in [self.bytes, self.count, q.sharpness.to_bits(), q.flags(), q.bridged].into_iter().enumerate() {
            bytes[16 + 4 * k..20 + 4 * k].copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    fn from_bytes(bytes: &[u8; RECORD]) -> Self {
        let word = |k: usize| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
        let long = |k: usize| u64::from(word(k)) | u64::from(word(k + 4)) << 32;
        let sharpness = f32::from_bits(word(24));
        let quality = FrameQuality { sharpness, bridged: word(32), ..FrameQuality::from_flags(word(28)) };
        Self { pts: long(0) as i64, start: long(8), bytes: word(16), count: word(20), quality }
    }
}

/// Marks an id that follows as 32 bits.
const FAR: u32 = 0x7fff;
/// Marks a point that is not of the background.
const FOREGROUND: u16 = 0x8000;

impl TrackStore {
    /// An empty store on temporary files.
    ///
    /// # Errors
    /// [`StoreError::Io`] where the temporary folder cannot be written.
    pub fn new() -> Result<Self, StoreError> {
        let file = || tempfile::tempfile().map_err(StoreError::io);
        Ok(Self { records: file()?, observations: file()?, frames: 0, end: 0, scratch: Vec::new() })
    }

    /// Frames stored.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Bytes of disk in use.
    pub fn bytes(&self) -> u64 {
        self.end + (self.frames * RECORD) as u64
    }

    /// Appends the tracks of the next frame; ids must ascend.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for observations that the format cannot represent,
    /// [`StoreError::Io`] for a full disk; the store is then as it was.
    pub fn push(&mut self, tracks: &FrameTracks) -> Result<(), StoreError> {
        let mut bytes = std::mem::take(&mut self.scratch);
        bytes.clear();
        let written = encode(&tracks.observations, &mut bytes).and_then(|()| self.write(tracks, &bytes));
        self.scratch = bytes;
        written
    }

    fn write(&mut self, tracks: &FrameTracks, bytes: &[u8]) -> Result<(), StoreError> {
        let (pts, quality) = (tracks.pts.0, tracks.quality);
        let count = tracks.observations.len() as u32;
        let record = Record { pts, start: self.end, bytes: bytes.len() as u32, count, quality };
        self.observations.write_all_at(bytes, self.end).map_err(StoreError::io)?;
        self.records.write_all_at(&record.to_bytes(), (self.frames * RECORD) as u64).map_err(StoreError::io)?;
        self.end += bytes.len() as u64;
        self.frames += 1;
        Ok(())
    }

    /// The tracks of frame `frame`, positions to within half of [`RESOLUTION_PX`].
    ///
    /// # Errors
    /// [`StoreError::Invalid`] beyond the end, [`StoreError::Io`] where the files cannot be read.
    pub fn read(&self, frame: usize) -> Result<FrameTracks, StoreError> {
        let record = self.record(frame)?;
        let mut bytes = vec![0; record.bytes as usize];
        self.observations.read_exact_at(&mut bytes, record.start).map_err(StoreError::io)?;
        Ok(decode(&record, &bytes))
    }

    /// The tracks of a range of frames, read at once.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn window(&self, frames: Range<usize>) -> Result<Vec<FrameTracks>, StoreError> {
        let records: Vec<Record> = frames.map(|f| self.record(f)).collect::<Result<_, _>>()?;
        let Some(first) = records.first() else { return Ok(Vec::new()) };
        let total: usize = records.iter().map(|r| r.bytes as usize).sum();
        let mut bytes = vec![0; total];
        self.observations.read_exact_at(&mut bytes, first.start).map_err(StoreError::io)?;
        let part = |r: &Record| (r.start - first.start) as usize..(r.start - first.start) as usize + r.bytes as usize;
        Ok(records.iter().map(|r| decode(r, &bytes[part(r)])).collect())
    }

    /// Time and classification of frame `frame`, without its points.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn quality(&self, frame: usize) -> Result<(Timestamp, FrameQuality), StoreError> {
        let record = self.record(frame)?;
        Ok((Timestamp(record.pts), record.quality))
    }

    fn record(&self, frame: usize) -> Result<Record, StoreError> {
        if frame >= self.frames {
            let expected = format!("expected 0 to {}, exclusive", self.frames);
            return Err(StoreError::Invalid(format!("no tracks of frame {frame} ({expected})")));
        }
        let mut bytes = [0; RECORD];
        self.records.read_exact_at(&mut bytes, (frame * RECORD) as u64).map_err(StoreError::io)?;
        Ok(Record::from_bytes(&bytes))
    }
}

fn encode(observations: &[Observation], bytes: &mut Vec<u8>) -> Result<(), StoreError> {
    let mut before: Option<u32> = None;
    for &Observation { id, x, y, background } in observations {
        if let Some(before) = before.filter(|before| id <= *before) {
            let text = format!("track {id} follows track {before} (expected ids in ascending order)");
            return Err(StoreError::Invalid(text));
        }
        let range = 0.0..LIMIT_PX;
        if !(range.contains(&x) && range.contains(&y)) {
            let text = format!("track {id} at ({x}, {y}) px cannot be stored (expected 0 to {LIMIT_PX} px)");
            return Err(StoreError::Invalid(text));
        }
        let delta = id - before.unwrap_or(0);
        let head = delta.min(FAR) as u16 | if background { 0 } else { FOREGROUND };
        bytes.extend(head.to_le_bytes());
        for v in [x, y] {
            bytes.extend(&((v / RESOLUTION_PX).round() as u32).to_le_bytes()[..3]);
        }
        if delta >= FAR {
            bytes.extend(id.to_le_bytes());
        }
        before = Some(id);
    }
    Ok(())
}

fn decode(record: &Record, mut bytes: &[u8]) -> FrameTracks {
    let mut observations = Vec::with_capacity(record.count as usize);
    let mut id = 0;
    for _ in 0..record.count {
        let (head, rest) = bytes.split_at(8);
        let fixed = |k: usize| u32::from_le_bytes([head[k], head[k + 1], head[k + 2], 0]) as f32 * RESOLUTION_PX;
        let word = u16::from_le_bytes([head[0], head[1]]);
        let delta = u32::from(word & !FOREGROUND);
        bytes = rest;
        if delta == FAR {
            let (far, rest) = bytes.split_at(4);
            id = u32::from_le_bytes([far[0], far[1], far[2], far[3]]);
            bytes = rest;
        } else {
            id += delta;
        }
        observations.push(Observation { id, x: fixed(2), y: fixed(5), background: word & FOREGROUND == 0 });
    }
    FrameTracks { pts: Timestamp(record.pts), observations, quality: record.quality }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(rng: &mut fastrand::Rng, i: u32) -> FrameTracks {
        let mut id = i;
        let observations = (0..rng.usize(0..300)).map(|_| {
            id += if rng.u32(0..50) == 0 { rng.u32(30_000..9_000_000) } else { rng.u32(1..200) };
            Observation { id, x: 7680.0 * rng.f32(), y: 4320.0 * rng.f32(), background: rng.bool() }
        });
        let observations = observations.collect();
        let quality = FrameQuality {
            sharpness: rng.f32(),
            black: rng.bool(),
            duplicate: rng.bool(),
            blurred: rng.bool(),
            cut_before: rng.bool(),
            bridged: rng.u32(..),
        };
        FrameTracks { pts: Timestamp(rng.i64(..)), observations, quality }
    }

    fn same(read: &FrameTracks, written: &FrameTracks) -> bool {
        let near = |a: f32, b: f32| (a - b).abs() <= 0.5 * RESOLUTION_PX;
        let pairs = read.observations.iter().zip(&written.observations);
        (read.pts, read.quality, read.observations.len()) == (written.pts, written.quality, written.observations.len())
            && pairs
                .into_iter()
                .all(|(a, b)| (a.id, a.background) == (b.id, b.background) && near(a.x, b.x) && near(a.y, b.y))
    }

    #[test]
    fn what_was_stored_is_read_by_frame_and_by_window() {
        let mut rng = fastrand::Rng::with_seed(8);
        let clip: Vec<_> = (0..40).map(|i| frame(&mut rng, i)).collect();
        let mut store = TrackStore::new().expect("a temporary folder");
        for (i, tracks) in clip.iter().enumerate() {
            store.push(tracks).expect("in range");
            assert!(same(&store.read(i).expect("just written"), tracks), "reading and writing interleave");
        }
        for (i, tracks) in clip.iter().enumerate() {
            assert!(same(&store.read(i).expect("stored"), tracks), "frame {i}");
            assert_eq!(store.quality(i).expect("stored"), (tracks.pts, tracks.quality));
        }
        let window = store.window(7..31).expect("stored");
        assert!(window.len() == 24 && window.iter().zip(&clip[7..]).all(|(a, b)| same(a, b)));
        assert!(store.window(5..5).expect("empty").is_empty());
    }

    #[test]
    fn an_observation_takes_eight_bytes() {
        let observations = (0..400).map(|i| Observation { id: 1_000_000 + 3 * i, x: 1.0, y: 2.0, background: true });
        let tracks =
            FrameTracks { pts: Timestamp(0), observations: observations.collect(), quality: FrameQuality::default() };
        let mut store = TrackStore::new().expect("a temporary folder");
        store.push(&tracks).expect("in range");
        assert_eq!(store.bytes(), 40 + 400 * 8 + 4, "the first id of a frame is far from 0");
    }

    #[test]
    fn observations_outside_the_format_are_refused_and_change_nothing() {
        let mut store = TrackStore::new().expect("a temporary folder");
        let at = |id, x| Observation { id, x, y: 1.0, background: true };
        let cases = [
            (vec![at(4, 1.0), at(5, -0.5)], "track 5 at (-0.5, 1) px cannot be stored (expected 0 to 65535 px)"),
            (vec![at(4, f32::NAN)], "track 4 at (NaN, 1) px cannot be stored (expected 0 to 65535 px)"),
            (vec![at(4, 1.0), at(4, 2.0)], "track 4 follows track 4 (expected ids in ascending order)"),
        ];
        for (observations, message) in cases {
            let tracks = FrameTracks { pts: Timestamp(0), observations, quality: FrameQuality::default() };
            assert_eq!(store.push(&tracks).expect_err("refused").to_string(), message);
        }
        assert_eq!((store.frames(), store.bytes()), (0, 0));
        let message = store.read(0).expect_err("empty").to_string();
        assert_eq!(message, "no tracks of frame 0 (expected 0 to 0, exclusive)");
    }
}
