//! Deformations of surfaces.

pub mod hierarchy;

pub use hierarchy::{Hierarchy, LevelPose};
