//! The shipped model: what each kind of stage takes, in coefficients that were measured.
//!
//! CPU time on one thread of a shared machine with two cores (x86-64, AVX2; release build), of `media/street-walk.mp4` and
//! `rolling-passer.mp4` at 320×180, 640×360 and 1280×720, and of photos of 12 and 100 megapixels; for kinds without a figure the order of
//! magnitude. Another machine differs by a factor, which [`Calibration`](super::Calibration) finds; what a coefficient decides is how the
//! time divides among stages and grows with the work. One that is off by a factor of two moves the estimate of a machine without
//! past runs by at most that, and hardly that of one with some.

use super::WorkSize;
use crate::pipeline::graph::{Graph, Stage};
use crate::stages::parts::{CamerasPartSettings, ChunkSettings, KnownTracksSettings, WindowsSettings};
use crate::stages::{
    Border, Codec, EncodeSettings, ImageSaveSettings, InSpace, LensUndistortSettings, MotionSettings, RenderSettings,
    SmoothSettings, VideoImportanceSettings,
};

/// Seconds until a task begins to work: the program starts, a clip is opened.
pub(super) const START_S: f64 = 0.05;

/// Seconds to join a frame of a chunk to the others.
pub(super) const JOIN_S: f64 = 0.0001;

/// Coefficients of a stage, seconds on one thread.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    /// However small the work is.
    fixed: f64,
    per_frame: f64,
    per_frame_mpx: f64,
    per_mpx: f64,
    per_kilovertex: f64,
    /// For each shape made of a thousand vertices.
    per_shape: f64,
}

impl Rate {
    fn of(self, work: &WorkSize) -> f64 {
        let WorkSize { frames, megapixels, kilovertices, shapes } = *work;
        self.fixed
            + frames * (self.per_frame + self.per_frame_mpx * megapixels)
            + self.per_mpx * megapixels
            + kilovertices * (self.per_kilovertex + self.per_shape * shapes)
    }

    const fn frames(per_frame: f64, per_frame_mpx: f64) -> Self {
        Self { per_frame, per_frame_mpx, ..Self::NONE }
    }

    const fn photo(fixed: f64, per_mpx: f64) -> Self {
        Self { fixed, per_mpx, ..Self::NONE }
    }

    const fn mesh(fixed: f64, per_kilovertex: f64) -> Self {
        Self { fixed, per_kilovertex, ..Self::NONE }
    }

    const fn shapes(per_kilovertex: f64, per_shape: f64) -> Self {
        Self { per_kilovertex, per_shape, ..Self::NONE }
    }

    const NONE: Self =
        Self { fixed: 0.0, per_frame: 0.0, per_frame_mpx: 0.0, per_mpx: 0.0, per_kilovertex: 0.0, per_shape: 0.0 };
}

/// What a stage takes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cost {
    /// On one thread.
    single_s: f64,
    /// Part of it that threads divide among them.
    parallel: f64,
    /// Size of its results.
    pub(super) bytes: f64,
}

impl Cost {
    /// Wall time on so many threads, s.
    pub(super) fn seconds(&self, threads: usize) -> f64 {
        self.single_s * (1.0 - self.parallel + self.parallel / threads.max(1) as f64)
    }
}

/// Reading the frames of a clip, H.264.
const DECODE: Rate = Rate::frames(0.0004, 0.006);
/// Following points: 7.6, 14.3 and 23 ms per frame at the three sizes, decoding included. Pictures are shrunk to 640 px first.
fn track(megapixels: f64) -> Rate {
    /// A picture of 640×360.
    const ANALYZED_MPX: f64 = 0.23;
    Rate::frames(0.004 + 0.03 * megapixels.min(ANALYZED_MPX), 0.0)
}
/// Cameras in space: 9 to 20 ms per frame, whatever its size; a still scene takes less, one with depth more.
const CAMERAS_S: f64 = 0.013;
/// Importance of a clip, several times a second.
const IMPORTANCE: Rate = Rate::frames(0.002, 0.0005);
/// Choosing models and sampling a frame through its map: 24, 61 and 137 ms per frame with decoding and x264 at its default preset.
const RENDER: Rate = Rate::frames(0.012, 0.05);
/// Frames whose borders are filled from their neighbors.
const FILL: Rate = Rate::frames(0.01, 0.05);

/// Encoding a frame: seconds, and bytes of it.
fn encoding(settings: &EncodeSettings) -> (Rate, f64) {
    let codec = settings.codec();
    match codec {
        Codec::H264 | Codec::Hevc => {
            let slower = if codec == Codec::Hevc { 3.0 } else { 1.0 };
            let rate = match settings.preset.as_deref() {
                Some("ultrafast" | "superfast") => 0.006,
                Some("veryfast" | "faster" | "fast") => 0.02,
                Some("slow" | "slower" | "veryslow") => 0.15,
                _ => 0.07,
            };
            (Rate::frames(0.003, slower * rate), 0.15)
        }
        Codec::Av1 => (Rate::frames(0.002, 0.2), 0.08),
        Codec::Prores => (Rate::frames(0.0005, 0.03), 1.0),
        Codec::Ffv1 => (Rate::frames(0.0005, 0.04), 1.0),
    }
}

