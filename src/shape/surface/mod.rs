//! Surface deformation: a few vertices are constrained, the others minimize an energy.
//!
//! ```text
//! x = argmin E(x; p)      s.t.  x_h = t_h  for the handles h        p the rest positions
//! ```
//!
//! A [`Deformer`] is a [`Method`] prefactored for a mesh and a set of [`Handles`]; it takes one [`HandlePose`] after the
//! other. The [`DeformReport`] has the convergence and the distortion of the surface.

mod arap;
mod bound;
mod components;
mod deformer;
mod detail_preserving;
mod error;
pub mod handle_file;
mod handle_laplacian;
mod handles;
pub mod hierarchy;
mod keyframed;
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
mod suitability;
#[cfg(test)]
mod test_meshes;
#[cfg(test)]
mod tests;

pub use crate::mesh::operators::CotangentRule;
pub use arap::CellEnergies;
pub use components::{Component, Unconstrained};
pub use deformer::{DeformOptions, Deformation, Deformer, InitialGuess, Method, Solver, deform};
pub use detail_preserving::{DetailPreserving, LaplacianKind};
pub use error::SurfaceError;
pub use handles::{Constraint, HandlePose, Handles};
pub use hierarchy::{Hierarchy, LevelPose};
pub use keyframed::{KeyframedDeformer, KeyframedOptions, SolvableMesh};
pub use laplacian_editing::RotationEstimation;
pub use modal::{Modes, ModesOptions, PartCount, Parts, PartsOptions, modes, parts};
pub use plumbline_num::energy::Convergence;
pub use primo::{PrimoOptions, ShellMaterial};
pub use report::{DeformReport, Distortion, DistortionMetrics, Stop};
pub use suitability::Unsuitable;
