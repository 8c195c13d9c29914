//! Details kept under given transforms:
//!
//! ```text
//! E(x) = Σᵢ |(L x)ᵢ − Tᵢ (L p)ᵢ|² / mᵢ
//! ```
//!
//! The differential coordinate `δᵢ = (L p)ᵢ` says how vertex `i` lies among its neighbors; each is turned (and scaled) by the
//! transform of its vertex, and the positions follow by one solve with the bilaplacian `L M⁻¹ L`. With rotations that are
//! blended from bones this takes the bulges out of skinning; with `T = I` it is the naive editing that shears details.
//!
//! Rows of the bilaplacian sum to zero, hence it is handled as a Laplacian whose edges reach two rings. Its condition is that
//! of `L` squared: one step of iterative refinement gives the digits back.
//!
//! # Reference
//! O. Sorkine, D. Cohen-Or, Y. Lipman, M. Alexa, C. Rössl, H.-P. Seidel, *Laplacian surface editing*, SGP 2004, section 3;
//! Y. Lipman, O. Sorkine, D. Cohen-Or, D. Levin, C. Rössl, H.-P. Seidel, *Differential coordinates for interactive mesh
//! editing*, SMI 2004.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::bound::Bound;
use super::held_laplacian::HeldLaplacian;
use super::lanes::Lanes;
use super::{DeformOptions, Deformation, HandlePose, Handles, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::{Cotangents, EdgeWeights, barycentric_areas};
use plumbline_num::run::{Run, Stopped};

/// Which Laplacian the differential coordinates are of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum LaplacianKind {
    /// How far vertices stand off the surface around them.
    ///
    /// Cotangents over areas: normal to the surface, the same for fine and coarse triangles.
    #[default]
    Cotangent,
    /// How far vertices are from the mean of their neighbors.
    ///
    /// Needs no areas and no angles, keeps tangential detail too.
    Uniform,
}

/// The solver, bound to a mesh and handles.
#[derive(Debug)]
pub struct DetailPreserving {
    pub(super) bound: Bound,
    pub(super) weights: EdgeWeights,
    pub(super) degenerate: usize,
    /// `1 / mᵢ`.
    inverse_mass: Vec<f64>,
    delta: Vec<Lanes>,
    system: HeldLaplacian,
}

impl DetailPreserving {
    /// Prepares the factor of the bilaplacian.
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
        let system = HeldLaplacian::new(&weights.squared(&inverse_mass), 1.0, &bound.held, run)?;
        Ok(Self { bound, weights, degenerate: cotangents.degenerate(), inverse_mass, delta, system })
    }

    /// The surface for a transform of each vertex (rotation, perhaps with scale).
    ///
    /// # Errors
    /// [`SurfaceError::Pose`] for another number of transforms or targets, [`SurfaceError::NotFinite`].
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

    /// The minimizer from any start, and its energy.
    pub(super) fn solve_inner(
        &mut self,
        transform: impl Fn(usize) -> Matrix3<f64>,
        targets: &[Lanes],
        mut x: Vec<Lanes>,
        run: &Run,
    ) -> Result<(Vec<Lanes>, f64), Stopped> {
        self.bound.impose(targets, &mut x);
        let wanted = |(v, d): (usize, &Lanes)| Lanes::point((transform(v) * Vector3::from(d.xyz())).into());
        let wanted: Vec<Lanes> = self.delta.iter().enumerate().map(wanted).collect();
        let mut step = vec![Lanes::ZERO; self.bound.held.free.len()];
        // The second round is the refinement.
        for _ in 0..2 {
            run.check()?;
            let misfit = self.misfit(&wanted, &x);
            let slope = laplacian(&self.weights, &misfit);
            for (step, &v) in step.iter_mut().zip(&self.bound.held.free) {
                *step = slope[v as usize];
            }
            self.system.add_soft(&x, targets, &mut step);
            self.system.solve_unknowns(&mut step);
            for (step, &v) in step.iter().zip(&self.bound.held.free) {
                x[v as usize] -= *step;
            }
        }
        let misfit = self.misfit(&wanted, &x);
        let squares = misfit.iter().zip(&self.inverse_mass).map(|(r, &w)| if w > 0.0 { r.dot(*r) / w } else { 0.0 });
        let energy = squares.sum::<f64>() + self.system.soft_energy(&x, targets);
        Ok((x, energy))
    }

    /// `M⁻¹ (L x − T δ)`.
    fn misfit(&self, wanted: &[Lanes], x: &[Lanes]) -> Vec<Lanes> {
        let mut misfit = laplacian(&self.weights, x);
        for ((r, &wanted), &w) in misfit.iter_mut().zip(wanted).zip(&self.inverse_mass) {
            *r = (*r - wanted) * Lanes::splat(w);
        }
        misfit
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

/// Half cotangents at most: needles of 1:2000 keep theirs. Squared and over the area they make 10⁶ beside the 1 of others, and
/// 10¹³ is what the factorization can tell apart.
const MAX_COTANGENT: f64 = 1e3;

/// A vertex area is at least this fraction of the mean: the corner of slivers only would outweigh all others.
const MIN_AREA: f64 = 1e-4;

/// Mean vertex area over that of each vertex: dimensionless, so that soft weights mean the same at any scale.
fn inverse_areas(mesh: &TriMesh) -> Vec<f64> {
    let areas = barycentric_areas(mesh);
    let mean = areas.iter().sum::<f64>() / areas.len().max(1) as f64;
    if !(mean > 0.0) {
        return vec![1.0; areas.len()];
    }
    areas.iter().map(|a| mean / a.max(MIN_AREA * mean)).collect()
}
