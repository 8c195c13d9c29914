//! The tracks of some frames of a clip, and their file: those of an analysis window, written by one task and read by the one that joins;
//! or joined ones, for the tasks that need a part of them.
//!
//! A line of JSON, then the frames in little-endian binary. Positions are those of the tracker, bit for bit, so that windows that were
//! written and read join to the same clip as windows that were not. The file is no format for exchange: the tracks of a clip are in its
//! motion file.
//!
//! ```text
//! {"format":"plumbline.window","version":2,"width":640,"height":360,"window":2,"frames":616}
//! per frame:   i64 pts,  f32 sharpness,  u32 flags,  u32 bridged,  u32 n,  n × (u32 id,  f32 x,  f32 y)
//!              ⌈n/8⌉ bytes: bit k % 8 of byte k / 8 is set where point k is of the background
//! ```

use std::io::{self, BufRead, BufReader, BufWriter, Read, Write};

use serde::{Deserialize, Serialize};

use super::{FrameQuality, FrameTracks, Observation};
use plumbline_num::time::Timestamp;

/// The name in a file's `format` field.
const FORMAT: &str = "plumbline.window";
/// The only version.
const VERSION: u32 = 2;
/// Longest first line, bytes: four times the longest that is written.
const MAX_HEADER: u64 = 512;
/// Bytes of a frame without its observations, and of an observation.
const FRAME: usize = 24;
const OBSERVATION: usize = 12;
/// Observations that a tracker can have in a frame: twice the greatest number of points, with the rounding of the buckets.
const MAX_OBSERVATIONS: u32 = 1 << 18;

/// The tracks of some frames of a clip: of one analysis window, its warm-up included, with ids of its own; or joined ones.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowTracks {
    /// Width and height of the picture, px.
    pub size: (usize, usize),
    /// Index of the window; of joined ones that of the first frame.
    pub window: usize,
    /// The frames, in order.
    pub frames: Vec<FrameTracks>,
}

/// Errors of reading and writing window files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WindowFileError {
    /// The environment is at fault: reading or writing failed.
    #[error("window file: {0}")]
    Io(#[from] io::Error),
    /// The input is at fault: not a window file, or a damaged one.
    #[error("window file: {0}; analyze the window again")]
    Invalid(String),
    /// The file was made by a program of another version.
    #[error("window file version {found} is not supported (expected 2); analyze the window again")]
    Version {
        /// Value of `version`.
        found: u32,
    },
}

/// The first line.
#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u32,
    width: usize,
    height: usize,
    window: usize,
    frames: usize,
}

impl WindowTracks {
    /// Writes the window file.
    ///
    /// # Errors
    /// [`WindowFileError::Io`].
    pub fn write(&self, writer: impl Write) -> Result<(), WindowFileError> {
        let mut out = BufWriter::new(writer);
        let (width, height) = self.size;
        let (window, frames) = (self.window, self.frames.len());
        let header = Header { format: FORMAT.to_owned(), version: VERSION, width, height, window, frames };
        serde_json::to_writer(&mut out, &header).map_err(io::Error::from)?;
        out.write_all(b"\n")?;
        for frame in &self.frames {
            write_frame(&mut out, frame)?;
        }
        Ok(out.flush()?)
    }

    /// Reads a window file.
    ///
    /// # Errors
    /// [`WindowFileError`]: another format or version, a file that is damaged, cut off or longer than it says, or cannot be read.
    pub fn read(reader: impl Read) -> Result<Self, WindowFileError> {
        let mut input = BufReader::new(reader);
        let mut line = Vec::new();
        input.by_ref().take(MAX_HEADER).read_until(b'\n', &mut line)?;
        let header: Header = serde_json::from_slice(&line).map_err(|e| invalid(format!("not a window file ({e})")))?;
        if header.format != FORMAT {
            return Err(invalid(format!("format is {:?} (expected {FORMAT:?})", header.format)));
        }
        if header.version != VERSION {
            return Err(WindowFileError::Version { found: header.version });
        }
        let size = (header.width, header.height);
        let mut frames = Vec::new();
        for index in 0..header.frames {
            let wrong = |e| match e {
                WindowFileError::Invalid(what) => invalid(format!("frame {index}: {what}")),
                other => other,
            };
            frames.push(read_frame(&mut input, size).map_err(wrong)?);
        }
        if input.read(&mut [0])? > 0 {
            return Err(invalid(format!("data behind the last of {} frames", header.frames)));
        }
        Ok(Self { size, window: header.window, frames })
    }
}

fn invalid(what: impl Into<String>) -> WindowFileError {
    WindowFileError::Invalid(what.into())
}

fn write_frame(out: &mut impl Write, frame: &FrameTracks) -> io::Result<()> {
    let q = &frame.quality;
    out.write_all(&frame.pts.0.to_le_bytes())?;
    let words = [q.sharpness.to_bits(), q.flags(), q.bridged, frame.observations.len() as u32];
    words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))?;
    for o in &frame.observations {
        [o.id, o.x.to_bits(), o.y.to_bits()].iter().try_for_each(|word| out.write_all(&word.to_le_bytes()))?;
    }
    let byte = |eight: &[Observation]| eight.iter().rev().fold(0, |byte, o| byte << 1 | u8::from(o.background));
    out.write_all(&frame.observations.chunks(8).map(byte).collect::<Vec<u8>>())
}

