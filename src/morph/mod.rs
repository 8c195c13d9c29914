//! Shapes between shapes, and shapes made of several.
//!
//! * [`Trajectory`]: all shapes between two poses of one mesh, or a shape in which every place has a time of its own;
//! * [`intersections`]: where a surface passes through itself.

mod bvh;
pub mod composition;
pub mod correspondence;
mod elastic_solve;
mod error;
pub mod intersections;
mod rigid;
mod time_field;
mod trajectory;

pub use bvh::{Bvh, Nearest};
pub use error::MorphError;
pub use time_field::time_field;
pub use trajectory::{Trajectory, TrajectoryOptions};