fn add(a: Rate, b: Rate) -> Rate {
    Rate {
        fixed: a.fixed + b.fixed,
        per_frame: a.per_frame + b.per_frame,
        per_frame_mpx: a.per_frame_mpx + b.per_frame_mpx,
        per_mpx: a.per_mpx + b.per_mpx,
        per_kilovertex: a.per_kilovertex + b.per_kilovertex,
        per_shape: a.per_shape + b.per_shape,
    }
}

/// The stages of a graph that take time, each with what it takes for this work.
pub(super) fn costs<'g>(graph: &'g Graph, work: &WorkSize) -> Vec<(&'g Stage, Cost)> {
    graph.stages.iter().map(|stage| (stage, cost(graph, stage, work))).collect()
}

fn cost(graph: &Graph, stage: &Stage, work: &WorkSize) -> Cost {
    let mut work = *work;
    let (rate, parallel, bytes) = of_clip(graph, stage, &mut work).unwrap_or_else(|| of_still(stage, &work));
    Cost { single_s: rate.of(&work), parallel, bytes }
}

/// Coefficients, part of them that threads divide, and bytes; `None` for a stage that is not of a clip.
fn of_clip(graph: &Graph, stage: &Stage, work: &mut WorkSize) -> Option<(Rate, f64, f64)> {
    let settings = &stage.settings;
    let has = |is: fn(&Stage) -> bool| graph.stages.iter().any(is);
    let pixels = |work: &WorkSize| 1e6 * work.frames * work.megapixels;
    let estimates_importance = has(|s| s.settings.get::<VideoImportanceSettings>().is_some());
    Some(match stage.kind.name {
        // What they describe is done by the stages that take frames from them.
        "video.decode" | "video.warp" | "video.render" | "lens.undistort" | "video.motion_import" => {
            (Rate::NONE, 0.0, 0.0)
        }
        "video.track" => {
            let track = track(work.megapixels);
            let seen = if estimates_importance { add(track, IMPORTANCE) } else { track };
            (add(DECODE, seen), 0.4, 0.0)
        }
        "video.importance" if has(|s| s.kind.name == "video.track") => (Rate::NONE, 0.0, 0.0),
        "video.importance" => (add(DECODE, IMPORTANCE), 0.4, 0.0),
        "part.windows" => {
            work.frames = settings.get::<WindowsSettings>().map_or(0.0, |s| s.span.frames.len() as f64);
            (add(DECODE, track(work.megapixels)), 0.4, 5e3 * work.frames)
        }
        // Cameras in space, from the tracks.
        "video.motion" => {
            let known = has(|s| s.settings.get::<KnownTracksSettings>().is_some());
            let cameras = !known && settings.get::<MotionSettings>().is_some_and(|s| s.cameras);
            (Rate::frames(if cameras { CAMERAS_S } else { 0.0 }, 0.0), 0.5, 0.0)
        }
        "video.smooth" => {
            let in_space = settings.get::<SmoothSettings>().is_some_and(|s| s.in_space == InSpace::Always);
            (Rate::frames(if in_space { 0.004 } else { 0.002 }, 0.0), 0.0, 0.0)
        }
        "video.retarget" => (Rate::frames(0.001, 0.0), 0.0, 0.0),
        "video.motion_export" => (Rate::frames(0.0001, 0.0), 0.0, 500.0 * work.frames),
        "video.stmap" => (Rate::frames(0.01, 0.1), 0.5, 8.0 * pixels(work)),
        "video.report" => (Rate { fixed: 0.3, ..Rate::frames(0.0005, 0.0) }, 0.0, 1e6),
        "video.encode" => {
            let (encode, bytes_per_px) = encoding(settings.get::<EncodeSettings>()?);
            let renders = graph.stages.iter().find_map(|s| s.settings.get::<RenderSettings>());
            let lens = has(|s| s.settings.get::<LensUndistortSettings>().is_some());
            let rendered = match renders {
                Some(render) if render.border == Border::Fill => add(RENDER, FILL),
                Some(_) => RENDER,
                None if lens => RENDER,
                None => Rate::NONE,
            };
            (add(add(DECODE, rendered), encode), 0.7, bytes_per_px * pixels(work))
        }
        "part.chunk" => {
            let chunk = settings.get::<ChunkSettings>()?;
            work.frames = chunk.span.frames.len() as f64;
            let (encode, bytes_per_px) = encoding(&chunk.encode);
            (add(add(DECODE, RENDER), encode), 0.7, bytes_per_px * pixels(work))
        }
        "part.motion" => (Rate::frames(0.001, 0.0), 0.0, 8e3 * work.frames),
        "part.cameras" => {
            work.frames = settings.get::<CamerasPartSettings>()?.expected_frames() as f64;
            (Rate::frames(CAMERAS_S, 0.0), 0.5, 500.0 * work.frames)
        }
        "part.tracks" => (Rate::frames(0.0005, 0.0), 0.0, 0.0),
        "part.plan" => (Rate::frames(0.001, 0.0), 0.0, 1e3 * work.frames),
        _ => return None,
    })
}

