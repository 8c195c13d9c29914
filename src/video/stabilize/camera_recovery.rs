//! Camera motion beyond the planar: the readout time of the sensor, and the camera's poses in space.

use std::ops::Range;

use super::error::StabilizeError;
use super::options::CameraMotionOptions;
use super::rolling_shutter::RollingShutter;
use super::tracks::Tracks;
use crate::motion::sfm::{SfmOptions, TrackTable, Windows, reconstruct_shot};
use crate::motion::{ClipCameras, ClipMotion};
use crate::track::TrackStore;
use plumbline_num::math::Point2;
use plumbline_num::run::Run;

/// Standard deviation of the logarithm of the focal length in the metadata of a container: its whole millimeters are 4 % apart for
/// a phone, and a clip stabilized in the camera shows less than the sensor sees.
const SIGMA_LN_FOCAL: f64 = 0.05;

/// Adds to the motion of a clip, as `options` request: the readout time of its sensor, and its cameras in space where none are
/// known. `focal_px`: the focal length by the metadata of the clip.
///
/// # Errors
/// [`StabilizeError::Store`]: tracks cannot be read; [`StabilizeError::Interrupted`].
pub fn complete_motion(
    motion: &mut ClipMotion,
    tracks: &Tracks,
    options: &CameraMotionOptions,
    focal_px: Option<f64>,
    run: &Run,
) -> Result<(), StabilizeError> {
    match options.rolling_shutter {
        RollingShutter::Auto => {}
        RollingShutter::Off => motion.readout_s = None,
        RollingShutter::Readout(seconds) => motion.readout_s = Some(seconds),
    }
    if options.cameras && motion.cameras.is_none() {
        let rolling_shutter = options.rolling_shutter != RollingShutter::Off;
        motion.cameras = Some(recover_cameras(tracks, motion, rolling_shutter, focal_px, run)?);
    }
    Ok(())
}

/// Structure from motion, shot by shot; `rolling_shutter`: with the readout time, where the shot shows one.
fn recover_cameras(
    tracks: &Tracks,
    motion: &ClipMotion,
    rolling_shutter: bool,
    focal_px: Option<f64>,
    run: &Run,
) -> Result<ClipCameras, StabilizeError> {
    let mut cameras = ClipCameras::default();
    let options = SfmOptions { focal: focal_px.map(|f| (f, SIGMA_LN_FOCAL)), rolling_shutter };
    let table = |frames: Range<usize>| {
        run.check()?;
        let read = |frame: usize| points_of(&tracks.store, frames.start + frame);
        TrackTable::read(motion.width, motion.height, frames.len(), read)
    };
    let fraction = |frame: usize| frame as f64 / motion.frames.len().max(1) as f64;
    for shot in &motion.shots {
        let part = run.part(fraction(shot.start), fraction(shot.end));
        for segment in reconstruct_shot(shot.clone(), table, &options, &Windows::default(), &part)? {
            cameras.push(segment);
        }
    }
    Ok(cameras)
}

fn points_of(store: &TrackStore, frame: usize) -> Result<Vec<(u32, Point2)>, StabilizeError> {
    let seen = store.read(frame)?.observations;
    Ok(seen.into_iter().map(|o| (o.id, Point2::new(f64::from(o.x), f64::from(o.y)))).collect())
}
