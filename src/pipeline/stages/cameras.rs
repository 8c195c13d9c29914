//! Cameras in space, for a `video.motion` that asks for them: structure from motion, shot by shot, on the tracks of the clip.

use super::analysis::{Tracks, store_error};
use crate::math::Point2;
use crate::motion::sfm::{SfmOptions, TrackTable, reconstruct};
use crate::motion::{ClipCameras, ClipMotion};
use crate::pipeline::run_error::RunError;
use crate::track::TrackStore;

/// Longest shot, frames, that is solved: all of its sightings are held at once, 40 MB or so at this length.
const LONGEST_SHOT: usize = 1200;

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
    for shot in &motion.shots {
        if shot.len() > LONGEST_SHOT {
            let (found, most) = (shot.len(), LONGEST_SHOT);
            let reason = format!("a shot of {found} frames is too long for cameras in space (at most {most})");
            cameras.push_unknown(shot.clone(), reason);
            continue;
        }
        let frames = shot.clone().map(|f| points_of(&tracks.store, f)).collect::<Result<Vec<_>, _>>()?;
        let table = TrackTable::new(motion.width, motion.height, frames);
        let found = reconstruct(&table, &options);
        cameras.push(shot.clone(), &table, found);
    }
    Ok(cameras)
}

fn points_of(store: &TrackStore, frame: usize) -> Result<Vec<(u32, Point2)>, RunError> {
    let seen = store.read(frame).map_err(store_error)?.observations;
    Ok(seen.into_iter().map(|o| (o.id, Point2::new(f64::from(o.x), f64::from(o.y)))).collect())
}