fn read_frame(input: &mut impl Read, size: (usize, usize)) -> Result<FrameTracks, WindowFileError> {
    let mut head = [0; FRAME];
    filled(input, &mut head)?;
    let word = |k: usize| u32::from_le_bytes([head[k], head[k + 1], head[k + 2], head[k + 3]]);
    let pts = Timestamp((u64::from(word(0)) | u64::from(word(4)) << 32) as i64);
    let quality =
        FrameQuality { sharpness: f32::from_bits(word(8)), bridged: word(16), ..FrameQuality::from_flags(word(12)) };
    let count = word(20);
    if count > MAX_OBSERVATIONS {
        return Err(invalid(format!("{count} points (expected at most {MAX_OBSERVATIONS})")));
    }
    let mut observations: Vec<Observation> = Vec::new();
    for _ in 0..count {
        let mut bytes = [0; OBSERVATION];
        filled(input, &mut bytes)?;
        let word = |k: usize| u32::from_le_bytes([bytes[k], bytes[k + 1], bytes[k + 2], bytes[k + 3]]);
        let (id, x, y) = (word(0), f32::from_bits(word(4)), f32::from_bits(word(8)));
        if let Some(last) = observations.last().filter(|last| id <= last.id) {
            return Err(invalid(format!("track {id} follows track {} (expected ascending ids)", last.id)));
        }
        if !((0.0..=size.0 as f32).contains(&x) && (0.0..=size.1 as f32).contains(&y)) {
            return Err(invalid(format!("track {id} at ({x}, {y}) px (expected within {} × {} px)", size.0, size.1)));
        }
        observations.push(Observation { id, x, y, background: true });
    }
    for eight in observations.chunks_mut(8) {
        let mut byte = [0];
        filled(input, &mut byte)?;
        eight.iter_mut().enumerate().for_each(|(k, o)| o.background = byte[0] >> k & 1 == 1);
    }
    Ok(FrameTracks { pts, observations, quality })
}

fn filled(input: &mut impl Read, bytes: &mut [u8]) -> Result<(), WindowFileError> {
    input.read_exact(bytes).map_err(|error| match error.kind() {
        io::ErrorKind::UnexpectedEof => invalid("the file ends here"),
        _ => WindowFileError::Io(error),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window() -> WindowTracks {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut frame = |k: i64| {
            let ids = (0..rng.u32(0..40)).map(|i| 7 * i + k as u32);
            let observations = ids.collect::<Vec<_>>().into_iter();
            let at = |id| Observation { id, x: 640.0 * rng.f32(), y: 360.0 * rng.f32(), background: rng.u32(0..3) > 0 };
            let observations = observations.map(at).collect();
            let quality = FrameQuality {
                sharpness: 0.1 + k as f32,
                black: k == 1,
                duplicate: k == 2,
                cut_before: k == 3,
                blurred: k == 4,
                bridged: k as u32 % 3,
            };
            FrameTracks { pts: Timestamp(k - 2), observations, quality }
        };
        WindowTracks { size: (640, 360), window: 3, frames: (0..9).map(&mut frame).collect() }
    }

    fn bytes(window: &WindowTracks) -> Vec<u8> {
        let mut bytes = Vec::new();
        window.write(&mut bytes).expect("memory");
        bytes
    }

    #[test]
    fn a_window_file_is_read_back_bit_for_bit() {
        let window = window();
        assert!(window.frames.iter().map(|f| f.observations.len()).sum::<usize>() > 50);
        assert_eq!(WindowTracks::read(&bytes(&window)[..]).expect("just written"), window);
        let empty = WindowTracks { frames: Vec::new(), ..window };
        assert_eq!(WindowTracks::read(&bytes(&empty)[..]).expect("just written"), empty);
    }

    #[test]
    fn damaged_window_files_are_refused() {
        let good = bytes(&window());
        let refused = |bytes: &[u8]| WindowTracks::read(bytes).expect_err("refused").to_string();
        let body = good.iter().position(|b| *b == b'\n').expect("a first line") + 1;
        for end in 0..good.len() {
            let message = refused(&good[..end]);
            assert!(
                message.contains(if end + 1 < body { "not a window file" } else { "the file ends here" }),
                "{message}"
            );
        }
        assert!(refused(&[&good[..], &[0]].concat()).contains("data behind the last of 9 frames"));
        let header = |from: &str, to: &str| {
            let line = std::str::from_utf8(&good[..body]).expect("JSON").replace(from, to);
            refused(&[line.as_bytes(), &good[body..]].concat())
        };
        assert_eq!(
            header("\"version\":2", "\"version\":1"),
            "window file version 1 is not supported (expected 2); analyze the window again"
        );
        assert!(header("plumbline.window", "plumbline.motion").contains("format is \"plumbline.motion\""));
        assert!(header("\"width\":640", "\"width\":20").contains("(expected within 20 × 360 px)"));
        let mut many = good.clone();
        many[body + 20..body + 24].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(refused(&many).contains("frame 0: 4294967295 points (expected at most 262144)"));
    }
}
