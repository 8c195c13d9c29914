//! Rotational regression: skinning that learns from example poses how triangles turn and stretch with the joints.
//!
//! ```text
//! D = R S                      deformation gradient of a triangle in an example: rotation, then stretch
//! log(R_bᵀ R) = A q_j + a      the turn that remains beside that of the triangle's own joint b
//! S           = C q_j + c      q_j = log of the rotation between joint j and its parent
//! ```
//!
//! Per triangle the joint `j` (its own, its parent, a child) that explains the examples best is taken, and `A, a, C, c` follow by
//! ridge regression. In a new pose the gradients `D_t = R_b exp(A q + a) (C q + c)` are joined to a surface by
//!
//! ```text
//! x = argmin Σ_t area_t |∇x − D_t|²        one factor of the Laplacian for all poses
//! ```
//!
//! whose pieces are then set where linear blending has their middle. [`Reduced`] replaces the regressors and the solve by few
//! prototypes.
//!
//! # Reference
//! R. Y. Wang, K. Pulli, J. Popović, *Real-time enveloping with rotational regression*, ACM TOG 26 (2007). Departures: a full
//! 3 × 3 matrix and an offset in place of a scaled rotation; only rotations between neighboring joints, so that results go rigidly
//! with the character; prototypes are chosen greedily among the triangles of a joint.

mod gradients;
mod joint_fit;
mod reduced;
mod surface_of_gradients;
#[cfg(test)]
mod tests;
mod training;

use nalgebra::{Matrix3, Matrix4, Point3, UnitQuaternion, Vector3};

pub use joint_fit::{fit_joints, fit_weights};
pub use reduced::Reduced;
pub use training::TrainingReport;

use super::skinning::{Skinner, SkinningMethod};
use super::{CharacterError, Skeleton, Skin};
use crate::mesh::TriMesh;
use surface_of_gradients::SurfaceOfGradients;
use training::Regressor;

/// A pose that the surface is known in.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// How space moves with each joint.
    pub matrices: Vec<Matrix4<f64>>,
    /// Where the vertices are.
    pub positions: Vec<Point3<f64>>,
}

/// How a model is trained.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionOptions {
    /// Ridge on the slopes, rad², above 0: larger trusts the examples less. The offsets are free.
    pub ridge: f64,
}

impl Default for RegressionOptions {
    fn default() -> Self {
        // A joint that turned by 2° in all examples together is hardly believed, one that turned by 20° is.
        Self { ridge: 1e-2 }
    }
}

/// A trained model.
#[derive(Clone, Debug)]
pub struct RegressionModel {
    regressors: Vec<Regressor>,
    surface: SurfaceOfGradients,
    /// Linear blending, which says where pieces are.
    linear: Skinner,
    parents: Vec<Option<u32>>,
}

/// What regressors see of a pose.
#[derive(Clone, Debug)]
struct JointTurns {
    /// Rotation of each joint from rest, world.
    global: Vec<UnitQuaternion<f64>>,
    /// Rotation vector of each joint from its parent's turn, rad; zero for roots.
    relative: Vec<Vector3<f64>>,
}

impl JointTurns {
    fn new(matrices: &[Matrix4<f64>], parents: &[Option<u32>]) -> Self {
        let global: Vec<_> =
            matrices.iter().map(|m| gradients::polar(&m.fixed_view::<3, 3>(0, 0).into_owned()).0).collect();
        let relative = |(turn, parent): (&UnitQuaternion<f64>, &Option<u32>)| {
            parent.map_or_else(Vector3::zeros, |p| (global[p as usize].inverse() * turn).scaled_axis())
        };
        Self { relative: global.iter().zip(parents).map(relative).collect(), global }
    }
}

impl RegressionModel {
    /// Learns from examples. The skin says which joint each triangle belongs to, and where pieces are.
    ///
    /// # Errors
    /// [`CharacterError::NoExamples`]; [`CharacterError::PerVertex`], [`CharacterError::Matrices`] for examples of other meshes or
    /// skeletons; [`CharacterError::Option`]; [`CharacterError::Solve`].
    pub fn train(
        mesh: &TriMesh,
        skeleton: &Skeleton,
        skin: &Skin,
        examples: &[Example],
        options: &RegressionOptions,
    ) -> Result<(Self, TrainingReport), CharacterError> {
        if !(options.ridge > 0.0 && options.ridge.is_finite()) {
            return Err(CharacterError::Option { name: "ridge", value: options.ridge, range: "above 0, finite" });
        }
        check(mesh, skeleton, examples)?;
        let linear = Skinner::new(mesh, None, skeleton, skin, SkinningMethod::LinearBlend)?;
        let parents: Vec<_> = skeleton.joints().iter().map(|j| j.parent).collect();
        let regressors = training::regressors(mesh, skeleton, skin.weights(), examples, options.ridge);
        let mut model = Self { regressors, surface: SurfaceOfGradients::new(mesh)?, linear, parents };
        let report = training::report(&mut model, mesh, examples)?;
        Ok((model, report))
    }

    /// The surface in a pose.
    ///
    /// # Errors
    /// As [`Skinner::positions`].
    pub fn positions(&mut self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let places = self.linear.positions(matrices)?;
        let turns = JointTurns::new(matrices, &self.parents);
        let gradients: Vec<Matrix3<f64>> = self.regressors.iter().map(|r| r.gradient(&turns)).collect();
        Ok(self.surface.solve(&gradients, &places))
    }
}

fn check(mesh: &TriMesh, skeleton: &Skeleton, examples: &[Example]) -> Result<(), CharacterError> {
    if examples.is_empty() {
        return Err(CharacterError::NoExamples);
    }
    for example in examples {
        let (given, vertices) = (example.positions.len(), mesh.vertex_count());
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "positions of an example", given, vertices });
        }
        let (joints, matrices) = (skeleton.joint_count(), example.matrices.len());
        if joints != matrices {
            return Err(CharacterError::Matrices { joints, matrices });
        }
        super::skin::check_affine(&example.matrices)?;
    }
    Ok(())
}
