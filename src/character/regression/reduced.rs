//! The model by prototypes, so that a pose costs no solve, and evaluates a number of regressors that does not grow with the surface:
//!
//! ```text
//! E_t ≈ Σ_p c_tp E_p         E_t = exp(A q + a) (C q + c), for triangles and prototypes of the same joint
//! x_i = Σ_p (R_b E_p) g_ip + Σ_j M_j h_ij
//! ```
//!
//! Positions are linear in the gradients and in the joints' matrices, so the solves are done beforehand: `g_ip` is what a unit
//! gradient of prototype `p` does to vertex `i`, `h_ij` (four numbers) what the blended places of joint `j` do. A pose then evaluates
//! the prototypes ([`Reduced::coordinates`]: independent of the surface) and sums ([`Reduced::positions`]: one dense product).
//! Prototypes are the triangles of each joint that say most about the others over the examples: greedily, the one that leaves the
//! largest part unexplained next, as in pivoted Gram–Schmidt. The identity is always among them, so that what is rigid stays so.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Point3, Vector3};

use super::super::{CharacterError, SkinWeights};
use super::surface_of_gradients::SurfaceOfGradients;
use super::training::Regressor;
use super::{JointTurns, RegressionModel, check_pose};
use crate::mesh::TriMesh;

/// Prototypes of a joint at most: each costs three numbers for every vertex, and with more of them the solve is cheaper.
pub(super) const MOST_PROTOTYPES: usize = 32;

/// A gradient that others are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prototype {
    pub(super) bone: u32,
    /// None: the identity, which goes with the joint rigidly.
    pub(super) regressor: Option<Regressor>,
}

/// What a reduced model was made from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Parts {
    pub(super) prototypes: Vec<Prototype>,
    /// Per triangle: which prototypes, how much of each.
    pub(super) made_of: Vec<Vec<(u32, f64)>>,
    /// Of the blended places.
    pub(super) weights: SkinWeights,
    pub(super) parents: Vec<Option<u32>>,
    pub(super) hold: f64,
}

/// A model of few prototypes.
#[derive(Clone, Debug)]
pub struct Reduced {
    pub(super) parts: Parts,
    /// Vertex by vertex: `g_ip` of all prototypes, then `h_ij` of all joints.
    table: Vec<f64>,
}

impl RegressionModel {
    /// Reduces the model for the poses of `samples` (those it was trained on, mostly), to `most` prototypes for each joint beside the
    /// identity.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for samples of another skeleton, [`CharacterError::Option`] for more than 32 prototypes.
    pub fn reduced(&self, samples: &[Vec<Matrix4<f64>>], most: usize) -> Result<Reduced, CharacterError> {
        let joints = self.parents.len();
        if most > MOST_PROTOTYPES {
            return Err(CharacterError::Option { name: "prototypes", value: most as f64, range: "0 to 32" });
        }
        if let Some(sample) = samples.iter().find(|s| s.len() != joints) {
            return Err(CharacterError::Matrices { joints, matrices: sample.len() });
        }
        let turns: Vec<JointTurns> = samples.iter().map(|m| JointTurns::new(m, &self.parents)).collect();
        let mut prototypes = Vec::new();
        let mut made_of: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.regressors.len()];
        for bone in 0..joints as u32 {
            let own: Vec<usize> = (0..made_of.len()).filter(|&t| self.regressors[t].bone == bone).collect();
            if own.is_empty() {
                continue;
            }
            let samples =
                DMatrix::from_columns(&own.iter().map(|&t| sampled(&self.regressors[t], &turns)).collect::<Vec<_>>());
            let (chosen, shares) = greedy(&samples, most);
            let first = prototypes.len() as u32;
            prototypes.push(Prototype { bone, regressor: None });
            prototypes.extend(chosen.iter().map(|&c| Prototype { bone, regressor: Some(self.regressors[own[c]]) }));
            for (c, &t) in own.iter().enumerate() {
                made_of[t] = (first..).zip(shares.column(c).iter().copied()).collect();
            }
        }
        let (weights, parents, hold) = (self.places.weights.clone(), self.parents.clone(), self.hold);
        let parts = Parts { prototypes, made_of, weights, parents, hold };
        Ok(Reduced { table: table(&mut self.surface.clone(), &parts, &self.places.rest), parts })
    }
}

impl Reduced {
    /// The model for the surface at rest.
    pub(super) fn of_parts(mesh: &TriMesh, parts: Parts) -> Result<Self, CharacterError> {
        let mut surface = SurfaceOfGradients::new(mesh, parts.hold)?;
        Ok(Self { table: table(&mut surface, &parts, mesh.positions()), parts })
    }

    /// Number of prototypes.
    pub fn prototype_count(&self) -> usize {
        self.parts.prototypes.len()
    }

