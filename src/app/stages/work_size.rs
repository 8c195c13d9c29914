//! How much a job has to do, by what its inputs state of themselves: no pixel is decoded and no mesh parsed.

use std::path::Path;

use super::{DecodeSettings, ImageLoadSettings, MeshLoadSettings, probe};
use crate::pipeline::batch::Instance;
use crate::pipeline::estimate::WorkSize;
use crate::pipeline::memory::ClipShape;
use crate::pipeline::paths::to_path;
use crate::pipeline::units::ClipTime;
use plumbline_image::still::{self, LoadOptions};

/// Bytes of a mesh file per vertex: of scans and models with two triangles for each vertex, as our own writer has them.
const BYTES_PER_VERTEX: [(&str, f64); 6] =
    [("obj", 75.0), ("off", 60.0), ("ply", 38.0), ("stl", 100.0), ("glb", 60.0), ("gltf", 60.0)];
/// Bytes of a photo per pixel, where its head does not state a size: HEIC and AVIF.
const BYTES_PER_PX: f64 = 0.2;
/// Most shapes and frames that count: figures of settings may be anything.
const MAX_COUNT: f64 = 1e9;

/// The work of an instance; `clip`: what is known of its clip, which is probed otherwise.
pub(super) fn work_size(instance: &Instance, clip: Option<&ClipShape>) -> WorkSize {
    let stages = || instance.graph.stages.iter();
    let mut work = WorkSize::default();
    if let Some(decode) = stages().find_map(|s| s.settings.get::<DecodeSettings>()) {
        let path = to_path(&decode.path);
        let known = clip.copied().or_else(|| probe::probe(&path, decode.allow_playlist).ok()?.shape);
        if let Some(shape) = known {
            work.megapixels = f64::from(shape.width) * f64::from(shape.height) / 1e6;
            work.frames = shape.frames.unwrap_or(0) as f64 * fraction_read(decode, &path);
        }
    }
    if let Some(load) = stages().find_map(|s| s.settings.get::<ImageLoadSettings>()) {
        let path = to_path(&load.path);
        let size = still::size(&path, LoadOptions { max_pixels: load.max_pixels });
        work.megapixels = size.map_or_else(|_| bytes_of(&path) / BYTES_PER_PX, |(w, h)| w as f64 * h as f64) / 1e6;
    }
    for load in stages().filter_map(|s| s.settings.get::<MeshLoadSettings>()) {
        let path = to_path(&load.path);
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        let known = BYTES_PER_VERTEX.iter().find(|(name, _)| *name == extension);
        work.kilovertices += bytes_of(&path) / known.map_or(60.0, |(_, bytes)| *bytes) / 1e3;
        work.shapes = 1.0;
    }
    if work.kilovertices > 0.0 {
        let frames = stages().filter_map(|s| s.settings.to_json()["frames"].as_f64());
        work.shapes = frames.fold(work.shapes, f64::max).min(MAX_COUNT);
    }
    work.frames = work.frames.min(MAX_COUNT);
    work
}

/// Part of a clip that is read.
fn fraction_read(decode: &DecodeSettings, path: &Path) -> f64 {
    let (start, end) = (decode.start.map(ClipTime::seconds), decode.end.map(ClipTime::seconds));
    if start.is_none() && end.is_none() {
        return 1.0;
    }
    let length = probe::seconds(path).ok().flatten().filter(|length| *length > 0.0);
    let part = |length: f64| (end.unwrap_or(length).min(length) - start.unwrap_or(0.0)) / length;
    length.map_or(1.0, |length| part(length).clamp(0.0, 1.0))
}

fn bytes_of(path: &Path) -> f64 {
    path.metadata().map_or(0.0, |meta| meta.len() as f64)
}