/// The same of a photo or a mesh.
fn of_still(stage: &Stage, work: &WorkSize) -> (Rate, f64, f64) {
    let (rate, parallel) = match stage.kind.name {
        // Rectified with lines found, 12 and 100 megapixels: .86 and 3.8 s; given a new shape .54 and 2.8 s.
        "image.load" => (Rate::photo(0.002, 0.01), 0.0),
        "lines.detect" => (Rate::photo(0.05, 0.006), 0.0),
        "faces.detect" => (Rate::photo(0.2, 0.002), 0.5),
        "image.importance" => (Rate::photo(0.01, 0.003), 0.5),
        "photo.rectify" => (Rate::photo(0.2, 0.002), 0.0),
        "photo.rectangle" | "photo.retarget" => (Rate::photo(0.1, 0.0), 0.0),
        "photo.report" => (Rate::photo(0.1, 0.02), 0.5),
        "image.render" => (Rate::photo(0.005, 0.01), 0.9),
        "image.grid" | "image.map_export" => (Rate::photo(0.01, 0.05), 0.5),
        "image.save" => (saving(stage), 0.8),
        "mesh.load" => (Rate::mesh(0.001, 0.001), 0.0),
        "mesh.deform" => (Rate::shapes(0.01, 0.01), 0.0),
        "mesh.modes" => (Rate::mesh(0.05, 0.1), 0.0),
        "skin.weights" => (Rate::mesh(0.01, 0.02), 0.0),
        "skeleton.extract" => (Rate::mesh(0.05, 0.02), 0.0),
        "skin.train" => (Rate::mesh(0.1, 0.1), 0.5),
        "character.pose" => (Rate::shapes(0.005, 0.0005), 0.0),
        "mesh.morph" | "mesh.blend" => (Rate::shapes(0.05, 0.005), 0.3),
        "mesh.compose" => (Rate::mesh(0.1, 0.05), 0.3),
        "mesh.render" => (Rate::mesh(0.1, 0.002), 0.5),
        "mesh.save" => (Rate::shapes(0.0, 0.0005), 0.0),
        _ => (Rate::NONE, 0.0),
    };
    (rate, parallel, stored(stage, work))
}

/// Writing a photo by its format.
fn saving(stage: &Stage) -> Rate {
    match extension(stage).as_str() {
        "png" | "webp" => Rate::photo(0.005, 0.1),
        _ => Rate::photo(0.005, 0.01),
    }
}

/// Bytes of the results of a photo or a mesh.
fn stored(stage: &Stage, work: &WorkSize) -> f64 {
    let shapes = work.kilovertices * work.shapes.max(1.0);
    match stage.kind.name {
        "image.save" => {
            let per_px = match extension(stage).as_str() {
                "png" | "webp" => 1.6,
                "tif" | "tiff" => 3.0,
                _ => 0.4,
            };
            1e6 * per_px * work.megapixels
        }
        "image.map_export" => 8e6 * work.megapixels,
        "mesh.save" => 6e4 * shapes,
        "mesh.render" => 2e5,
        _ => 0.0,
    }
}

fn extension(stage: &Stage) -> String {
    let path = stage.settings.get::<ImageSaveSettings>().map(|save| save.path.as_str()).unwrap_or_default();
    std::path::Path::new(path).extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::KINDS;

    /// Kinds that take no time worth a row: they read and write small files.
    const SMALL: [&str; 4] = ["lines.load", "lines.save", "faces.load", "skeleton.load"];

    #[test]
    fn every_kind_has_a_row() {
        let source = include_str!("model.rs");
        for kind in KINDS.iter().filter(|kind| !SMALL.contains(&kind.name)) {
            assert!(source.contains(&format!("\"{}\"", kind.name)), "{} has no coefficients", kind.name);
        }
    }

    #[test]
    fn threads_divide_a_part() {
        let cost = Cost { single_s: 10.0, parallel: 0.5, bytes: 0.0 };
        assert_eq!([0, 1, 2, 5].map(|threads| cost.seconds(threads)), [10.0, 10.0, 7.5, 6.0]);
    }
}
