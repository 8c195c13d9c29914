//! Shapes between shapes, and shapes made of several.
//!
//! * [`Trajectory`]: all shapes between two poses of one mesh, or a shape in which every place has a time of its own;
//! * [`time_field`] and [`paint`]: such times, from a few that are painted;
//! * [`correspondence`]: one mesh laid over another, so that both become poses of one;
//! * [`composition`]: one surface made of parts of two;
//! * [`intersections`]: where a surface passes through itself.

mod bvh;
pub mod composition;
pub mod correspondence;
mod elastic_solve;
mod error;
pub mod intersections;
pub mod paint;
mod rigid;
mod time_field;
mod trajectory;

pub use bvh::{Bvh, Nearest};
pub use error::MorphError;
pub use time_field::time_field;
pub use trajectory::{Trajectory, TrajectoryOptions, interpolate, same_connectivity};
