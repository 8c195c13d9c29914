//! Structure from motion: the cameras of a clip and the points they saw, from tracks alone.

pub mod bundle;
mod scene;
pub mod synthetic;

pub use scene::{Observation, Scene, ScenePoint};
