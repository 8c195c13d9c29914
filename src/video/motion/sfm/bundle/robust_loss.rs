//! Robust loss of a residual.

use super::cameras::Cameras;
use super::layout::TrackObservation;
use super::residual::Anchored;
use plumbline_num::energy::Loss;

/// Loss function and noise scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct RobustLoss {
    /// Standard deviation of an observation, px.
    pub(super) sigma: f64,
    pub(super) loss: Loss,
}

/// Residual, in standard deviations, assigned to a point behind a camera: larger than any within the image, and
/// constant, so that it has no gradient.
const BEHIND: f64 = 1e3;

impl RobustLoss {
    /// `½ ρ(‖r‖²)` of a squared residual in units of `σ²`; `None` for a point behind the camera.
    pub(super) fn cost(&self, squared: Option<f64>) -> f64 {
        0.5 * self.loss.value(squared.unwrap_or(BEHIND * BEHIND))
    }

    /// Sum over the observations of one point.
    pub(super) fn cost_of(&self, cameras: &Cameras, point: &Anchored, observations: &[TrackObservation]) -> f64 {
        observations.iter().map(|s| self.cost(self.squared(cameras, point, s))).sum()
    }

    pub(super) fn squared(&self, cameras: &Cameras, point: &Anchored, observation: &TrackObservation) -> Option<f64> {
        let residual = cameras.eye(observation.frame).residual(point, observation.pixel, self.sigma)?;
        Some(residual.norm_squared())
    }
}
