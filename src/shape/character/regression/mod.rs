//! Rotational regression: skinning that learns from example poses how triangles rotate and stretch with the joints.
//!
//! ```text
//! D = R S                      deformation gradient of a triangle in an example: rotation, then stretch
//! log(R_bᵀ R) = A q_j + a      rotation relative to the triangle's own joint b
//! S           = C q_j + c      q_j = log of the rotation between joint j and its parent
//! ```
//!
//! For each triangle the joint `j` (its own, its parent or a child) that explains the examples best is selected, and `A, a, C, c` follow from
//! ridge regression. In a new pose the gradients `D_t = R_b exp(A q + a) (C q + c)` are integrated to a surface by
//!
//! ```text
//! x = argmin Σ_t area_t |∇x − D_t|² + μ Σ_i s_i |x_i − y_i|²        one factorization for all poses
//! ```
//!
//! where `y` is the linear blend with the weights that fit the examples best. Gradients capture bends and folds but accumulate errors along
//! limbs; blended positions locate the limbs. Their relative weight `μ` ([`RegressionOptions::hold`]) and the ridge are chosen by
//! cross-validation ([`tuned`]). [`Reduced`] replaces the regressors and the solve by a few shapes.
//!
//! # Reference
//! R. Y. Wang, K. Pulli, J. Popović, *Real-time enveloping with rotational regression*, ACM TOG 26 (2007). Departures: a full
//! 3 × 3 matrix and an offset instead of a scaled rotation; only rotations between neighboring joints, so that results are equivariant under
//! rigid motion; blended positions for all vertices instead of a few fixed near-rigid ones; the reduced form uses principal shapes of the
//! triangles of a joint, with key triangles as predictors, instead of sums of key triangles.

mod gradients;
mod joint_fit;
mod model_file;
mod reduced;
mod surface_of_gradients;
#[cfg(test)]
mod tests;
mod training;
mod tuning;

use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};

pub use joint_fit::{fit_joints, fit_weights};
pub use model_file::{SkinModel, TrainedSkin};
pub use reduced::{Coordinates, Reduced};
pub use training::TrainingReport;
pub use tuning::tuned;

use super::{CharacterError, Skeleton, SkinWeights};
use crate::mesh::TriMesh;
use plumbline_num::run::Run;
use surface_of_gradients::SurfaceOfGradients;
use training::Regressor;

use plumbline_num::math::polar;
use plumbline_num::options::OptionError;

/// A training pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Example {
    /// Skin matrices of the joints.
    pub matrices: Vec<Matrix4<f64>>,
    /// Vertex positions.
    pub positions: Vec<Point3<f64>>,
}

/// Options of the training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegressionOptions {
    /// Ridge on the slopes, rad², above 0. Larger values trust the examples less; offsets are not penalized. Default 1e-2.
    pub ridge: f64,
    /// `μ`: weight of blended positions relative to gradients, above 0, dimensionless. Features longer than `√(area / μ)` follow the
    /// positions. Default 1e3.
    pub hold: f64,
}

impl Default for RegressionOptions {
    fn default() -> Self {
        // 1e-2: a joint with a total rotation of 2° in all examples is mostly ignored, one with 20° is mostly trusted. 1e3: positions rule down
        // to a thirtieth of the character's width. Both are the values that cross-validation selects most often.
        Self { ridge: 1e-2, hold: 1e3 }
    }
}

/// A trained model.
#[derive(Clone, Debug)]
pub struct RegressionModel {
    regressors: Vec<Regressor>,
    surface: SurfaceOfGradients,
    blend: BlendedPositions,
    parents: Vec<Option<u32>>,
    hold: f64,
}

/// Linear blend skinning, which gives the approximate positions.
#[derive(Clone, Debug)]
struct BlendedPositions {
    rest: Vec<Point3<f64>>,
    weights: SkinWeights,
}

impl BlendedPositions {
    fn at(&self, vertex: usize, matrices: &[Matrix4<f64>]) -> Point3<f64> {
        let p = &self.rest[vertex];
        let part = |i: &super::Influence| matrices[i.joint as usize].transform_point(p).coords * i.weight;
        self.weights.row(vertex).iter().map(part).sum::<Vector3<f64>>().into()
    }

    fn all(&self, matrices: &[Matrix4<f64>]) -> Vec<Point3<f64>> {
        (0..self.rest.len()).map(|v| self.at(v, matrices)).collect()
    }
}

