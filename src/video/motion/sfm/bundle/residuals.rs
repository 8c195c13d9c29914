//! Reprojection residuals of a scene, row motion included.

use super::structure::fixed_cameras;
use crate::motion::sfm::{Observation, Scene};

/// The length of a residual.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObservationResidual {
    /// Index of the frame.
    pub frame: u32,
    /// Index of the point.
    pub point: u32,
    /// Observed position, px.
    pub pixel: plumbline_num::math::Point2,
    /// Length, px; infinite for a point behind the camera.
    pub px: f64,
}

/// Residuals of the observations of known points by known frames, for points observed in at least two frames, ordered
/// by point. Empty for a scene that is not finite.
pub fn residuals(scene: &Scene, observations: &[Observation]) -> Vec<ObservationResidual> {
    let Ok((layout, parameters, cameras)) = fixed_cameras(scene, observations) else { return Vec::new() };
    let mut found = Vec::with_capacity(layout.observations.len());
    for (track, ray) in layout.tracks.iter().zip(&parameters.points) {
        let point = cameras.anchored(ray, track.anchor);
        found.extend(layout.observations[track.observations.clone()].iter().map(|observation| {
            let residual = cameras.eye(observation.frame).residual(&point, observation.pixel, 1.0);
            let px = residual.map_or(f64::INFINITY, |r| r.norm());
            ObservationResidual {
                frame: observation.frame as u32,
                point: track.point as u32,
                pixel: observation.pixel,
                px,
            }
        }));
    }
    found
}
