//! The motion file `plumbline.motion`, version 1: JSON.
//!
//! It is *not* a list of tracks and not a smoothed path; it holds how the picture moved from frame to frame, so that another
//! program can look at it, replace it or hand in its own.
//!
//! ```json
//! {
//!   "format": "plumbline.motion", "version": 1, "pixel_centre": 0.5,
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
//! Where cameras in space are known there are further blocks, see `file_cameras.rs`: `cameras`, `points`, `reconstruction`.
//! Pixel centers lie at integer + 0.5; a file that says `"pixel_centre": 0` is shifted on reading. Blocks of other names are
//! kept, other versions are refused.

use std::collections::BTreeMap;
use std::io::{self, BufWriter, Read, Write};

use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{Homography, Point2, Similarity2, Vec2};
use crate::time::{Timebase, Timestamp};

use super::clip::ClipMotion;
use super::file_cameras::{self, InSpace};
use super::frame_motion::{FrameMotion, MotionQuality, PlanarModel};
use super::planar_fit::{self, Pair};

/// The name in a file's `format` field.
pub const FORMAT: &str = "plumbline.motion";
/// The one version read and written.
pub const VERSION: u32 = 1;
/// Largest side of a picture, px: more is a damaged file.
const LARGEST_SIDE: u32 = 1 << 16;
/// Largest file read, bytes: ten hours of video at 60 frames/s.
const LARGEST_FILE: u64 = 1 << 30;
/// Longest readout, s, either way: a tenth of a second is three times the slowest phone.
const LONGEST_READOUT_S: f64 = 0.1;

/// Largest entry of a map, px: beyond, sums lose the pixel.
const LARGEST_ENTRY: f64 = 1e9;
/// Least scale from one frame to the next, and the inverse of the largest: less is a collapsed picture.
const LEAST_SCALE: f64 = 1e-3;

