//! What a residual costs.

use super::cameras::Cameras;
use super::layout::TrackObservation;
use super::residual::Anchored;
use plumbline_num::energy::Loss;

/// How residuals are judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct RobustLoss {
    /// Standard deviation of an observation, px.
    pub(super) sigma: f64,
    pub(super) loss: Loss,
}

/// Residual, in units of its standard deviation, that counts for a point behind a camera: worse than any in the picture, and
/// without slope.
const BEHIND: f64 = 1e3;

impl RobustLoss {
    /// `½ ρ(‖r‖²)` of a squared residual in units of `σ²`; `None` for a point behind.
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
