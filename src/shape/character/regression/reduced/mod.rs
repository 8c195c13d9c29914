//! Reduced model: a few shapes per joint instead of a solve per pose; the regressors to evaluate do not grow with the surface:
//! ```text
//! E_t(q) ≈ E_t(0) + Σ_k z_k(q) B_tk          E_t = exp(A q + a) (C q + c), triangles of one joint b explained by one joint j
//! x_i    = Σ_b R_b (g_ib + Σ_k z_k u_ik) + M_b h_ib
//! ```
//!
//! `E_t` depends on a single rotation `q`, so the maps of all triangles with the same `b` and `j` lie on a manifold of at most three
//! dimensions. Its principal directions `B_k`, by area, are the leading singular vectors over samples of `q` ([`modes`]), the optimal basis
//! of this size. The coefficients `z_k(q)` are predicted from a few key triangles. Positions are linear in the maps and in the joint
//! matrices, so all solves are precomputed: `g_ib` is the response of vertex `i` to the maps at rest, `u_ik` to `B_k`, `h_ib` (four numbers)
//! to the blended positions of the joint. The responses decay away from the joint; [`table`] stores the significant ones.
//!
//! A pose then evaluates key triangles ([`Reduced::coordinates`], independent of the surface) and sums ([`Reduced::positions`]).

mod modes;
mod table;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Point3, SMatrix};

use super::super::{CharacterError, SkinWeights};
use super::surface_of_gradients::SurfaceOfGradients;
use super::training::{OUTPUTS, Regressor};
use super::{JointRotations, RegressionModel, check_pose};
use crate::mesh::TriMesh;
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};
use table::Table;

/// Largest number of shapes per joint: each costs three numbers per affected vertex; with more the solve of the full model is faster.
pub(super) const MAX_SHAPES: usize = 32;
/// Largest number of key triangles per group: nine outputs each exceed the three degrees of freedom of a rotation many times.
pub(super) const MAX_KEYS: usize = 8;

/// Triangles with the same own and predictor joints.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    /// The joint that they follow.
    pub(super) bone: u32,
    /// The joint whose rotation is the predictor.
    pub(super) joint: u32,
    /// `[A a; C c]` of the key triangles.
    pub(super) keys: Vec<SMatrix<f64, OUTPUTS, 4>>,
    /// Linear predictor of `z` from the keys' maps minus those at rest: a row per shape, nine columns per key.
    pub(super) reading: DMatrix<f64>,
}

impl Group {
    /// Number of shapes.
    pub(super) fn shape_count(&self) -> usize {
        self.reading.nrows()
    }

    /// `z(q)`.
    fn coordinates(&self, rotations: &JointRotations) -> DVector<f64> {
        let (bone, joint) = (self.bone, self.joint);
        let q = rotations.relative[joint as usize];
        let said = self.keys.iter().flat_map(|&map| {
            let key = Regressor { bone, joint, map };
            array(&(key.of_turn(&q) - key.at_rest()))
        });
        &self.reading * DVector::from_iterator(self.reading.ncols(), said)
    }
}

/// A map of a triangle, column-major.
pub(super) type Map = [f32; 9];

/// The definition of a reduced model.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parts {
    pub(super) groups: Vec<Group>,
    /// Group of each triangle.
    pub(super) group_of: Vec<u32>,
    /// `E_t(0)`, then `B_tk` for each shape of the triangle's group; triangle by triangle.
    pub(super) maps: Vec<Map>,
    /// Weights of the blended positions.
    pub(super) weights: SkinWeights,
    pub(super) parents: Vec<Option<u32>>,
    pub(super) hold: f64,
}

/// A reduced model.
#[derive(Clone, Debug)]
pub struct Reduced {
    pub(super) parts: Parts,
    surface: SurfaceOfGradients,
    table: Table,
}

/// Shape coefficients of a pose, independent of the surface.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Rotation of each joint.
    rotations: Vec<Matrix3<f64>>,
    /// `z` of all groups, concatenated.
    shapes: Vec<f64>,
}

impl RegressionModel {
    /// Reduces the model for the poses of `samples` (usually the training poses), to `most` shapes per joint on average: those with the
    /// largest effect, weighted by area.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for samples of another skeleton, [`CharacterError::Option`] for more than 32 shapes.
    pub fn reduced(&self, samples: &[Vec<Matrix4<f64>>], most: usize, run: &Run) -> Result<Reduced, CharacterError> {
        let joints = self.parents.len();
        OptionError::check(most <= MAX_SHAPES, "prototypes", most as f64, "0 to 32")?;
        samples.iter().try_for_each(|s| CharacterError::check_matrices(joints, s.len()))?;
        let rotations: Vec<JointRotations> = samples.iter().map(|m| JointRotations::new(m, &self.parents)).collect();
        let (groups, group_of, maps) = modes::groups(&self.regressors, &self.surface.areas(), &rotations, most, run)?;
        let (weights, parents, hold) = (self.blend.weights.clone(), self.parents.clone(), self.hold);
        let parts = Parts { groups, group_of, maps, weights, parents, hold };
        Ok(Reduced::new(self.surface.clone(), parts, run)?)
    }
}

impl Reduced {
    /// The model for a rest surface.
    pub(super) fn of_parts(mesh: &TriMesh, parts: Parts, run: &Run) -> Result<Self, CharacterError> {
        Ok(Self::new(SurfaceOfGradients::new(mesh, parts.hold, run)?, parts, run)?)
    }

    fn new(mut surface: SurfaceOfGradients, parts: Parts, run: &Run) -> Result<Self, Stopped> {
        Ok(Self { table: Table::new(&mut surface, &parts, run)?, surface, parts })
    }

    /// Replaces the rest surface, as morph targets do: solves for all shapes again.
    pub(super) fn set_rest(&mut self, rest: &[Point3<f64>], run: &Run) -> Result<(), CharacterError> {
        let mut surface = self.surface.clone();
        surface.set_rest(rest)?;
        self.table = Table::new(&mut surface, &self.parts, run)?;
        self.surface = surface;
        Ok(())
    }

    /// Number of shapes in addition to the rigid one of each joint.
    pub fn shape_count(&self) -> usize {
        self.parts.groups.iter().map(Group::shape_count).sum()
    }

    /// Shape coefficients of a pose.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a wrong number of joints or an invalid matrix.
    pub fn coordinates(&self, matrices: &[Matrix4<f64>]) -> Result<Coordinates, CharacterError> {
        check_pose(&self.parts.parents, matrices)?;
        let rotations = JointRotations::new(matrices, &self.parts.parents);
        let shapes = self.parts.groups.iter().flat_map(|s| s.coordinates(&rotations).data.as_vec().clone()).collect();
        Ok(Coordinates {
            rotations: rotations.global.iter().map(|t| t.to_rotation_matrix().into_inner()).collect(),
            shapes,
        })
    }

    /// The surface in a pose, in single precision. Truncation moves vertices by at most 4·10⁻⁴ of the diagonal, typically a tenth of that.
    ///
    /// # Errors
    /// As [`Self::coordinates`].
    pub fn positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let coordinates = self.coordinates(matrices)?;
        Ok(self.table.positions(&coordinates, matrices))
    }
}

/// Column-major array.
fn array(m: &Matrix3<f64>) -> [f64; 9] {
    m.as_slice().try_into().expect("three times three")
}
