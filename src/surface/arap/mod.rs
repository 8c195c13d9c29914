//! As rigid as possible: every cell of the surface keeps its shape as far as one rotation of its own allows.
//!
//! ```text
//! E(x) = min over R   Σ_cells c  Σ_{e ∈ c} h_e |e'(x) − R_c e|²       (spokes and rims: a third of it, a cell per vertex)
//!      = q xᵀL x − 2 Σ tr(R S) + const
//! ```
//!
//! For given rotations `x` solves one linear system whose matrix never changes ([`HeldLaplacian`]); for given `x` each
//! rotation is the best fit of its cell ([`Cells`]). In turn they lower `E` at every step. Spokes and rims is the default:
//! the three edges of a triangle form a positive form whatever its angles, so `E ≥ 0`, while single spokes of negative
//! weight can be stretched at a profit.
//!
//! # Reference
//! O. Sorkine, M. Alexa, *As-rigid-as-possible surface modeling*, SGP 2007; I. Chao, U. Pinkall, P. Sanan, P. Schröder,
//! *A simple geometric model for elastic deformations*, SIGGRAPH 2010; L. Liu, L. Zhang, Y. Xu, C. Gotsman, S. Gortler,
//! *A local/global approach to mesh parameterization*, SGP 2008 (elements).

mod cells;
mod elastic;
mod gauss_newton;
mod line_search;
mod local_global;
mod quasi_newton;
#[cfg(test)]
mod tests;

pub use cells::CellKind;
use cells::Inertia;
use elastic::Elastic;
use nalgebra::{Quaternion, UnitQuaternion};

use super::bound::Bound;
use super::deformer::{DeformOptions, Deformation, Deformer, Method, Solver, Start};
use super::lanes::Lanes;
use super::spread::Patches;
use super::{DeformReport, HandlePose, Handles, Stop, SurfaceError};
use crate::energy::Convergence;
use crate::mesh::TriMesh;
use crate::mesh::operators::Cotangents;

/// ARAP of one kind, bound to a mesh and handles.
#[derive(Debug)]
pub struct Arap {
    bound: Bound,
    elastic: Elastic,
    patches: Patches,
    solver: Solver,
    /// For Gauss–Newton only.
    inertia: Vec<Inertia>,
    last: Option<Vec<Lanes>>,
}

impl Arap {
    /// Prepares ARAP: weights, cells and the factor of the global step.
    ///
    /// # Errors
    /// As [`super::bind`].
    pub fn new(
        kind: CellKind,
        mesh: &TriMesh,
        handles: &Handles,
        options: &DeformOptions,
    ) -> Result<Self, SurfaceError> {
        let bound = Bound::new(mesh, handles, options)?;
        let elastic = Elastic::new(kind, &bound.rest, Cotangents::new(mesh, options.cotangents), &bound.held)?;
        let patches = Patches::new(&bound);
        let inertia = match options.solver {
            Solver::GaussNewton => elastic.cells.inertia(&bound.rest),
            Solver::LocalGlobal | Solver::Accelerated => Vec::new(),
        };
        Ok(Self { bound, elastic, patches, solver: options.solver, inertia, last: None })
    }

    /// Where an iteration starts, handles on their targets.
    fn start(&mut self, pose: &HandlePose, targets: &[Lanes], start: Start<'_>) -> Result<Vec<Lanes>, SurfaceError> {
        let mut x = match (start, self.last.take()) {
            (Start::Last, Some(last)) => last,
            (Start::Rest, _) => {
                self.elastic.cells.reset();
                self.bound.rest.clone()
            }
            (Start::At(positions), _) => {
                self.elastic.cells.reset();
                self.given(positions)?
            }
            (Start::Spread | Start::Last, _) => self.spread(pose, targets),
        };
        self.bound.impose(targets, &mut x);
        Ok(x)
    }