/// Features of a pose for the regressors.
#[derive(Clone, Debug)]
struct JointRotations {
    /// World rotation of each joint from rest.
    global: Vec<UnitQuaternion<f64>>,
    /// Rotation vector of each joint relative to its parent, rad; zero for roots.
    relative: Vec<Vector3<f64>>,
}

impl JointRotations {
    fn new(matrices: &[Matrix4<f64>], parents: &[Option<u32>]) -> Self {
        let global: Vec<_> = matrices.iter().map(|m| polar(&m.fixed_view::<3, 3>(0, 0).into_owned()).0).collect();
        let relative = |(rotation, parent): (&UnitQuaternion<f64>, &Option<u32>)| {
            parent.map_or_else(Vector3::zeros, |p| (global[p as usize].inverse() * rotation).scaled_axis())
        };
        Self { relative: global.iter().zip(parents).map(relative).collect(), global }
    }
}

impl RegressionModel {
    /// Trains a model. `weights` assign triangles to joints.
    ///
    /// # Errors
    /// [`CharacterError::Input`] without examples or for examples of another skeleton; [`CharacterError::PerVertex`] for those of another
    /// mesh; [`CharacterError::Option`]; [`CharacterError::Solve`]; [`CharacterError::Interrupted`].
    pub fn train(
        mesh: &TriMesh,
        skeleton: &Skeleton,
        weights: &SkinWeights,
        examples: &[Example],
        options: &RegressionOptions,
        run: &Run,
    ) -> Result<(Self, TrainingReport), CharacterError> {
        OptionError::check_positive([("ridge", options.ridge), ("hold", options.hold)])?;
        check(mesh, skeleton, weights, examples)?;
        let parents = parents_of(skeleton);
        let regressors = training::regressors(mesh, skeleton, weights, examples, options.ridge, run)?;
        let blend =
            BlendedPositions { rest: mesh.positions().to_vec(), weights: fit_weights(mesh, weights, examples, run)? };
        run.step(0.5)?;
        let surface = SurfaceOfGradients::new(mesh, options.hold, run)?;
        let mut model = Self { regressors, surface, blend, parents, hold: options.hold };
        let report = training::report(&mut model, mesh, examples, run)?;
        Ok((model, report))
    }

    /// Replaces the rest surface, as morph targets do; the learned rotations and stretches apply to its triangles.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another number of vertices.
    pub fn set_rest(&mut self, rest: &[Point3<f64>]) -> Result<(), CharacterError> {
        self.surface.set_rest(rest)?;
        self.blend.rest.copy_from_slice(rest);
        Ok(())
    }

    /// The surface in a pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or an invalid matrix.
    pub fn positions(&mut self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        check_pose(&self.parents, matrices)?;
        let rotations = JointRotations::new(matrices, &self.parents);
        let (regressors, blend) = (&self.regressors, &self.blend);
        Ok(self.surface.solve(|t| regressors[t].gradient(&rotations), |v| blend.at(v, matrices).coords))
    }

    /// Linear blend with the weights that fit the examples best.
    ///
    /// # Errors
    /// As [`Self::positions`].
    pub fn linear_positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        check_pose(&self.parents, matrices)?;
        Ok(self.blend.all(matrices))
    }
}

fn parents_of(skeleton: &Skeleton) -> Vec<Option<u32>> {
    skeleton.joints().iter().map(|j| j.parent).collect()
}

fn check_pose(parents: &[Option<u32>], matrices: &[Matrix4<f64>]) -> Result<(), CharacterError> {
    CharacterError::check_matrices(parents.len(), matrices.len())?;
    super::skin::check_affine(matrices)
}

fn check(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    weights: &SkinWeights,
    examples: &[Example],
) -> Result<(), CharacterError> {
    CharacterError::check_matrices(weights.joint_count(), skeleton.joint_count())?;
    check_examples(mesh, weights, examples)?;
    examples.iter().try_for_each(|example| super::skin::check_affine(&example.matrices))
}

/// Rejects examples or weights of another mesh, and examples of other joints than the weights.
fn check_examples(mesh: &TriMesh, weights: &SkinWeights, examples: &[Example]) -> Result<(), CharacterError> {
    let vertices = mesh.vertex_count();
    CharacterError::check_per_vertex("rows of weights", weights.vertex_count(), vertices)?;
    if examples.is_empty() {
        return Err(CharacterError::Input("there is no example pose; give one at least".to_owned()));
    }
    for example in examples {
        CharacterError::check_per_vertex("positions of an example", example.positions.len(), vertices)?;
        CharacterError::check_matrices(weights.joint_count(), example.matrices.len())?;
    }
    Ok(())
}
