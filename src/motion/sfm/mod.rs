//! Structure from motion: the cameras of a clip and the points they saw, from tracks alone.

mod scene;

pub use scene::{Observation, Scene, ScenePoint};
