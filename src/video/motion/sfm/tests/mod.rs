//! Synthetic data with ground truth, for the tests of structure from motion. `tests/it` and `benches` include the same shots.

pub(super) mod synthetic;
pub(super) mod synthetic_views;

use super::{Observation, Scene, ScenePoint, TrackTable};
