//! Content of a motion file, and its checks.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Matrix3;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use super::cameras::InSpace;
#[cfg(feature = "schema")]
use super::tracks::TracksBlock;
use super::tracks::TracksSeed;
use super::{MotionFileError, value};
use crate::motion::clip::ClipMotion;
use crate::motion::frame_motion::{FrameMotion, MotionQuality, PlanarModel};
use crate::motion::planar_fit::{self, Pair};
use crate::track::TrackStore;
use plumbline_num::document::{ValueWithin, pixel_center_shift};
use plumbline_num::math::{Homography, Point2, Similarity2, Vec2};
use plumbline_num::time::{Timebase, Timestamp};

/// Most blocks of a file, and most memory of those of other programs, bytes: they are kept as they are.
const MAX_BLOCKS: usize = 1000;
const MAX_OTHER_BLOCKS: u64 = 100 << 20;

/// Largest side of a picture, px: more is a damaged file.
const MAX_SIDE: u32 = 1 << 16;
/// Longest readout, s, either way: a tenth of a second is three times the slowest phone.
const MAX_READOUT_S: f64 = 0.1;
/// Largest entry of a map, px: beyond, sums lose the pixel.
const MAX_ENTRY: f64 = 1e9;
/// Least scale from one frame to the next, and the inverse of the largest: less is a collapsed picture.
const MIN_SCALE: f64 = 1e-3;

/// Geometry and time of the video that was measured.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Source {
    /// Width of the coded picture, px.
    pub(super) width: u32,
    /// Height of the coded picture, px.
    pub(super) height: u32,
    /// Width as shown, px: after rotation and pixel aspect.
    #[serde(default)]
    pub(super) shown_width: Option<u32>,
    /// Height as shown, px.
    #[serde(default)]
    pub(super) shown_height: Option<u32>,
    /// Clockwise rotation at which the picture is shown, degrees: 0, 90, 180 or 270.
    #[serde(default)]
    pub(super) rotation: u16,
    /// Width and height of one pixel, as a fraction.
    #[serde(default = "square")]
    pub(super) pixel_aspect: [u32; 2],
    /// Length of one tick, s, as a fraction.
    pub(super) time_base: [i32; 2],
}

fn square() -> [u32; 2] {
    [1, 1]
}

/// One frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct FrameEntry {
    /// Presentation time, ticks.
    pub(super) pts: i64,
    /// Index of the shot, from 0.
    pub(super) shot: u32,
    /// The motion model that the points support.
    #[serde(default)]
    pub(super) tier: PlanarModel,
    /// Origin of the motion to this frame.
    #[serde(default = "measured")]
    pub(super) verdict: MotionQuality,
    /// Points observed in this frame and the previous one.
    #[serde(default)]
    pub(super) points: u32,
    /// Those that moved with the background.
    #[serde(default)]
    pub(super) inliers: u32,
    /// Fraction of the frame's cells that contain one, in [0, 1].
    #[serde(default)]
    pub(super) coverage: f64,
    /// Median distance from the homography's prediction, px.
    #[serde(default)]
    pub(super) residual_px: f64,
    /// Median distance from the similarity's prediction, px.
    #[serde(default)]
    pub(super) similarity_residual_px: f64,
}

fn measured() -> MotionQuality {
    MotionQuality::Measured
}

/// A motion file.
#[derive(Default)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Document {
    /// Always `plumbline.motion`.
    format: String,
    /// Always 1.
    version: u32,
    /// Coordinate of the center of the first pixel: 0.5, or 0.
    pub(super) pixel_center: f64,
    /// The video measured.
    pub(super) source: Source,
    /// Time from the first row's capture to the last row's, s.
    #[cfg_attr(feature = "schema", schemars(default))]
    readout_s: Option<f64>,
    /// One entry per frame.
    frames: Vec<FrameEntry>,
    /// Per frame the 3×3 map to the next one, px.
    #[cfg_attr(feature = "schema", schemars(default))]
    planar: Option<Vec<Option<[[f64; 3]; 3]>>>,
    /// Per frame the similarity `[a, b, tx, ty]` to the next one, px.
    #[cfg_attr(feature = "schema", schemars(default))]
    planar_similarity: Option<Vec<Option<[f64; 4]>>>,
    /// The cameras in space.
    #[cfg_attr(feature = "schema", schemars(flatten))]
    in_space: InSpace,
    /// Per frame its points.
    #[cfg_attr(feature = "schema", schemars(default))]
    #[cfg_attr(feature = "schema", schemars(with = "Option<TracksBlock>"))]
    pub(super) tracks: Option<TrackStore>,
    /// Blocks of other programs or later editions.
    #[cfg_attr(feature = "schema", schemars(flatten))]
    other_blocks: BTreeMap<String, serde_json::Value>,
}

