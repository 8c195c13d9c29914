//! The motion file `plumbline.motion`, version 1: JSON.
//!
//! It is not a smoothed path; it contains the motion of the picture from frame to frame, so that another program can inspect or
//! replace it, and a later run need not estimate it again.
//!
//! ```json
//! {
//!   "format": "plumbline.motion", "version": 1, "pixel_center": 0.5,
//!   "source": { "width": 640, "height": 360, "shown_width": 640, "shown_height": 360,
//!               "rotation": 0, "pixel_aspect": [1, 1], "time_base": [1, 30000] },
//!   "readout_s": 0.02,
//!   "frames": [ { "pts": 0, "shot": 0, "tier": "homography", "verdict": "measured" }, … ],
//!   "planar": [ [[1,0,2.5],[0,1,-1],[0,0,1]], …, null ],
//!   "planar_similarity": [ [1, 0, 2.5, -1], …, null ]
//! }
//! ```
//!
//! `planar[k]` maps frame `k` to frame `k+1` (`next_from_this`, px, row by row); `null` before a cut and at the end.
//! `planar_similarity[k]` is the nearest motion `[a, b, tx, ty]` without shear and perspective; left out, it is derived.
//! Where cameras in space are known there are further blocks, see `cameras.rs`: `cameras`, `points`, `reconstruction`. The tracked
//! points are in a block `tracks`, see `tracks.rs`.
//! Pixel centers are at integer + 0.5; a file with `"pixel_center": 0` is shifted on reading. Blocks of other names are kept,
//! other versions are refused.

mod cameras;
mod document;
mod line;
mod tracks;

use std::io::{self, BufWriter, Read, Seek, Write};

use serde::Serialize;

use super::clip::ClipMotion;
use super::frame_motion::{FrameMotion, MotionQuality};
use crate::track::{StoreError, TrackStore};
use document::{Document, FrameEntry, Source};
pub use plumbline_num::document::VERSION;
use plumbline_num::document::{DocumentError, Kind};
use plumbline_num::math::Homography;