/// Why a motion file was refused or could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MotionFileError {
    /// The file is not JSON of the expected shape.
    #[error("not a motion file: {0}")]
    Syntax(#[source] serde_json::Error),
    /// The file is some other JSON.
    #[error("format {found:?} is not a motion file (expected \"plumbline.motion\")")]
    Format {
        /// What `format` says.
        found: String,
    },
    /// The file was made by a program of another version.
    #[error("motion file version {found} is not supported (expected 1); export the motion again with this program")]
    Version {
        /// What `version` says.
        found: u64,
    },
    /// A value that no clip has.
    #[error("{field} is {value} (expected {expected})")]
    Value {
        /// Where in the file.
        field: String,
        /// What stands there.
        value: String,
        /// What may stand there.
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
    /// The file is larger than any clip's motion.
    #[error("motion file is larger than {limit} bytes; split the clip")]
    TooLarge {
        /// Largest accepted size, bytes.
        limit: u64,
    },
    /// Reading or writing failed.
    #[error("motion file: {0}")]
    Io(#[from] io::Error),
}

/// Geometry and time of the video that was measured.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct Source {
    /// Width of the coded picture, px.
    width: u32,
    /// Height of the coded picture, px.
    height: u32,
    /// Width as shown, px: after rotation and pixel aspect.
    #[serde(default)]
    shown_width: Option<u32>,
    /// Height as shown, px.
    #[serde(default)]
    shown_height: Option<u32>,
    /// Clockwise turn at which the picture is shown, degrees: 0, 90, 180 or 270.
    #[serde(default)]
    rotation: u16,
    /// Width and height of one pixel, as a fraction.
    #[serde(default = "square")]
    pixel_aspect: [u32; 2],
    /// Length of one tick, s, as a fraction.
    time_base: [i32; 2],
}

fn square() -> [u32; 2] {
    [1, 1]
}

/// One frame.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
struct FrameEntry {
    /// Presentation time, ticks.
    pts: i64,
    /// Index of the shot, from 0.
    shot: u32,
    /// The family of motion the points support.
    #[serde(default)]
    tier: PlanarModel,
    /// Where the motion to this frame comes from.
    #[serde(default = "measured")]
    verdict: MotionQuality,
    /// Points seen in this frame and the previous one.
    #[serde(default)]
    points: u32,
    /// Those that moved with the background.
    #[serde(default)]
    inliers: u32,
    /// Share of the frame's cells that hold one, in [0, 1].
    #[serde(default)]
    coverage: f64,
    /// Median distance from the homography's prediction, px.
    #[serde(default)]
    residual_px: f64,
    /// Median distance from the similarity's prediction, px.
    #[serde(default)]
    similarity_residual_px: f64,
}

fn measured() -> MotionQuality {
    MotionQuality::Measured
}

/// A motion file.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
struct Document {
    /// Always `plumbline.motion`.
    #[allow(dead_code, reason = "checked by the probe that reads format and version first; here for the schema")]
    format: String,
    /// Always 1.
    #[allow(dead_code, reason = "likewise")]
    version: u32,
    /// Where the center of the first pixel lies: 0.5, or 0.
    pixel_centre: f64,
    /// The video measured.
    source: Source,
    /// Time from the first row's capture to the last row's, s.
    #[serde(default)]
    readout_s: Option<f64>,
    /// One entry per frame.
    frames: Vec<FrameEntry>,
    /// Per frame the 3×3 map to the next one, px.
    #[serde(default)]
    planar: Option<Vec<Option<[[f64; 3]; 3]>>>,
    /// Per frame the similarity `[a, b, tx, ty]` to the next one, px.
    #[serde(default)]
    planar_similarity: Option<Vec<Option<[f64; 4]>>>,
    /// The cameras in space.
    #[serde(flatten)]
    in_space: InSpace,
    /// Blocks of other programs or later editions.
    #[serde(flatten)]
    other_blocks: BTreeMap<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct Probe {
    format: String,
    version: u64,
}

/// The JSON schema of the motion file.
pub fn motion_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

impl ClipMotion {
    /// Reads a motion file.
    ///
    /// # Errors
    /// [`MotionFileError`]: not JSON, another format or version, a value out of range, a block of the wrong length, a file
    /// that is too large or cannot be read.
    pub fn read_json(reader: impl Read) -> Result<Self, MotionFileError> {
        let mut bytes = Vec::new();
        reader.take(LARGEST_FILE + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > LARGEST_FILE {
            return Err(MotionFileError::TooLarge { limit: LARGEST_FILE });
        }
        Self::from_json(&bytes)
    }

    /// Reads a motion file from memory.
    ///
    /// # Errors
    /// As [`Self::read_json`].
    pub fn from_json(bytes: &[u8]) -> Result<Self, MotionFileError> {
        let probe: Probe = serde_json::from_slice(bytes).map_err(MotionFileError::Syntax)?;
        if probe.format != FORMAT {
            return Err(MotionFileError::Format { found: probe.format });
        }
        if probe.version != u64::from(VERSION) {
            return Err(MotionFileError::Version { found: probe.version });
        }
        let document: Document = serde_json::from_slice(bytes).map_err(MotionFileError::Syntax)?;
        document.check()?;
        document.into_clip()
    }

    /// Writes the clip as a motion file, one frame per line, without building it in memory.
    ///
    /// # Errors
    /// [`MotionFileError::Value`] for a motion that is not finite, [`MotionFileError::Io`] where the writer fails.
    pub fn write_json(&self, writer: impl Write) -> Result<(), MotionFileError> {
        let mut out = BufWriter::new(writer);
        self.write_header(&mut out)?;
        let entries = (0..self.frames.len()).map(|k| self.entry(k));
        write_block(&mut out, "frames", entries)?;
        let next = |k: usize| self.frames.get(k + 1).filter(|f| f.quality != MotionQuality::ShotStart);
        for (k, frame) in self.frames.iter().enumerate() {
            let s = frame.similarity;
            if !(frame.homography.is_finite() && [s.a, s.b, s.t.x, s.t.y].iter().all(|v| v.is_finite())) {
                return Err(value(format!("motion of frame {k}"), "not finite", "finite numbers"));
            }
        }
        let planar = (0..self.frames.len()).map(|k| next(k).map(|f| rows(&f.homography)));
        write_block(&mut out, "planar", planar)?;
        let similar = |f: &FrameMotion| [f.similarity.a, f.similarity.b, f.similarity.t.x, f.similarity.t.y];
        write_block(&mut out, "planar_similarity", (0..self.frames.len()).map(|k| next(k).map(similar)))?;
        if let Some(cameras) = &self.cameras {
            file_cameras::write(&mut out, cameras)?;
        }
        for (name, block) in &self.other_blocks {
            write!(out, ",\n{}: ", serde_json::to_string(name).map_err(MotionFileError::Syntax)?)?;
            serde_json::to_writer(&mut out, block).map_err(MotionFileError::Syntax)?;
        }
        writeln!(out, "\n}}")?;
        Ok(out.flush()?)
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
        let source = serde_json::to_string(&source).map_err(MotionFileError::Syntax)?;
        let readout = serde_json::to_string(&self.readout_s).map_err(MotionFileError::Syntax)?;
        write!(out, "{{\n\"format\": {FORMAT:?}, \"version\": {VERSION}, \"pixel_centre\": 0.5,\n")?;
        Ok(write!(out, "\"source\": {source},\n\"readout_s\": {readout}")?)
    }

    /// Width and height as shown, px: pixel aspect applied to the width, then turned.
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

pub(super) fn write_block(
    out: &mut impl Write,
    name: &str,
    entries: impl Iterator<Item = impl Serialize>,
) -> Result<(), MotionFileError> {
    write!(out, ",\n{name:?}: [")?;
    for (k, entry) in entries.enumerate() {
        out.write_all(if k == 0 { b"\n" } else { b",\n" })?;
        serde_json::to_writer(&mut *out, &entry).map_err(MotionFileError::Syntax)?;
    }
    Ok(write!(out, "\n]")?)
}

fn rows(h: &Homography) -> [[f64; 3]; 3] {
    let m = h.matrix();
    [0, 1, 2].map(|r| [0, 1, 2].map(|c| m[(r, c)]))
}

pub(super) fn value(
    field: impl Into<String>,
    value: impl std::fmt::Display,
    expected: &'static str,
) -> MotionFileError {
    MotionFileError::Value { field: field.into(), value: value.to_string(), expected }
}

impl Document {
    fn check(&self) -> Result<(), MotionFileError> {
        self.source.check()?;
        if self.pixel_centre != 0.5 && self.pixel_centre != 0.0 {
            return Err(value("pixel_centre", self.pixel_centre, "0.5, or 0"));
        }
        if let Some(r) = self.readout_s
            && !(r.abs() <= LONGEST_READOUT_S)
        {
            return Err(value("readout_s", r, "-0.1 to 0.1 s"));
        }
        let frames = self.frames.len();
        let lengths = [
            ("planar", self.planar.as_ref().map(Vec::len)),
            ("planar_similarity", self.planar_similarity.as_ref().map(Vec::len)),
        ];
        for (block, found) in lengths {
            if let Some(found) = found.filter(|n| *n != frames) {
                return Err(MotionFileError::Length { block, found, frames });
            }
        }
        self.in_space.check(frames)?;
        self.check_frames()
    }

    fn check_frames(&self) -> Result<(), MotionFileError> {
        for (k, pair) in self.frames.windows(2).enumerate() {
            if pair[1].pts <= pair[0].pts {
                return Err(value(format!("frames[{}].pts", k + 1), pair[1].pts, "later than the frame before"));
            }
            if pair[1].shot != pair[0].shot && Some(pair[1].shot) != pair[0].shot.checked_add(1) {
                return Err(value(
                    format!("frames[{}].shot", k + 1),
                    pair[1].shot,
                    "that of the frame before, or one more",
                ));
            }
        }
        for (k, frame) in self.frames.iter().enumerate() {
            let measures = [frame.coverage, frame.residual_px, frame.similarity_residual_px];
            if !measures.iter().all(|v| v.is_finite() && *v >= 0.0) {
                return Err(value(
                    format!("frames[{k}]"),
                    format!("{measures:?}"),
                    "coverage and residuals of 0 or more",
                ));
            }
        }
        Ok(())
    }

    fn into_clip(self) -> Result<ClipMotion, MotionFileError> {
        let shift = 0.5 - self.pixel_centre;
        let mut frames: Vec<FrameMotion> = Vec::with_capacity(self.frames.len());
        for (k, entry) in self.frames.iter().enumerate() {
            let cut = k == 0 || self.frames[k - 1].shot != entry.shot;
            let mut motion = entry.motion(cut);
            if !cut {
                let (planar, similar) = (&self.planar, &self.planar_similarity);
                let matrix = planar.as_ref().and_then(|p| p[k - 1]);
                let similar = similar.as_ref().and_then(|p| p[k - 1]);
                self.set_motion(&mut motion, k, matrix, similar, shift)?;
            }
            frames.push(motion);
        }
        let source = &self.source;
        let timebase = Timebase { num: source.time_base[0], den: source.time_base[1] };
        let mut clip = ClipMotion::unbridged(source.width, source.height, timebase, frames);
        clip.rotation = source.rotation;
        clip.pixel_aspect = (source.pixel_aspect[0], source.pixel_aspect[1]);
        clip.readout_s = self.readout_s;
        clip.cameras = self.in_space.into_cameras(shift);
        clip.other_blocks = self.other_blocks;
        Ok(clip)
    }

    fn set_motion(
        &self,
        motion: &mut FrameMotion,
        k: usize,
        matrix: Option<[[f64; 3]; 3]>,
        similar: Option<[f64; 4]>,
        shift: f64,
    ) -> Result<(), MotionFileError> {
        if let Some(r) = matrix {
            motion.homography = shifted(&r, shift).ok_or_else(|| {
                value(
                    format!("planar[{}]", k - 1),
                    format!("{r:?}"),
                    "a 3×3 map that keeps the picture upright and in sight",
                )
            })?;
            motion.similarity = nearest_similarity(&motion.homography, self.source.width, self.source.height)
                .ok_or_else(|| value(format!("planar[{}]", k - 1), format!("{r:?}"), "a map of the whole frame"))?;
        }
        if let Some([a, b, tx, ty]) = similar {
            let linear = Similarity2 { a, b, t: Vec2::zeros() };
            let center = Point2::new(shift, shift);
            let moved = Similarity2 { t: Vec2::new(tx, ty) + center.coords - linear.apply(center).coords, ..linear };
            if !(moved.t.amax() <= LARGEST_ENTRY && (LEAST_SCALE..1.0 / LEAST_SCALE).contains(&moved.scale())) {
                return Err(value(
                    format!("planar_similarity[{}]", k - 1),
                    format!("{:?}", [a, b, tx, ty]),
                    "a scale of 0.001 to 1000 and a shift in sight",
                ));
            }
            motion.similarity = moved;
            if matrix.is_none() {
                motion.homography = moved.to_homography();
            }
        }
        if matrix.is_none() && similar.is_none() && motion.quality != MotionQuality::Duplicate {
            motion.quality = MotionQuality::Lost;
        }
        Ok(())
    }
}

impl Source {
    fn check(&self) -> Result<(), MotionFileError> {
        for (field, side) in [("source.width", self.width), ("source.height", self.height)] {
            if !(1..=LARGEST_SIDE).contains(&side) {
                return Err(value(field, side, "1 to 65536 px"));
            }
        }
        if !matches!(self.rotation, 0 | 90 | 180 | 270) {
            return Err(value("source.rotation", self.rotation, "0, 90, 180 or 270 degrees"));
        }
        if self.pixel_aspect.iter().any(|v| !(1..=LARGEST_SIDE).contains(v)) {
            return Err(value("source.pixel_aspect", format!("{:?}", self.pixel_aspect), "two numbers of 1 to 65536"));
        }
        if self.time_base.iter().any(|v| *v < 1) {
            return Err(value("source.time_base", format!("{:?}", self.time_base), "two numbers of 1 or more"));
        }
        Ok(())
    }
}

impl FrameEntry {
    fn motion(&self, cut: bool) -> FrameMotion {
        let quality = match (cut, self.verdict) {
            (true, _) => MotionQuality::ShotStart,
            (false, MotionQuality::ShotStart) => MotionQuality::Measured,
            (false, verdict) => verdict,
        };
        FrameMotion {
            model: self.tier,
            points: self.points,
            inliers: self.inliers,
            coverage: self.coverage,
            residual_px: self.residual_px,
            similarity_residual_px: self.similarity_residual_px,
            ..FrameMotion::still(Timestamp(self.pts), quality)
        }
    }
}

/// The map in coordinates moved by `shift` px both ways; `None` where it is not finite or not invertible.
fn shifted(r: &[[f64; 3]; 3], shift: f64) -> Option<Homography> {
    let m = Matrix3::from_fn(|i, j| r[i][j]);
    let there = Matrix3::new(1.0, 0.0, shift, 0.0, 1.0, shift, 0.0, 0.0, 1.0);
    let back = Matrix3::new(1.0, 0.0, -shift, 0.0, 1.0, -shift, 0.0, 0.0, 1.0);
    let h = if shift == 0.0 { Homography::new(m) } else { Homography::new(there * m * back) };
    let bounded = h.matrix().iter().all(|v| v.abs() <= LARGEST_ENTRY) && h.matrix()[(2, 2)] == 1.0;
    (bounded && h.matrix().determinant() >= LEAST_SCALE * LEAST_SCALE).then_some(h)
}

/// The similarity nearest to `h` on a frame, in least squares over its corners, edges and center.
fn nearest_similarity(h: &Homography, width: u32, height: u32) -> Option<Similarity2> {
    let at = |i: usize, size: u32| f64::from(size) * i as f64 / 2.0;
    let probes = (0..9).map(|k| Point2::new(at(k % 3, width), at(k / 3, height)));
    let pairs: Option<Vec<Pair>> = probes.map(|p| Some(Pair { previous: p, this: h.apply(p)? })).collect();
    planar_fit::similarity(&pairs?, &[1.0; 9])
}