/// Read block by block: a derived reader would first store every number of the file in 32 bytes, to find out which blocks it
/// knows, and could not report the line of an invalid value.
impl<'de> Deserialize<'de> for Document {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Blocks)
    }
}

struct Blocks;

impl<'de> Visitor<'de> for Blocks {
    type Value = Document;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a motion file")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Document, A::Error> {
        let (mut document, mut seen) = (Document::default(), Vec::new());
        let left = Cell::new(MAX_OTHER_BLOCKS);
        while let Some(key) = map.next_key::<String>()? {
            // Files of earlier programs spell this key otherwise.
            let key = if key == "pixel_centre" { "pixel_center".to_owned() } else { key };
            if seen.contains(&key) {
                return Err(A::Error::custom(format!("the block {key:?} occurs twice")));
            }
            match key.as_str() {
                "format" => document.format = map.next_value()?,
                "version" => document.version = map.next_value()?,
                "pixel_center" => document.pixel_center = map.next_value()?,
                "source" => document.source = map.next_value()?,
                "readout_s" => document.readout_s = map.next_value()?,
                "frames" => document.frames = map.next_value()?,
                "planar" => document.planar = map.next_value()?,
                "planar_similarity" => document.planar_similarity = map.next_value()?,
                "cameras" => document.in_space.cameras = map.next_value()?,
                "points" => document.in_space.points = map.next_value()?,
                "reconstruction" => document.in_space.reconstruction = map.next_value()?,
                "tracks" => {
                    require(&seen, &["pixel_center", "source", "frames"], "must come before the tracks")?;
                    let times = document.frames.iter().map(|f| Timestamp(f.pts)).collect();
                    let size = (document.source.width, document.source.height);
                    document.tracks = map.next_value_seed(TracksSeed::new(times, size, 0.5 - document.pixel_center))?;
                }
                _ => {
                    let block = map.next_value_seed(ValueWithin { left: &left })?;
                    document.other_blocks.insert(key.clone(), block);
                }
            }
            if seen.len() >= MAX_BLOCKS {
                return Err(A::Error::custom(format!("more than {MAX_BLOCKS} blocks")));
            }
            seen.push(key);
        }
        require(&seen, &["pixel_center", "source", "frames"], "is missing")?;
        Ok(document)
    }
}

fn require<E: Error>(seen: &[String], blocks: &[&str], message: &str) -> Result<(), E> {
    let missing = blocks.iter().find(|b| !seen.iter().any(|s| s == *b));
    missing.map_or(Ok(()), |b| Err(E::custom(format!("the block {b:?} {message}"))))
}

impl Document {
    /// Refuses invalid values.
    pub(super) fn check(&self) -> Result<(), MotionFileError> {
        self.source.check()?;
        if pixel_center_shift(self.pixel_center).is_none() {
            return Err(value("pixel_center", self.pixel_center, "0.5, or 0"));
        }
        if let Some(r) = self.readout_s
            && !(r.abs() <= MAX_READOUT_S)
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

    /// The clip, and its points.
    pub(super) fn into_clip(self) -> Result<(ClipMotion, Option<TrackStore>), MotionFileError> {
        let shift = 0.5 - self.pixel_center;
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
        Ok((clip, self.tracks))
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
            if !(moved.t.amax() <= MAX_ENTRY && (MIN_SCALE..1.0 / MIN_SCALE).contains(&moved.scale())) {
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
            if !(1..=MAX_SIDE).contains(&side) {
                return Err(value(field, side, "1 to 65536 px"));
            }
        }
        if !matches!(self.rotation, 0 | 90 | 180 | 270) {
            return Err(value("source.rotation", self.rotation, "0, 90, 180 or 270 degrees"));
        }
        if self.pixel_aspect.iter().any(|v| !(1..=MAX_SIDE).contains(v)) {
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
    let bounded = h.matrix().iter().all(|v| v.abs() <= MAX_ENTRY) && h.matrix()[(2, 2)] == 1.0;
    (bounded && h.matrix().determinant() >= MIN_SCALE * MIN_SCALE).then_some(h)
}

/// The similarity nearest to `h` on a frame, in least squares over its corners, edges and center.
fn nearest_similarity(h: &Homography, width: u32, height: u32) -> Option<Similarity2> {
    let at = |i: usize, size: u32| f64::from(size) * i as f64 / 2.0;
    let probes = (0..9).map(|k| Point2::new(at(k % 3, width), at(k / 3, height)));
    let pairs: Option<Vec<Pair>> = probes.map(|p| Some(Pair { previous: p, this: h.apply(p)? })).collect();
    planar_fit::similarity(&pairs?, &[1.0; 9])
}
