//! Deformation of surfaces: a few vertices are held, the rest follows as the method says.
//!
//! ```text
//! x = argmin E(x; p)      s.t.  x_h = t_h  for the handles h        p the surface at rest
//! ```
//!
//! A [`Deformer`] is a [`Method`] prefactored for a mesh and a set of [`Handles`]; it takes one [`HandlePose`] after the
//! other. Every method tells in its [`DeformReport`] what it did to the surface.

mod arap;
mod bound;
mod deformer;
mod detail_preserving;
mod error;
pub mod handle_file;
mod handles;
mod held;
mod held_laplacian;
pub mod hierarchy;
mod lanes;
mod laplacian_editing;
pub mod modal;
mod multiresolution;
mod poisson;
mod primo;
mod report;
mod rotation_fit;
mod similarity;
mod spread;
#[cfg(test)]
mod test_meshes;
#[cfg(test)]
mod tests;

pub use crate::mesh::operators::CotangentRule;
pub use deformer::{DeformOptions, Deformation, Deformer, Method, Solver, Start, deform};
pub use detail_preserving::{DetailPreserving, LaplacianKind};
pub use error::SurfaceError;
pub use handles::{HandlePose, Handles, Hold};
pub use held::{Part, Unheld};
pub use hierarchy::{Hierarchy, LevelPose};
pub use laplacian_editing::Turning;
pub use modal::{Modes, ModesOptions, PartCount, Parts, PartsOptions, modal_start, modes, parts};
pub use plumbline_num::energy::Convergence;
pub use primo::{Fabric, PrimoOptions};
pub use report::{DeformReport, Gauge, ShapeChange, Stop};
