//! Shape interpolation, correspondence and composition.
//!
//! * [`Trajectory`]: interpolation between two poses of one mesh, with one time for all vertices or one per vertex;
//! * [`time_field`] and [`paint`]: times per vertex from painted strokes;
//! * [`correspondence`]: maps between two meshes, so that both become poses of one mesh;
//! * [`composition`]: one surface from parts of two;
//! * [`intersections`]: self-intersections of a surface.

mod bvh;
pub mod composition;
pub mod correspondence;
mod elastic_solve;
mod error;
mod folds;
pub mod intersections;
pub mod paint;
mod rigid;
mod time_field;
mod trajectory;

pub use bvh::{Bvh, SurfacePoint};
pub use error::MorphError;
pub use time_field::time_field;
pub use trajectory::{Trajectory, TrajectoryOptions, Untangled, interpolate, same_connectivity};
