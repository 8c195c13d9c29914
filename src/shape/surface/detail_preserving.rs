//! Detail-preserving deformation under given transforms:
//!
//! ```text
//! E(x) = Σᵢ |(L x)ᵢ − Tᵢ (L p)ᵢ|² / mᵢ
//! ```
//!
//! The differential coordinates `δᵢ = (L p)ᵢ` are rotated (and scaled) by the transform of their vertex; the positions follow
//! from one solve with the bilaplacian `L M⁻¹ L`. With rotations blended from bones this removes the bulges of skinning; `T = I`
//! is naive Laplacian editing, which shears details.
//!
//! Rows of the bilaplacian sum to zero, hence it is stored as a Laplacian with edges over two rings. Its condition number is that
//! of `L` squared: one step of iterative refinement restores the lost digits.
//!
//! # Reference
//! O. Sorkine, D. Cohen-Or, Y. Lipman, M. Alexa, C. Rössl, H.-P. Seidel, *Laplacian surface editing*, SGP 2004, section 3;
//! Y. Lipman, O. Sorkine, D. Cohen-Or, D. Levin, C. Rössl, H.-P. Seidel, *Differential coordinates for interactive mesh
//! editing*, SMI 2004.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::bound::Bound;
use super::handle_laplacian::HandleLaplacian;
use super::lanes::Lanes;
use super::{DeformOptions, Deformation, HandlePose, Handles, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::{Cotangents, EdgeWeights, barycentric_areas};
use plumbline_num::run::{Run, Stopped};

/// Laplacian of the differential coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum LaplacianKind {
    /// Cotangent Laplacian: preserves mean curvature normals.
    ///
    /// Independent of the sampling.
    #[default]
    Cotangent,
    /// Uniform Laplacian: preserves offsets from the mean of the neighbors.
    ///
    /// Preserves tangential detail too, and needs no areas and angles: for meshes with many slivers.
    Uniform,
}

/// The solver, prefactored for a mesh and handles.
#[derive(Debug)]
pub struct DetailPreserving {
    pub(super) bound: Bound,
    pub(super) weights: EdgeWeights,
    pub(super) degenerate: usize,
    /// `1 / mᵢ`.
    inverse_mass: Vec<f64>,
    delta: Vec<Lanes>,
    system: HandleLaplacian,
}

impl DetailPreserving {
    /// Factors the bilaplacian.
    ///
    /// # Errors
    /// As [`super::Deformer::new`].
    pub fn new(mesh: &TriMesh, handles: &Handles, options: &DeformOptions, run: &Run) -> Result<Self, SurfaceError> {
        let bound = Bound::new(mesh, handles, options)?;
        let cotangents = Cotangents::new(mesh, options.cotangents).limited(MAX_COTANGENT);
        let (weights, inverse_mass) = match options.laplacian {
            LaplacianKind::Cotangent => {
                let weights = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
                (weights, inverse_areas(mesh))
            }
            LaplacianKind::Uniform => {
                let weights = EdgeWeights::uniform(mesh);
                let inverse = degrees(&weights).iter().map(|d| 1.0 / (d * d).max(1.0)).collect();
                (weights, inverse)
            }
        };
        let delta = laplacian(&weights, &bound.rest);
        let system = HandleLaplacian::new(&weights.squared(&inverse_mass)?, 1.0, &bound.unknowns, run)?;
        Ok(Self { bound, weights, degenerate: cotangents.degenerate(), inverse_mass, delta, system })
    }

    /// Solves for a transform of each vertex (a rotation, or a rotation with scale).
    ///
    /// # Errors
    /// [`SurfaceError::Pose`] or [`SurfaceError::PerVertex`] for a wrong number of targets or transforms,
    /// [`SurfaceError::NotFinite`], [`SurfaceError::Interrupted`].
    pub fn solve(
        &mut self,
        transforms: &[Matrix3<f64>],
        pose: &HandlePose,
        run: &Run,
    ) -> Result<Deformation, SurfaceError> {
        let targets = self.bound.targets(pose)?;
        let vertices = self.bound.rest.len();
        if transforms.len() != vertices {
            return Err(SurfaceError::PerVertex { what: "transforms", given: transforms.len(), vertices });
        }
        if let Some(v) = transforms.iter().position(|t| !t.iter().all(|c| c.is_finite())) {
            return Err(SurfaceError::NotFinite { what: "transform", vertex: v as u32 });
        }
        let (x, energy) = self.solve_inner(|v| transforms[v], &targets, self.bound.rest.clone(), run)?;
        Ok(self.bound.done(&x, pose, vec![energy], Stop::Solved, (self.weights.negative(), self.degenerate)))
    }

