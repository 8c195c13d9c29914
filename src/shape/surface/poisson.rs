//! Poisson editing: fits the surface to gradients rotated by the interpolated handle rotations.
//!
//! ```text
//! E(x) = Σ_t A_t |∇x − R_t ∇p|²  =  Σ_t Σ_{e ∈ t} h_e |e'(x) − R_t e|²,      L x = Σ_t R_t gᵗ
//! ```
//!
//! The matrix is that of ARAP's global step. Without a local step a pose costs one solve, and one more for the rotations.
//! `R_t` is the mean of the rotations at the corners.
//!
//! # Reference
//! Y. Yu, K. Zhou, D. Xu, X. Shi, H. Bao, B. Guo, H.-Y. Shum, *Mesh editing with Poisson-based gradient field manipulation*,
//! SIGGRAPH 2004.

use super::arap::{CellKind, Elastic};
use super::bound::Bound;
use super::deformer::{DeformSolver, Request};
use super::spread::Patches;
use super::{DeformOptions, Deformation, Handles, Method, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::Cotangents;
use plumbline_num::run::Run;

/// Poisson editing, prefactored for a mesh and handles.
#[derive(Debug)]
pub(super) struct Poisson {
    bound: Bound,
    elastic: Elastic,
    patches: Patches,
}

impl Poisson {
    pub(super) fn new(
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let bound = Bound::new(mesh, handles, options)?;
        let cotangents = Cotangents::new(mesh, options.cotangents);
        let elastic = Elastic::new(CellKind::Elements, &bound.rest, cotangents, &bound.unknowns, 1.0, run)?;
        Ok(Self { patches: Patches::new(&bound), bound, elastic })
    }
}

impl DeformSolver for Poisson {
    fn method(&self) -> Method {
        Method::Poisson
    }

    fn solve(&mut self, &Request { pose, run, .. }: &Request<'_>) -> Result<Deformation, SurfaceError> {
        run.check()?;
        let targets = self.bound.targets(pose)?;
        let rotations = self.patches.rotations(&self.bound, &mut self.elastic.system, pose, &targets);
        self.elastic.set_rotations(&rotations);
        let x = self.elastic.global_step(&self.bound, &targets);
        let energy = self.elastic.exact_energy(&self.bound.rest, &x) + self.elastic.system.soft_energy(&x, &targets);
        let counts = (self.elastic.weights.negative(), self.elastic.cotangents.degenerate());
        Ok(self.bound.done(&x, pose, vec![energy], Stop::Solved, counts))
    }
}
