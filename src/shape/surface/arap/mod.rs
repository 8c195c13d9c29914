//! As-rigid-as-possible deformation (ARAP): every cell of the surface is as close as possible to a rotation of its rest shape.
//!
//! ```text
//! E(x) = min over R   Σ_cells c  Σ_{e ∈ c} h_e |e'(x) − R_c e|²       (spokes and rims: a third of it, a cell per vertex)
//!      = q xᵀL x − 2 Σ tr(R S) + const
//! ```
//!
//! For given rotations `x` solves one linear system with a constant matrix ([`HandleLaplacian`]); for given `x` each rotation is
//! the best fit of its cell ([`Cells`]). Alternating both decreases `E` in every iteration. The default is spokes and rims: the
//! three edges of a triangle form a positive semidefinite form whatever its angles, so that `E ≥ 0`, while stretching a single
//! spoke of negative weight decreases the energy.
//!
//! # Reference
//! O. Sorkine, M. Alexa, *As-rigid-as-possible surface modeling*, SGP 2007; I. Chao, U. Pinkall, P. Sanan, P. Schröder,
//! *A simple geometric model for elastic deformations*, SIGGRAPH 2010; L. Liu, L. Zhang, Y. Xu, C. Gotsman, S. Gortler,
//! *A local/global approach to mesh parameterization*, SGP 2008 (elements).

mod cell_energies;
mod cells;
mod descent;
mod elastic;
mod gauss_newton;
mod local_global;
mod quasi_newton;
mod smoothness;
#[cfg(test)]
mod tests;

pub use cell_energies::CellEnergies;
pub(super) use cells::CellKind;
pub(super) use cells::Cells;
use cells::Inertia;
use descent::descend;
pub(super) use elastic::Elastic;
use gauss_newton::Linearized;
use quasi_newton::Lbfgs;
use smoothness::Smoothness;

use super::bound::{Bound, Guess};
use super::deformer::{DeformOptions, DeformSolver, Deformation, Method, Request, Solver};
use super::lanes::Lanes;
use super::spread::Patches;
use super::{HandlePose, Handles, Stop, SurfaceError};
use crate::mesh::TriMesh;
use crate::mesh::operators::Cotangents;
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};

/// ARAP with one kind of cells, prefactored for a mesh and handles.
#[derive(Debug)]
pub(super) struct Arap {
    bound: Bound,
    elastic: Elastic,
    patches: Patches,
    solver: Solver,
    /// For Gauss–Newton only.
    inertia: Vec<Inertia>,
    last: Option<Vec<Lanes>>,
    /// Steps of the calls that follow a hand: the Hessian hardly depends on the targets.
    following: Lbfgs,
}

impl Arap {
    /// Computes weights and cells, and factors the global step.
    ///
    /// # Errors
    /// As [`super::Deformer::new`].
    pub(super) fn new(
        kind: CellKind,
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let bending = options.bending;
        OptionError::check(bending > 0.0 && bending <= 1.0, "bending", bending, "above 0, at most 1")?;
        let bound = Bound::new(mesh, handles, options)?;
        let mut elastic =
            Elastic::new(kind, &bound.rest, Cotangents::new(mesh, options.cotangents), &bound.unknowns, bending, run)?;
        if let Some(strength) = checked_smoothness(options, kind)? {
            elastic.smoothness = Some(Smoothness::new(&elastic.weights, strength * mesh.area()));
        }
        let patches = Patches::new(&bound);
        let inertia = match options.solver {
            Solver::GaussNewton => elastic.cells.inertia(&bound.rest),
            Solver::LocalGlobal | Solver::Accelerated => Vec::new(),
        };
        Ok(Self { bound, elastic, patches, solver: options.solver, inertia, last: None, following: Lbfgs::default() })
    }

