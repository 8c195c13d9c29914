//! Triangle regressors, by ridge regression on the examples.

use nalgebra::{Matrix3, Matrix4, Point3, SMatrix, SVector, UnitQuaternion, Vector3, Vector4};
use rayon::prelude::*;

use super::super::{CharacterError, Skeleton, SkinWeights};
use super::gradients::gradient;
use super::{Example, JointRotations, RegressionModel};
use crate::mesh::TriMesh;
use plumbline_num::math::polar;
use plumbline_num::run::{Run, Stopped};

/// Outputs: three of the rotation vector, six of the stretch.
pub(super) const OUTPUTS: usize = 9;
/// Upper triangle of a symmetric matrix.
const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Training errors: RMS over vertices and examples, relative to the diagonal at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrainingReport {
    /// Error of the model.
    pub error: f64,
    /// Error of the linear blend with the weights that fit the examples best.
    pub linear_error: f64,
}

/// Regressor of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Regressor {
    /// The joint that the triangle follows.
    pub(super) bone: u32,
    /// The joint whose rotation is the predictor.
    pub(super) joint: u32,
    /// `[A a; C c]`.
    pub(super) map: SMatrix<f64, OUTPUTS, 4>,
}

impl Regressor {
    /// `exp(A q + a) (C q + c)`: the gradient relative to the rotation of its own joint.
    pub(super) fn relative(&self, rotations: &JointRotations) -> Matrix3<f64> {
        self.of_turn(&rotations.relative[self.joint as usize])
    }

    /// The same for zero rotation.
    pub(super) fn at_rest(&self) -> Matrix3<f64> {
        self.of_turn(&Vector3::zeros())
    }

    /// The same for a rotation vector of the predictor joint.
    pub(super) fn of_turn(&self, q: &Vector3<f64>) -> Matrix3<f64> {
        let y = self.map * Vector4::new(q.x, q.y, q.z, 1.0);
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(y[0], y[1], y[2]));
        let mut stretch = Matrix3::zeros();
        for (k, &(r, c)) in SYMMETRIC.iter().enumerate() {
            stretch[(r, c)] = y[3 + k];
            stretch[(c, r)] = y[3 + k];
        }
        rotation.to_rotation_matrix().into_inner() * stretch
    }

    /// The gradient in world coordinates.
    pub(super) fn gradient(&self, rotations: &JointRotations) -> Matrix3<f64> {
        rotations.global[self.bone as usize].to_rotation_matrix().into_inner() * self.relative(rotations)
    }
}

/// A regressor for every triangle.
pub(super) fn regressors(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    weights: &SkinWeights,
    examples: &[Example],
    ridge: f64,
    run: &Run,
) -> Result<Vec<Regressor>, Stopped> {
    let parents: Vec<_> = skeleton.joints().iter().map(|j| j.parent).collect();
    let rotations: Vec<JointRotations> = examples.iter().map(|e| JointRotations::new(&e.matrices, &parents)).collect();
    let inverses: Vec<Matrix4<f64>> = (0..skeleton.joint_count()).map(|j| inverse(&rotations, j, ridge)).collect();
    let regressor = |t: usize| {
        run.check()?;
        let bone = bone_of(weights, &mesh.triangles()[t]);
        let outputs: Vec<SVector<f64, OUTPUTS>> = examples
            .iter()
            .zip(&rotations)
            .map(|(example, rotations)| {
                let posed = mesh.triangles()[t].map(|v| example.positions[v as usize]);
                let map = gradient(&mesh.corners(t), &posed);
                output(map.as_ref(), &rotations.global[bone as usize])
            })
            .collect();
        let best = candidates(skeleton, bone).map(|j| fitted(j, bone, &rotations, &outputs, &inverses[j as usize]));
        Ok(best.min_by(|a, b| a.1.total_cmp(&b.1)).expect("its own joint at least").0)
    };
    (0..mesh.triangle_count()).into_par_iter().map(regressor).collect()
}

/// The joint with the largest weight on a triangle.
fn bone_of(weights: &SkinWeights, corners: &[u32; 3]) -> u32 {
    let sum = |j: u32| corners.iter().map(|&v| weights.weight(v as usize, j)).sum::<f64>();
    let joints = corners.iter().flat_map(|&v| weights.row(v as usize)).map(|i| i.joint);
    // Ties go to the lowest index, for any order of the corners.
    joints.max_by(|&a, &b| sum(a).total_cmp(&sum(b)).then(b.cmp(&a))).expect("every vertex follows a joint")
}

/// Candidate predictors of a triangle: its joint, the parent and the children.
fn candidates(skeleton: &Skeleton, bone: u32) -> impl Iterator<Item = u32> + '_ {
    let parent = skeleton.joints()[bone as usize].parent;
    std::iter::once(bone).chain(parent).chain(skeleton.children(bone).iter().copied())
}

/// Regression target: the triangle's map relative to the rotation of its joint.
fn output(map: Option<&Matrix3<f64>>, own: &UnitQuaternion<f64>) -> SVector<f64, OUTPUTS> {
    let (rotation, stretch) = map.map_or((*own, Matrix3::identity()), polar);
    let from_joint = (own.inverse() * rotation).scaled_axis();
    SVector::from_fn(|k, _| if k < 3 { from_joint[k] } else { stretch[SYMMETRIC[k - 3]] })
}

/// `(Σ f fᵀ + ridge)⁻¹`, `f = [q 1]`.
fn inverse(rotations: &[JointRotations], joint: usize, ridge: f64) -> Matrix4<f64> {
    let feature = |t: &JointRotations| t.relative[joint].push(1.0);
    let squares: Matrix4<f64> = rotations.iter().map(|t| feature(t) * feature(t).transpose()).sum();
    let with_ridge = squares + Matrix4::from_diagonal(&Vector4::new(ridge, ridge, ridge, 0.0));
    with_ridge
        .try_inverse()
        .expect("positive definite: a ridge on the slopes, and the offset's own square is the number of examples")
}

/// The ridge solution with one predictor, and its squared error.
fn fitted(
    joint: u32,
    bone: u32,
    rotations: &[JointRotations],
    outputs: &[SVector<f64, OUTPUTS>],
    inverse: &Matrix4<f64>,
) -> (Regressor, f64) {
    let feature = |t: &JointRotations| t.relative[joint as usize].push(1.0);
    let right: SMatrix<f64, OUTPUTS, 4> = rotations.iter().zip(outputs).map(|(t, y)| y * feature(t).transpose()).sum();
    let map = right * inverse;
    let error = rotations.iter().zip(outputs).map(|(t, y)| (y - map * feature(t)).norm_squared()).sum();
    (Regressor { bone, joint, map }, error)
}

/// Training errors.
pub(super) fn report(
    model: &mut RegressionModel,
    mesh: &TriMesh,
    examples: &[Example],
    run: &Run,
) -> Result<TrainingReport, CharacterError> {
    let (mut error, mut linear) = (0.0, 0.0);
    for example in examples {
        run.check()?;
        error += square(&model.positions(&example.matrices)?, &example.positions);
        linear += square(&model.linear_positions(&example.matrices)?, &example.positions);
    }
    let count = (mesh.vertex_count() * examples.len()).max(1) as f64;
    let root = |sum: f64| (sum / count).sqrt() / mesh.diagonal().max(f64::MIN_POSITIVE);
    Ok(TrainingReport { error: root(error), linear_error: root(linear) })
}

/// Sum of squared distances.
pub(super) fn square(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum()
}
