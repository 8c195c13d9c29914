//! Cameras in space, for a `video.motion` that asks for them: structure from motion, shot by shot, on the tracks of the clip.

use std::ops::Range;

use super::analysis::{Tracks, store_error};
use crate::pipeline::run_error::RunError;
use plumbline_num::math::Point2;
use plumbline_num::run::Run;
use plumbline_video::motion::sfm::{SfmOptions, TrackTable, Windows, reconstruct_shot};
use plumbline_video::motion::{ClipCameras, ClipMotion};
use plumbline_video::track::TrackStore;

/// Deviation of the logarithm of the focal length that a container tells: its whole millimeters are 4 % apart for a phone, and a
/// clip steadied in the camera shows less than the sensor sees.
const SIGMA_TOLD: f64 = 0.05;

/// Recovers the cameras of every shot; `rolling_shutter`: with the readout time, where the shot shows one; `focal_px`: the focal
/// length that the container tells.
pub(super) fn recover(
    tracks: &Tracks,
    motion: &ClipMotion,
    rolling_shutter: bool,
    focal_px: Option<f64>,
) -> Result<ClipCameras, RunError> {
    let mut cameras = ClipCameras::default();
    let options = SfmOptions { focal: focal_px.map(|f| (f, SIGMA_TOLD)), rolling_shutter };
    let table = |frames: Range<usize>| -> Result<TrackTable, RunError> {
        let seen = frames.map(|f| points_of(&tracks.store, f)).collect::<Result<Vec<_>, RunError>>()?;
        Ok(TrackTable::new(motion.width, motion.height, seen))
    };
    for shot in &motion.shots {
        let segments = reconstruct_shot(shot.clone(), table, &options, &Windows::default(), &Run::default())?;
        for segment in segments {
            cameras.push(segment);
        }
    }
    Ok(cameras)
}

fn points_of(store: &TrackStore, frame: usize) -> Result<Vec<(u32, Point2)>, RunError> {
    let seen = store.read(frame).map_err(store_error)?.observations;
    Ok(seen.into_iter().map(|o| (o.id, Point2::new(f64::from(o.x), f64::from(o.y)))).collect())
}