    /// The initial positions, with hard constraints at their targets.
    fn initial(&mut self, request: &Request<'_>, targets: &[Lanes]) -> Result<Vec<Lanes>, SurfaceError> {
        let guess = self.bound.guess(request.guess, self.last.take())?;
        if let Guess::Rest | Guess::At(_) = guess {
            self.elastic.cells.reset();
        }
        let mut x = match guess {
            Guess::Last(x) | Guess::At(x) => x,
            Guess::Rest => self.bound.rest.clone(),
            Guess::Own => {
                let rotations = self.patches.rotations(&self.bound, &mut self.elastic.system, request.pose, targets);
                self.elastic.set_rotations(&rotations);
                self.elastic.global_step(&self.bound, targets)
            }
        };
        self.bound.impose(targets, &mut x);
        Ok(x)
    }

    fn minimize(
        &mut self,
        targets: &[Lanes],
        x: &mut [Lanes],
        &Request { convergence, run, measured, .. }: &Request<'_>,
    ) -> Result<(Vec<f64>, Stop), Stopped> {
        let elastic = &mut self.elastic;
        if measured {
            self.following = Lbfgs::default();
        }
        let until = (convergence, !measured);
        match self.solver {
            _ if elastic.smoothness.is_some() => local_global::minimize(elastic, targets, x, convergence, run),
            Solver::LocalGlobal => local_global::minimize(elastic, targets, x, convergence, run),
            Solver::Accelerated => descend(elastic, &mut self.following, targets, x, until, run),
            Solver::GaussNewton => {
                let mut linearized = Linearized::new(&self.inertia, elastic.system.free().len(), x.len());
                descend(elastic, &mut linearized, targets, x, until, run)
            }
        }
    }
}

/// The checked `α`; `None` for 0.
fn checked_smoothness(options: &DeformOptions, kind: CellKind) -> Result<Option<f64>, OptionError> {
    let (name, value) = ("smoothness", options.smoothness);
    OptionError::check(kind != CellKind::Elements || value == 0.0, name, value, "0 with triangle cells")?;
    OptionError::check(value >= 0.0 && value.is_finite(), name, value, "0 or more")?;
    Ok((value > 0.0).then_some(value))
}

impl DeformSolver for Arap {
    fn method(&self) -> Method {
        match (self.solver, self.elastic.kind) {
            (Solver::GaussNewton, CellKind::SpokesAndRims) => Method::GaussNewton,
            (_, CellKind::Spokes) => Method::ArapSpokes,
            (_, CellKind::SpokesAndRims) => Method::Arap,
            (_, CellKind::Elements) => Method::ArapElements,
        }
    }

    fn round(&mut self) {
        if self.solver != Solver::LocalGlobal && self.elastic.smoothness.is_none() {
            self.elastic.system.round();
        }
    }

    fn largest_rotation(&self, pose: &HandlePose) -> Result<f64, SurfaceError> {
        let targets = self.bound.targets(pose)?;
        Ok(self.patches.largest_rotation(&self.bound, pose, &targets))
    }

    fn partway(&self, pose: &HandlePose, fraction: f64) -> Result<HandlePose, SurfaceError> {
        let targets = self.bound.targets(pose)?;
        Ok(self.patches.partway(&self.bound, pose, &targets, fraction))
    }

    fn solve(&mut self, request: &Request<'_>) -> Result<Deformation, SurfaceError> {
        let targets = self.bound.targets(request.pose)?;
        let mut x = self.initial(request, &targets)?;
        let (mut energies, stop) = self.minimize(&targets, &mut x, request)?;
        if let Some(last) = energies.last_mut().filter(|_| request.measured) {
            *last = self.elastic.exact_energy(&self.bound.rest, &x) + self.elastic.system.soft_energy(&x, &targets);
        }
        if request.measured {
            self.following = Lbfgs::default();
        }
        let counts = (self.elastic.weights.negative(), self.elastic.cotangents.degenerate());
        let done = if request.measured {
            self.bound.done(&x, request.pose, energies, stop, counts)
        } else {
            self.bound.unmeasured(&x, request.pose, energies, stop, counts)
        };
        self.last = Some(x);
        Ok(done)
    }
}
