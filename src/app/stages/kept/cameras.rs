//! The cameras of a clip in space, which structure from motion recovers from its tracks.

use std::io::{self, BufWriter, Write};
use std::time::Instant;

use serde_json::json;

use super::{CAMERAS, Kept, Slot, kept};
use crate::pipeline::RunError;
use crate::stages::context::Context;
use crate::stages::{MotionSettings, RollingShutter};
use plumbline_video::motion::{ClipCameras, ClipMotion};
use plumbline_video::stabilize::{Tracks, complete_motion};

impl Kept for ClipCameras {
    const FILES: &'static [&'static str] = &["cameras.json"];

    fn to_files(&self) -> Option<Vec<Vec<u8>>> {
        Some(vec![self.to_json().ok()?.into_bytes()])
    }

    fn of_files(files: &[Vec<u8>]) -> Result<Self, String> {
        let text = str::from_utf8(&files[0]).map_err(|e| e.to_string())?;
        Self::from_json(text).map_err(|e| e.to_string())
    }
}

/// [`complete_motion`] for motion stage number `stage`, with cameras from the cache where they are there.
pub(crate) fn with_cameras(
    context: &mut Context<'_, '_>,
    stage: usize,
    motion: &mut ClipMotion,
    tracks: &Tracks,
    settings: &MotionSettings,
    focal_px: Option<f64>,
) -> Result<(), RunError> {
    if settings.cameras && motion.cameras.is_none() {
        let slot = Slot::of(context, stage, &CAMERAS, |_| {
            Ok([
                ("tracks", json!(digest(motion, tracks)?)),
                ("focal_px", json!(focal_px)),
                ("rolling_shutter", json!(settings.rolling_shutter != RollingShutter::Off)),
            ])
        });
        let frames = motion.frames.len();
        let fits = |cameras: &ClipCameras| cameras.frames.len() == frames;
        let cameras = kept(slot.as_ref(), context, fits, |context| {
            let started = Instant::now();
            complete_motion(motion, tracks, settings, focal_px, &context.job.run())?;
            let kind = context.stage(stage).kind.name;
            context.summary.note_seconds(kind, started.elapsed().as_secs_f64());
            Ok(motion.cameras.take().unwrap_or_default())
        })?;
        motion.cameras = Some(cameras);
    }
    Ok(complete_motion(motion, tracks, settings, focal_px, &context.job.run())?)
}

/// BLAKE3 of what cameras are recovered from: the points of each frame, and the shots.
fn digest(motion: &ClipMotion, tracks: &Tracks) -> io::Result<String> {
    let mut hasher = BufWriter::with_capacity(1 << 16, blake3::Hasher::new());
    let shots = &motion.shots;
    writeln!(hasher, "{} {} {} {shots:?}", motion.width, motion.height, motion.frames.len())?;
    for frame in 0..tracks.store.frames() {
        let points = tracks.store.read(frame).map_err(io::Error::other)?.observations;
        hasher.write_all(&(points.len() as u64).to_le_bytes())?;
        for point in points {
            [point.id, point.x.to_bits(), point.y.to_bits()]
                .iter()
                .try_for_each(|word| hasher.write_all(&word.to_le_bytes()))?;
        }
    }
    let hasher = hasher.into_inner().map_err(io::IntoInnerError::into_error)?;
    Ok(hasher.finalize().to_hex().to_string())
}