    fn given(&self, positions: &[nalgebra::Point3<f64>]) -> Result<Vec<Lanes>, SurfaceError> {
        if positions.len() != self.bound.rest.len() {
            return Err(SurfaceError::Start { given: positions.len(), vertices: self.bound.rest.len() });
        }
        match positions.iter().position(|p| !p.coords.iter().all(|c| c.is_finite())) {
            Some(v) => Err(SurfaceError::NotFinite { what: "start", vertex: v as u32 }),
            None => Ok(positions.iter().map(|p| self.bound.inner(p)).collect()),
        }
    }

    /// One global step for rotations spread from the handles.
    fn spread(&mut self, pose: &HandlePose, targets: &[Lanes]) -> Vec<Lanes> {
        let turns = match pose.rotations() {
            Some(given) => given.to_vec(),
            None => self.patches.fitted(&self.bound, targets),
        };
        let turns = self.patches.spread(&self.bound, &mut self.elastic.system, &turns);
        match self.elastic.kind {
            CellKind::Spokes | CellKind::SpokesAndRims => {
                turns.iter().enumerate().for_each(|(v, turn)| self.elastic.cells.set_turn(v, turn));
            }
            CellKind::Elements => {
                for (t, v) in self.elastic.cotangents.triangles().iter().enumerate() {
                    self.elastic.cells.set_turn(t, &mean(v.map(|v| turns[v as usize])));
                }
            }
        }
        let mut x = vec![Lanes::ZERO; turns.len()];
        self.bound.impose(targets, &mut x);
        let mut b = x.clone();
        self.elastic.cells.pull(&mut b);
        let pull = self.elastic.system.pull(&x, targets);
        self.elastic.system.solve(&b, &pull, &mut x);
        x
    }

    fn minimize(&mut self, targets: &[Lanes], x: &mut [Lanes], convergence: &Convergence) -> (Vec<f64>, Stop) {
        let elastic = &mut self.elastic;
        match self.solver {
            Solver::LocalGlobal => local_global::minimize(elastic, targets, x, convergence),
            Solver::Accelerated => quasi_newton::minimize(elastic, targets, x, convergence),
            Solver::GaussNewton => gauss_newton::minimize(elastic, &self.inertia, targets, x, convergence),
        }
    }
}

impl Deformer for Arap {
    fn method(&self) -> Method {
        match (self.solver, self.elastic.kind) {
            (Solver::GaussNewton, CellKind::SpokesAndRims) => Method::GaussNewton,
            (_, CellKind::Spokes) => Method::ArapSpokes,
            (_, CellKind::SpokesAndRims) => Method::Arap,
            (_, CellKind::Elements) => Method::ArapElements,
        }
    }

    fn deform(
        &mut self,
        pose: &HandlePose,
        start: Start<'_>,
        convergence: &Convergence,
    ) -> Result<Deformation, SurfaceError> {
        convergence.check()?;
        let targets = self.bound.targets(pose)?;
        let mut x = self.start(pose, &targets, start)?;
        let (mut energies, stop) = self.minimize(&targets, &mut x, convergence);
        if let Some(last) = energies.last_mut() {
            *last = self.elastic.defined(&self.bound.rest, &x) + self.elastic.system.soft_energy(&x, &targets);
        }
        let positions = self.bound.outer(&x, pose);
        let report = DeformReport {
            iterations: energies.len() - 1,
            energies,
            stop,
            constraint_error: self.bound.constraint_error(&positions, pose),
            shape: self.bound.gauge.measure(&positions),
            negative_weights: self.elastic.weights.negative(),
            degenerate_faces: self.elastic.cotangents.degenerate(),
            held_still: self.bound.held.still.clone(),
        };
        self.last = Some(x);
        Ok(Deformation { positions, report })
    }
}

/// A rotation between three.
fn mean(turns: [UnitQuaternion<f64>; 3]) -> UnitQuaternion<f64> {
    let first = turns[0].coords;
    let sum = turns.iter().fold(nalgebra::Vector4::zeros(), |sum, q| sum + q.coords * first.dot(&q.coords).signum());
    UnitQuaternion::new_normalize(Quaternion::from_vector(sum))
}