/// The name in a file's `format` field.
pub const FORMAT: &str = "plumbline.motion";
/// At most as large as ten hours of video at 60 frames/s with a thousand points each.
const KIND: Kind = Kind { name: "a motion file", format: FORMAT, max_bytes: 1 << 36 };
/// Errors of reading and writing motion files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionFileError {
    /// The file is not JSON of the expected shape, or is larger than any clip's motion.
    #[error(transparent)]
    Document(DocumentError),
    /// The file was made by a program of another version.
    #[error("motion file version {found} is not supported (expected 1); export the motion again with this program")]
    Version {
        /// Value of `version`.
        found: u64,
    },
    /// A value that no clip has.
    #[error("{field} is {value} (expected {expected})")]
    Value {
        /// Path of the field in the file.
        field: String,
        /// Value found.
        value: String,
        /// Allowed values.
        expected: &'static str,
    },
    /// A block with more or fewer entries than frames.
    #[error("block {block:?} has {found} entries for {frames} frames; give one entry per frame")]
    Length {
        /// Name of the block.
        block: &'static str,
        /// Its entries.
        found: usize,
        /// The frames of the file.
        frames: usize,
    },
    /// An error and its line.
    #[error("line {line}: {fault}")]
    InLine {
        /// Line of the file, from 1.
        line: usize,
        /// The error.
        fault: Box<MotionFileError>,
    },
    /// Reading or writing failed.
    #[error("motion file: {0}")]
    Io(#[from] io::Error),
    /// The points cannot be kept or read.
    #[error(transparent)]
    Tracks(#[from] StoreError),
}

impl From<DocumentError> for MotionFileError {
    fn from(error: DocumentError) -> Self {
        match error {
            DocumentError::Version { found, .. } => Self::Version { found },
            DocumentError::Io { fault, .. } => Self::Io(fault),
            other => Self::Document(other),
        }
    }
}

/// The JSON schema of the motion file.
#[cfg(feature = "schema")]
pub fn motion_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl MotionFileError {
    /// The error with its line in `file`, where it names a field.
    fn located(self, mut file: impl Read + Seek) -> Self {
        let path = match &self {
            Self::Value { field, .. } => field.as_str(),
            Self::Length { block, .. } => block,
            _ => return self,
        };
        let mut text = Vec::new();
        let read = file.rewind().and_then(|()| file.read_to_end(&mut text));
        match read.ok().and_then(|_| line::line_of(&text, path)) {
            Some(line) => Self::InLine { line, fault: Box::new(self) },
            None => self,
        }
    }
}

impl ClipMotion {
    /// Reads a motion file and its points, if it has any; they go to a store on disk as they are read.
    ///
    /// # Errors
    /// [`MotionFileError`]: not JSON, another format or version, a value out of range, a block of the wrong length, a file
    /// that is too large or cannot be read.
    pub fn read_json(mut file: impl Read + Seek) -> Result<(Self, Option<TrackStore>), MotionFileError> {
        let document: Document = KIND.stream(&mut file)?;
        document.check().and_then(|()| document.into_clip()).map_err(|fault| fault.located(file))
    }

    /// Reads a motion file from memory.
    ///
    /// # Errors
    /// As [`Self::read_json`].
    pub fn from_json(bytes: &[u8]) -> Result<Self, MotionFileError> {
        Ok(Self::read_json(io::Cursor::new(bytes))?.0)
    }

    /// Writes the clip as a motion file, one frame per line, without building it in memory.
    ///
    /// # Errors
    /// [`MotionFileError::Value`] for a motion that is not finite, [`MotionFileError::Io`] where the writer fails.
    pub fn write_json(&self, writer: impl Write) -> Result<(), MotionFileError> {
        self.write(writer, None)
    }

    /// [`Self::write_json`], and the points of the clip with it.
    ///
    /// # Errors
    /// As there, and [`MotionFileError::Tracks`] where they cannot be read.
    pub fn write_json_with_tracks(&self, writer: impl Write, tracks: &TrackStore) -> Result<(), MotionFileError> {
        self.write(writer, Some(tracks))
    }

    fn write(&self, writer: impl Write, tracks: Option<&TrackStore>) -> Result<(), MotionFileError> {
        let mut out = BufWriter::new(writer);
        self.write_header(&mut out)?;
        let entries = (0..self.frames.len()).map(|k| self.entry(k));
        write_block(&mut out, "frames", entries)?;
        self.write_planar(&mut out)?;
        if let Some(found) = &self.cameras {
            cameras::write(&mut out, found)?;
        }
        for (name, block) in &self.other_blocks {
            write!(out, ",\n{}: ", serde_json::to_string(name).map_err(io::Error::from)?)?;
            serde_json::to_writer(&mut out, block).map_err(io::Error::from)?;
        }
        if let Some(store) = tracks {
            tracks::write(&mut out, store)?;
        }
        writeln!(out, "\n}}")?;
        Ok(out.flush()?)
    }

    fn write_planar(&self, out: &mut impl Write) -> Result<(), MotionFileError> {
        let next = |k: usize| self.frames.get(k + 1).filter(|f| f.quality != MotionQuality::ShotStart);
        for (k, frame) in self.frames.iter().enumerate() {
            let s = frame.similarity;
            if !(frame.homography.is_finite() && [s.a, s.b, s.t.x, s.t.y].iter().all(|v| v.is_finite())) {
                return Err(value(format!("motion of frame {k}"), "not finite", "finite numbers"));
            }
        }
        let planar = (0..self.frames.len()).map(|k| next(k).map(|f| rows(&f.homography)));
        write_block(out, "planar", planar)?;
        let similar = |f: &FrameMotion| [f.similarity.a, f.similarity.b, f.similarity.t.x, f.similarity.t.y];
        write_block(out, "planar_similarity", (0..self.frames.len()).map(|k| next(k).map(similar)))
    }

    fn write_header(&self, out: &mut impl Write) -> Result<(), MotionFileError> {
        let (shown_width, shown_height) = self.shown_size();
        let source = Source {
            width: self.width,
            height: self.height,
            shown_width: Some(shown_width),
            shown_height: Some(shown_height),
            rotation: self.rotation,
            pixel_aspect: [self.pixel_aspect.0, self.pixel_aspect.1],
            time_base: [self.timebase.num, self.timebase.den],
        };
        let source = serde_json::to_string(&source).map_err(io::Error::from)?;
        let readout = serde_json::to_string(&self.readout_s).map_err(io::Error::from)?;
        write!(out, "{{\n\"format\": {FORMAT:?}, \"version\": {VERSION}, \"pixel_center\": 0.5,\n")?;
        Ok(write!(out, "\"source\": {source},\n\"readout_s\": {readout}")?)
    }

    /// Width and height as shown, px: pixel aspect applied to the width, then rotated.
    pub fn shown_size(&self) -> (u32, u32) {
        let (num, den) = self.pixel_aspect;
        let wide = f64::from(self.width) * f64::from(num) / f64::from(den.max(1));
        let shown = (wide.round() as u32, self.height);
        if self.rotation.is_multiple_of(180) { shown } else { (shown.1, shown.0) }
    }

    fn entry(&self, k: usize) -> FrameEntry {
        let f = &self.frames[k];
        FrameEntry {
            pts: f.pts.0,
            shot: self.shot_of(k).unwrap_or(0) as u32,
            tier: f.model,
            verdict: f.quality,
            points: f.points,
            inliers: f.inliers,
            coverage: f.coverage,
            residual_px: f.residual_px,
            similarity_residual_px: f.similarity_residual_px,
        }
    }
}

fn write_block(
    out: &mut impl Write,
    name: &str,
    entries: impl Iterator<Item = impl Serialize>,
) -> Result<(), MotionFileError> {
    write!(out, ",\n{name:?}: [")?;
    for (k, entry) in entries.enumerate() {
        out.write_all(if k == 0 { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut *out, &entry).map_err(io::Error::from)?;
    }
    Ok(write!(out, "\n]")?)
}

fn rows(h: &Homography) -> [[f64; 3]; 3] {
    let m = h.matrix();
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| m[(r, c)]))
}

fn value(field: impl Into<String>, value: impl std::fmt::Display, expected: &'static str) -> MotionFileError {
    MotionFileError::Value { field: field.into(), value: value.to_string(), expected }
}