    /// What a pose means to every vertex: the columns of the prototypes' gradients, then those of the joints' matrices.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for another number of joints, [`CharacterError::Matrix`].
    pub fn coordinates(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Vector3<f64>>, CharacterError> {
        check_pose(&self.parts.parents, matrices)?;
        let turns = JointTurns::new(matrices, &self.parts.parents);
        let gradient = |p: &Prototype| match &p.regressor {
            Some(regressor) => regressor.gradient(&turns),
            None => turns.global[p.bone as usize].to_rotation_matrix().into_inner(),
        };
        let mut columns = Vec::with_capacity(width(&self.parts));
        for map in self.parts.prototypes.iter().map(gradient) {
            columns.extend(map.column_iter().map(Vector3::from));
        }
        for m in matrices {
            columns.extend(m.fixed_view::<3, 4>(0, 0).column_iter().map(Vector3::from));
        }
        Ok(columns)
    }

    /// The surface in a pose.
    ///
    /// # Errors
    /// As [`Self::coordinates`].
    pub fn positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let columns = self.coordinates(matrices)?;
        let point = |row: &[f64]| Point3::from(row.iter().zip(&columns).map(|(r, c)| c * *r).sum::<Vector3<f64>>());
        Ok(self.table.chunks_exact(columns.len()).map(point).collect())
    }
}

/// Numbers of a vertex.
fn width(parts: &Parts) -> usize {
    3 * parts.prototypes.len() + 4 * parts.parents.len()
}

/// `g_ip` and `h_ij`.
fn table(surface: &mut SurfaceOfGradients, parts: &Parts, rest: &[Point3<f64>]) -> Vec<f64> {
    let width = width(parts);
    let mut table = vec![0.0; width * rest.len()];
    let mut store = |first: usize, count: usize, x: Vec<Point3<f64>>| {
        for (v, x) in x.into_iter().enumerate() {
            table[v * width + first..][..count].copy_from_slice(&x.coords.as_slice()[..count]);
        }
    };
    for p in 0..parts.prototypes.len() {
        let share = |t: usize| parts.made_of[t].iter().find(|m| m.0 as usize == p).map_or(0.0, |m| m.1);
        store(3 * p, 3, surface.solve(|t| Matrix3::identity() * share(t), |_| Vector3::zeros()));
    }
    for j in 0..parts.parents.len() {
        let weight = |v: usize| parts.weights.weight(v, j as u32);
        let at = 3 * parts.prototypes.len() + 4 * j;
        store(at, 3, surface.solve(|_| Matrix3::zeros(), |v| rest[v].coords * weight(v)));
        store(at + 3, 1, surface.solve(|_| Matrix3::zeros(), |v| Vector3::new(weight(v), 0.0, 0.0)));
    }
    table
}

/// What a triangle's regressor says in each sample, less the identity.
fn sampled(regressor: &Regressor, turns: &[JointTurns]) -> DVector<f64> {
    let values = turns.iter().flat_map(|t| {
        let e = regressor.relative(t) - Matrix3::identity();
        <[[f64; 3]; 3]>::from(e).into_iter().flatten()
    });
    DVector::from_vec(values.collect())
}

/// Columns that say most about the others, and how much of the identity and of each every column is made of (rows: identity first).
///
/// Columns are sampled less the identity; what a column takes of the others, the identity loses.
fn greedy(samples: &DMatrix<f64>, most: usize) -> (Vec<usize>, DMatrix<f64>) {
    let mut left = samples.clone();
    let size = samples.norm();
    let mut chosen = Vec::new();
    while chosen.len() < most.min(samples.ncols()) {
        let largest = (0..left.ncols()).max_by(|&a, &b| left.column(a).norm().total_cmp(&left.column(b).norm()));
        let Some(next) = largest.filter(|&c| left.column(c).norm() > 1e-9 * size) else { break };
        let direction = left.column(next).normalize();
        let along = left.tr_mul(&direction);
        left.ger(-1.0, &direction, &along, 1.0);
        chosen.push(next);
    }
    let mut shares = DMatrix::zeros(chosen.len() + 1, samples.ncols());
    if !chosen.is_empty() {
        let basis = samples.select_columns(&chosen);
        let svd = basis.svd(true, true);
        // Directions that the examples hardly show would get huge shares of opposite signs.
        let least = 1e-6 * svd.singular_values.max();
        let solved = svd.solve(samples, least).expect("both factors were asked for");
        shares.rows_mut(1, chosen.len()).copy_from(&solved);
    }
    for mut column in shares.column_iter_mut() {
        column[0] = 1.0 - column.rows(1, chosen.len()).sum();
    }
    (chosen, shares)
}
