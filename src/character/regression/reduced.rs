//! The model by prototypes, so that a pose costs a number of regressors that does not grow with the surface:
//!
//! ```text
//! E_t ≈ Σ_p c_tp E_p         E_t = exp(A q + a) (C q + c), for triangles and prototypes of the same joint
//! x_i = Σ_p (R_b E_p) g_ip + middle of the piece         g_ip: the surface of the unit gradients of p
//! ```
//!
//! Positions are linear in the gradients, so the solve of each prototype is done beforehand; a pose then evaluates the prototypes
//! ([`Reduced::coordinates`]: independent of the surface) and sums them ([`Reduced::positions`]: nine products per vertex and
//! prototype). Prototypes are the triangles of each joint that say most about the others over the examples: greedily, the one that
//! leaves the largest part unexplained next, as in pivoted Gram–Schmidt. The identity is always among them, so that what is rigid
//! stays so.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix4, Point3, Vector3};

use super::super::CharacterError;
use super::super::skinning::Skinner;
use super::surface_of_gradients::SurfaceOfGradients;
use super::training::Regressor;
use super::{JointTurns, RegressionModel};

/// A gradient that others are made of.
#[derive(Clone, Copy, Debug)]
struct Prototype {
    bone: u32,
    /// None: the identity, which goes with the joint rigidly.
    regressor: Option<Regressor>,
}

/// A model of few prototypes.
#[derive(Clone, Debug)]
pub struct Reduced {
    prototypes: Vec<Prototype>,
    /// `g_ip`, vertex by vertex.
    surfaces: Vec<Vector3<f64>>,
    surface: SurfaceOfGradients,
    linear: Skinner,
    parents: Vec<Option<u32>>,
}

impl RegressionModel {
    /// Reduces the model for the poses of `samples` (those it was trained on, mostly), to `most` prototypes for each joint beside the
    /// identity.
    ///
    /// # Errors
    /// [`CharacterError::Matrices`] for samples of another skeleton.
    pub fn reduced(&self, samples: &[Vec<Matrix4<f64>>], most: usize) -> Result<Reduced, CharacterError> {
        let joints = self.parents.len();
        if let Some(sample) = samples.iter().find(|s| s.len() != joints) {
            return Err(CharacterError::Matrices { joints, matrices: sample.len() });
        }
        let turns: Vec<JointTurns> = samples.iter().map(|m| JointTurns::new(m, &self.parents)).collect();
        let mut prototypes = Vec::new();
        // Per triangle: which prototypes, how much of each.
        let mut made_of: Vec<Vec<(usize, f64)>> = vec![Vec::new(); self.regressors.len()];
        for bone in 0..joints as u32 {
            let own: Vec<usize> = (0..made_of.len()).filter(|&t| self.regressors[t].bone == bone).collect();
            if own.is_empty() {
                continue;
            }
            let samples =
                DMatrix::from_columns(&own.iter().map(|&t| sampled(&self.regressors[t], &turns)).collect::<Vec<_>>());
            let (chosen, shares) = greedy(&samples, most);
            let first = prototypes.len();
            prototypes.push(Prototype { bone, regressor: None });
            prototypes.extend(chosen.iter().map(|&c| Prototype { bone, regressor: Some(self.regressors[own[c]]) }));
            for (c, &t) in own.iter().enumerate() {
                made_of[t] = shares.column(c).iter().enumerate().map(|(p, w)| (first + p, *w)).collect();
            }
        }
        let mut surface = self.surface.clone();
        let surfaces = surfaces(&mut surface, &made_of, prototypes.len());
        let (linear, parents) = (self.linear.clone(), self.parents.clone());
        Ok(Reduced { prototypes, surfaces, surface, linear, parents })
    }
}

impl Reduced {
    /// Number of prototypes.
    pub fn prototype_count(&self) -> usize {
        self.prototypes.len()
    }

    /// The gradients of the prototypes in a pose.
    pub fn coordinates(&self, matrices: &[Matrix4<f64>]) -> Vec<Matrix3<f64>> {
        let turns = JointTurns::new(matrices, &self.parents);
        let gradient = |p: &Prototype| match &p.regressor {
            Some(regressor) => regressor.gradient(&turns),
            None => turns.global[p.bone as usize].to_rotation_matrix().into_inner(),
        };
        self.prototypes.iter().map(gradient).collect()
    }

    /// The surface in a pose.
    ///
    /// # Errors
    /// As [`Skinner::positions`].
    pub fn positions(&self, matrices: &[Matrix4<f64>]) -> Result<Vec<Point3<f64>>, CharacterError> {
        let places = self.linear.positions(matrices)?;
        let gradients = self.coordinates(matrices);
        let point =
            |g: &[Vector3<f64>]| Point3::from(gradients.iter().zip(g).map(|(d, g)| d * g).sum::<Vector3<f64>>());
        let mut x: Vec<_> = self.surfaces.chunks_exact(self.prototypes.len().max(1)).map(point).collect();
        x.resize(places.len(), Point3::origin());
        self.surface.placed(&mut x, &places);
        Ok(x)
    }
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

/// `g_ip`: where a gradient `D` of prototype `p` alone puts the vertices is `D g_ip`.
fn surfaces(surface: &mut SurfaceOfGradients, made_of: &[Vec<(usize, f64)>], count: usize) -> Vec<Vector3<f64>> {
    let mut all: Vec<Vector3<f64>> = Vec::new();
    for p in 0..count {
        let share = |t: usize| made_of[t].iter().find(|m| m.0 == p).map_or(0.0, |m| m.1);
        let x = surface.shape(|t| Matrix3::identity() * share(t));
        let x = surface.centered(&x);
        all.resize(x.len() * count, Vector3::zeros());
        for (v, x) in x.into_iter().enumerate() {
            all[v * count + p] = x;
        }
    }
    all
}
