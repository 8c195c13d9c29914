//! The virtual camera.

mod trajectory;

pub use trajectory::{Anchor, TrajectoryOptions, TrajectorySmoother};
