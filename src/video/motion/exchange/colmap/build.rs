//! The models of a clip: one per shot whose cameras are known.

use std::collections::HashMap;

use super::{Camera, Image, ImageObservation, Model, Point};
use crate::motion::sfm::SfmVerdict;
use crate::motion::{ClipCameras, ClipMotion};
use crate::track::{StoreError, TrackStore};
use plumbline_camera::{Intrinsics, Point3};
use plumbline_num::math::Point2;

/// Greatest reprojection error of an observation, px at 640 px across, as in the stabilizer: beyond, it is an outlier of its track.
const MAX_ERROR_PX: f64 = 3.0;

/// The models of a clip with their shots; shots without cameras, or whose cameras failed, have none. `tracks`: the clip's, frame by
/// frame.
///
/// # Errors
/// Those of [`TrackStore::read`].
pub fn models_of(motion: &ClipMotion, tracks: &TrackStore) -> Result<Vec<(usize, Model)>, StoreError> {
    let Some(cameras) = &motion.cameras else { return Ok(Vec::new()) };
    let mut models = Vec::new();
    for shot in (0..cameras.shots.len()).filter(|s| cameras.shots[*s].verdict != SfmVerdict::Failed) {
        let model = Builder::new(motion, cameras, shot).build(tracks)?;
        if !model.images.is_empty() {
            models.push((shot, model));
        }
    }
    Ok(models)
}

/// A model being built.
struct Builder<'a> {
    motion: &'a ClipMotion,
    cameras: &'a ClipCameras,
    shot: usize,
    max_error_px: f64,
    model: Model,
    /// By track: index into the model's points, and the sum of its reprojection errors.
    points: HashMap<u32, (usize, f64)>,
}

impl<'a> Builder<'a> {
    fn new(motion: &'a ClipMotion, cameras: &'a ClipCameras, shot: usize) -> Self {
        let mut model = Model::default();
        let mut points = HashMap::new();
        for found in cameras.points.iter().filter(|p| p.shot as usize == shot) {
            points.insert(found.id, (model.points.len(), 0.0));
            model.points.push(Point {
                id: u64::from(found.id),
                position: found.position,
                error_px: -1.0,
                track: Vec::new(),
            });
        }
        let max_error_px = MAX_ERROR_PX * f64::from(motion.width.max(motion.height)) / 640.0;
        Self { motion, cameras, shot, max_error_px, model, points }
    }

    fn build(mut self, tracks: &TrackStore) -> Result<Model, StoreError> {
        for frame in self.cameras.shots[self.shot].frames.clone() {
            let Some(camera) = self.cameras.frames.get(frame).copied().flatten() else { continue };
            let id = frame as u32 + 1;
            let mut observations = Vec::new();
            for seen in tracks.read(frame)?.observations {
                let at = Point2::new(f64::from(seen.x), f64::from(seen.y));
                let Some((index, total)) = self.points.get_mut(&seen.id) else { continue };
                let point = &mut self.model.points[*index];
                let Some(error) = distance(&camera.intrinsics, &camera.pose.apply(&point.position), at) else {
                    continue;
                };
                if error <= self.max_error_px {
                    *total += error;
                    point.track.push((id, observations.len() as u32));
                    observations.push(ImageObservation { at, point: Some(point.id) });
                }
            }
            let lens = self.lens(camera.intrinsics);
            let name = format!("frame_{frame:06}.png");
            self.model.images.push(Image { id, camera: lens, name, pose: camera.pose, observations });
        }
        for (index, total) in self.points.values() {
            let point = &mut self.model.points[*index];
            point.error_px = if point.track.is_empty() { -1.0 } else { total / point.track.len() as f64 };
        }
        self.model.points.retain(|p| !p.track.is_empty());
        Ok(self.model)
    }

    /// The id of the camera with this lens, which is added where it is new.
    fn lens(&mut self, intrinsics: Intrinsics) -> u32 {
        if let Some(known) = self.model.cameras.iter().find(|c| c.intrinsics == intrinsics) {
            return known.id;
        }
        let id = self.model.cameras.len() as u32 + 1;
        let (width, height) = (u64::from(self.motion.width), u64::from(self.motion.height));
        self.model.cameras.push(Camera { id, width, height, intrinsics });
        id
    }
}

/// Reprojection error, px, of an observation `at`; `None` behind the camera.
fn distance(lens: &Intrinsics, x_in_camera: &Point3, at: Point2) -> Option<f64> {
    Some((lens.project(x_in_camera)? - at).norm())
}
