//! Deformations of surfaces.

pub mod hierarchy;
pub mod primo;

pub use hierarchy::{Hierarchy, LevelPose};
