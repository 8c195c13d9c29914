//! The model by a few shapes of each joint, so that a pose costs no solve, and what it evaluates of regressors does not grow with the
//! surface:
//!
//! ```text
//! E_t(q) ≈ E_t(0) + Σ_k z_k(q) B_tk          E_t = exp(A q + a) (C q + c), triangles of one joint b explained by one joint j
//! x_i    = Σ_b R_b (g_ib + Σ_k z_k u_ik) + M_b h_ib
//! ```
//!
//! What a triangle says depends on one turn `q` alone, so the maps of all triangles that share `b` and `j` move on a curved sheet of
//! three dimensions at most. The directions `B_k` in which it reaches furthest, by area, are those of the largest singular values
//! over samples of `q` ([`modes`]): no other basis of as many comes closer to the samples. How far the sheet goes along each,
//! `z_k(q)`, is read off a few key triangles. Positions are linear in the maps and in the joints' matrices, so the solves are done beforehand: `g_ib` is what maps at
//! rest do to vertex `i`, `u_ik` what `B_k` does, `h_ib` (four numbers) what the blended places of the joint do. They are near zero
//! but about the joint; [`table`] keeps the others.
//!
//! A pose then evaluates key triangles ([`Reduced::coordinates`]: independent of the surface) and sums ([`Reduced::positions`]).

mod modes;
mod table;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Point3, SMatrix};

use super::super::{CharacterError, SkinWeights};
use super::surface_of_gradients::SurfaceOfGradients;
use super::training::{OUTPUTS, Regressor};
use super::{JointTurns, RegressionModel, check_pose};
use crate::mesh::TriMesh;
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};
use table::Table;

/// Shapes for each joint at most: each costs three numbers for the vertices about it, and with more of them the solve is cheaper.
pub(super) const MAX_SHAPES: usize = 32;
/// Key triangles of a sheet at most: nine numbers each tell more than a turn of three can mean.
pub(super) const MAX_KEYS: usize = 8;

/// What triangles that go with one joint and are explained by one do.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sheet {
    /// The joint that they go with.
    pub(super) bone: u32,
    /// The joint whose turn explains them.
    pub(super) joint: u32,
    /// `[A a; C c]` of the key triangles.
    pub(super) keys: Vec<SMatrix<f64, OUTPUTS, 4>>,
    /// `z` from what the keys say less what they say at rest, one after the other: a row per shape, nine columns per key.
    pub(super) reading: DMatrix<f64>,
}

impl Sheet {
    /// Number of shapes.
    pub(super) fn shape_count(&self) -> usize {
        self.reading.nrows()
    }

    /// `z(q)`.
    fn coordinates(&self, turns: &JointTurns) -> DVector<f64> {
        let (bone, joint) = (self.bone, self.joint);
        let q = turns.relative[joint as usize];
        let said = self.keys.iter().flat_map(|&map| {
            let key = Regressor { bone, joint, map };
            array(&(key.of_turn(&q) - key.at_rest()))
        });
        &self.reading * DVector::from_iterator(self.reading.ncols(), said)
    }
}

/// A map of a triangle, by columns.
pub(super) type Map = [f32; 9];

/// What a reduced model was made from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parts {
    pub(super) sheets: Vec<Sheet>,
    /// Sheet of each triangle.
    pub(super) sheet_of: Vec<u32>,
    /// `E_t(0)`, then `B_tk` for each shape of the triangle's sheet; triangle by triangle.
    pub(super) maps: Vec<Map>,
    /// Of the blended places.
    pub(super) weights: SkinWeights,
    pub(super) parents: Vec<Option<u32>>,
    pub(super) hold: f64,
}

/// A model of few shapes.
#[derive(Clone, Debug)]
pub struct Reduced {
    pub(super) parts: Parts,
    surface: SurfaceOfGradients,
    table: Table,
}

/// What a pose means, whatever the surface.
#[derive(Clone, Debug)]
pub struct Coordinates {
    /// Turn of each joint.
    turns: Vec<Matrix3<f64>>,
    /// `z` of all sheets, one after the other.
    shapes: Vec<f64>,
}

impl RegressionModel {
    /// Reduces the model for the poses of `samples` (those it was trained on, mostly), to `most` shapes for each joint in the mean:
    /// those that move most of the surface furthest.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for samples of another skeleton, [`CharacterError::Option`] for more than 32 shapes.
    pub fn reduced(&self, samples: &[Vec<Matrix4<f64>>], most: usize, run: &Run) -> Result<Reduced, CharacterError> {
        let joints = self.parents.len();
        OptionError::check(most <= MAX_SHAPES, "prototypes", most as f64, "0 to 32")?;
        if let Some(sample) = samples.iter().find(|s| s.len() != joints) {
            return Err(CharacterError::Matrices { joints, matrices: sample.len() });
        }
        let turns: Vec<JointTurns> = samples.iter().map(|m| JointTurns::new(m, &self.parents)).collect();
        let (sheets, sheet_of, maps) = modes::sheets(&self.regressors, &self.surface.areas(), &turns, most, run)?;
        let (weights, parents, hold) = (self.places.weights.clone(), self.parents.clone(), self.hold);
        let parts = Parts { sheets, sheet_of, maps, weights, parents, hold };
        Ok(Reduced::new(self.surface.clone(), parts, run)?)
    }
}

impl Reduced {
    /// The model for the surface at rest.
    pub(super) fn of_parts(mesh: &TriMesh, parts: Parts, run: &Run) -> Result<Self, CharacterError> {
        Ok(Self::new(SurfaceOfGradients::new(mesh, parts.hold, run)?, parts, run)?)
    }

    fn new(mut surface: SurfaceOfGradients, parts: Parts, run: &Run) -> Result<Self, Stopped> {
        Ok(Self { table: Table::new(&mut surface, &parts, run)?, surface, parts })
    }

    /// Moves the surface at rest, as morph targets do: all shapes are solved for anew.
    pub(super) fn set_rest(&mut self, rest: &[Point3<f64>], run: &Run) -> Result<(), CharacterError> {
        let mut surface = self.surface.clone();
        surface.set_rest(rest)?;
        self.table = Table::new(&mut surface, &self.parts, run)?;
        self.surface = surface;
        Ok(())
    }

    /// Number of shapes beside the rigid one of each joint.
    pub fn shape_count(&self) -> usize {
        self.parts.sheets.iter().map(Sheet::shape_count).sum()
    }

    /// What a pose means to the shapes.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for another number of joints, [`CharacterError::Matrix`].
    pub fn coordinates(&self, matrices: &[Matrix4<f64>]) -> Result<Coordinates, CharacterError> {
        check_pose(&self.parts.parents, matrices)?;
        let turns = JointTurns::new(matrices, &self.parts.parents);
        let shapes = self.parts.sheets.iter().flat_map(|s| s.coordinates(&turns).data.as_vec().clone()).collect();
        Ok(Coordinates { turns: turns.global.iter().map(|t| t.to_rotation_matrix().into_inner()).collect(), shapes })
    }

    /// The surface in a pose, in single precision, less what is left out (at most 4·10⁻⁴ of the diagonal; a tenth of that is the
    /// rule).
    ///
    /// # Errors
    /// As [`Self::coordinates`].
    pub fn positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let coordinates = self.coordinates(matrices)?;
        Ok(self.table.positions(&coordinates, matrices))
    }
}

/// By columns.
fn array(m: &Matrix3<f64>) -> [f64; 9] {
    m.as_slice().try_into().expect("three times three")
}