    /// `1 / mᵢ`.
    pub(super) fn inverse_mass(&self) -> &[f64] {
        &self.inverse_mass
    }

    /// The minimizer, from any initial guess, and its energy.
    pub(super) fn solve_inner(
        &mut self,
        transform: impl Fn(usize) -> Matrix3<f64>,
        targets: &[Lanes],
        mut x: Vec<Lanes>,
        run: &Run,
    ) -> Result<(Vec<Lanes>, f64), Stopped> {
        self.bound.impose(targets, &mut x);
        let rotated = |(v, d): (usize, &Lanes)| Lanes::point((transform(v) * Vector3::from(d.xyz())).into());
        let delta: Vec<Lanes> = self.delta.iter().enumerate().map(rotated).collect();
        let mut step = vec![Lanes::ZERO; self.bound.unknowns.free.len()];
        // The second pass is the iterative refinement.
        for _ in 0..2 {
            run.check()?;
            let residual = self.residual(&delta, &x);
            let slope = laplacian(&self.weights, &residual);
            for (step, &v) in step.iter_mut().zip(&self.bound.unknowns.free) {
                *step = slope[v as usize];
            }
            self.system.add_soft(&x, targets, &mut step);
            self.system.solve_unknowns(&mut step);
            for (step, &v) in step.iter().zip(&self.bound.unknowns.free) {
                x[v as usize] -= *step;
            }
        }
        let residual = self.residual(&delta, &x);
        let squares = residual.iter().zip(&self.inverse_mass).map(|(r, &w)| if w > 0.0 { r.dot(*r) / w } else { 0.0 });
        let energy = squares.sum::<f64>() + self.system.soft_energy(&x, targets);
        Ok((x, energy))
    }

    /// `M⁻¹ (L x − T δ)`.
    fn residual(&self, delta: &[Lanes], x: &[Lanes]) -> Vec<Lanes> {
        let mut residual = laplacian(&self.weights, x);
        for ((r, &delta), &w) in residual.iter_mut().zip(delta).zip(&self.inverse_mass) {
            *r = (*r - delta) * Lanes::splat(w);
        }
        residual
    }
}

/// `L x`.
pub(super) fn laplacian(weights: &EdgeWeights, x: &[Lanes]) -> Vec<Lanes> {
    let mut y = vec![Lanes::ZERO; x.len()];
    for (i, j, w) in weights.iter() {
        let pull = Lanes::splat(w) * (x[i] - x[j]);
        y[i] += pull;
        y[j] -= pull;
    }
    y
}

fn degrees(weights: &EdgeWeights) -> Vec<f64> {
    let mut degrees = vec![0.0; weights.vertex_count()];
    for (i, j, _) in weights.iter() {
        degrees[i] += 1.0;
        degrees[j] += 1.0;
    }
    degrees
}

/// Maximum half cotangent, that of needles of 1:2000. Squared and over the area it gives entries of 10⁶ beside entries of 1; the
/// factorization resolves a ratio of 10¹³.
const MAX_COTANGENT: f64 = 1e3;

/// Minimum vertex area as a fraction of the mean: a vertex of slivers only would otherwise outweigh all others.
const MIN_AREA: f64 = 1e-4;

/// Mean vertex area over that of each vertex: dimensionless, so that soft constraint weights are independent of scale.
fn inverse_areas(mesh: &TriMesh) -> Vec<f64> {
    let areas = barycentric_areas(mesh);
    let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
    if !(mean > 0.0) {
        return vec![1.0; areas.len()];
    }
    areas.iter().map(|a| mean / a.max(MIN_AREA * mean)).collect()
}
