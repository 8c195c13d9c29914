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
//! x = argmin Σ_t area_t |∇x − D_t|² + μ Σ_i s_i |x_i − y_i|²        one factor for all poses
//! ```
//!
//! where `y` is the linear blend by the weights that fit the examples best. Gradients know bends and folds, and add up small
//! errors along a limb; blended places know where the limb is. `μ` ([`RegressionOptions::hold`]) says how far each is believed,
//! and [`tuned`] finds it, and the ridge, by leaving examples out. [`Reduced`] replaces the regressors and the solve by few
//! shapes.
//!
//! # Reference
//! R. Y. Wang, K. Pulli, J. Popović, *Real-time enveloping with rotational regression*, ACM TOG 26 (2007). Departures: a full
//! 3 × 3 matrix and an offset in place of a scaled rotation; only rotations between neighboring joints, so that results go rigidly
//! with the character; blended places for all vertices in place of a few near-rigid ones that are fixed; the reduced form has the
//! principal shapes of the triangles of a joint, which chosen triangles only steer, in place of sums of chosen triangles.

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
pub use model_file::{ModelFileError, SkinModel, TrainedSkin};
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
    /// How much blended places are believed beside gradients, above 0, dimensionless: what is longer than `√(area / hold)` is where
    /// they are.
    pub hold: f64,
}

impl Default for RegressionOptions {
    fn default() -> Self {
        // A joint that turned by 2° in all examples together is hardly believed, one that turned by 20° is. Places say where limbs
        // are, a thirtieth of the character wide; below it gradients say what the surface does. Both are what is found most.
        Self { ridge: 1e-2, hold: 1e3 }
    }
}

/// A trained model.
#[derive(Clone, Debug)]
pub struct RegressionModel {
    regressors: Vec<Regressor>,
    surface: SurfaceOfGradients,
    places: Places,
    parents: Vec<Option<u32>>,
    hold: f64,
}

/// Linear blending, which says about where vertices are.
#[derive(Clone, Debug)]
struct Places {
    rest: Vec<Point3<f64>>,
    weights: SkinWeights,
}

impl Places {
    fn at(&self, vertex: usize, matrices: &[Matrix4<f64>]) -> Point3<f64> {
        let p = &self.rest[vertex];
        let part = |i: &super::Influence| matrices[i.joint as usize].transform_point(p).coords * i.weight;
        self.weights.row(vertex).iter().map(part).sum::<Vector3<f64>>().into()
    }

    fn all(&self, matrices: &[Matrix4<f64>]) -> Vec<Point3<f64>> {
        (0..self.rest.len()).map(|v| self.at(v, matrices)).collect()
    }
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
        let global: Vec<_> = matrices.iter().map(|m| polar(&m.fixed_view::<3, 3>(0, 0).into_owned()).0).collect();
        let relative = |(turn, parent): (&UnitQuaternion<f64>, &Option<u32>)| {
            parent.map_or_else(Vector3::zeros, |p| (global[p as usize].inverse() * turn).scaled_axis())
        };
        Self { relative: global.iter().zip(parents).map(relative).collect(), global }
    }
}

impl RegressionModel {
    /// Learns from examples. `weights` say which joint each triangle belongs to.
    ///
    /// # Errors
    /// [`CharacterError::NoExamples`]; [`CharacterError::PerVertex`], [`CharacterError::Matrices`] for examples or weights of other
    /// meshes or skeletons; [`CharacterError::Option`]; [`CharacterError::Solve`]; [`CharacterError::Interrupted`].
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
        let places = Places { rest: mesh.positions().to_vec(), weights: fit_weights(mesh, weights, examples, run)? };
        run.step(0.5)?;
        let surface = SurfaceOfGradients::new(mesh, options.hold, run)?;
        let mut model = Self { regressors, surface, places, parents, hold: options.hold };
        let report = training::report(&mut model, mesh, examples, run)?;
        Ok((model, report))
    }

    /// Moves the surface at rest, as morph targets do: its triangles turn and stretch as they have learnt, from where they are now.
    ///
    /// # Errors
    /// [`CharacterError::PerVertex`] for another number of vertices.
    pub fn set_rest(&mut self, rest: &[Point3<f64>]) -> Result<(), CharacterError> {
        self.surface.set_rest(rest)?;
        self.places.rest.copy_from_slice(rest);
        Ok(())
    }

    /// The surface in a pose.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for another number of joints, [`CharacterError::Matrix`].
    pub fn positions(&mut self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        check_pose(&self.parents, matrices)?;
        let turns = JointTurns::new(matrices, &self.parents);
        let (regressors, places) = (&self.regressors, &self.places);
        Ok(self.surface.solve(|t| regressors[t].gradient(&turns), |v| places.at(v, matrices).coords))
    }

    /// The linear blend by the weights that fit the examples best, in a pose.
    ///
    /// # Errors
    /// As [`Self::positions`].
    pub fn linear_positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        check_pose(&self.parents, matrices)?;
        Ok(self.places.all(matrices))
    }
}

fn parents_of(skeleton: &Skeleton) -> Vec<Option<u32>> {
    skeleton.joints().iter().map(|j| j.parent).collect()
}

fn check_pose(parents: &[Option<u32>], matrices: &[Matrix4<f64>]) -> Result<(), CharacterError> {
    if parents.len() != matrices.len() {
        return Err(CharacterError::Matrices { joints: parents.len(), matrices: matrices.len() });
    }
    super::skin::check_affine(matrices)
}

fn check(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    weights: &SkinWeights,
    examples: &[Example],
) -> Result<(), CharacterError> {
    if examples.is_empty() {
        return Err(CharacterError::NoExamples);
    }
    let (joints, vertices) = (skeleton.joint_count(), mesh.vertex_count());
    if weights.joint_count() != joints {
        return Err(CharacterError::Matrices { joints: weights.joint_count(), matrices: joints });
    }
    if weights.vertex_count() != vertices {
        return Err(CharacterError::PerVertex { what: "rows of weights", given: weights.vertex_count(), vertices });
    }
    for example in examples {
        let given = example.positions.len();
        if given != vertices {
            return Err(CharacterError::PerVertex { what: "positions of an example", given, vertices });
        }
        if joints != example.matrices.len() {
            return Err(CharacterError::Matrices { joints, matrices: example.matrices.len() });
        }
        super::skin::check_affine(&example.matrices)?;
    }
    Ok(())
}
