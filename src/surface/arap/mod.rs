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
#[cfg(test)]
mod tests;

pub use cells::CellKind;
use cells::Cells;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::bound::Bound;
use super::deformer::{DeformOptions, Deformation, Deformer, Method, Start};
use super::held_laplacian::HeldLaplacian;
use super::lanes::Lanes;
use super::spread::Patches;
use super::{DeformReport, HandlePose, Handles, Stop, SurfaceError};
use crate::energy::Convergence;
use crate::mesh::TriMesh;
use crate::mesh::operators::{Cotangents, EdgeWeights};

/// ARAP of one kind, bound to a mesh and handles.
#[derive(Debug)]
pub struct Arap {
    kind: CellKind,
    bound: Bound,
    cotangents: Cotangents,
    weights: EdgeWeights,
    cells: Cells,
    system: HeldLaplacian,
    patches: Patches,
    /// `Σ_c Σ_e h_e |e|²`: the part of the energy that does not depend on `x`.
    at_rest: f64,
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
        let cotangents = Cotangents::new(mesh, options.cotangents);
        let weights = EdgeWeights::cotangent(mesh.vertex_count(), &cotangents);
        let system = HeldLaplacian::new(&weights, kind.laplacians(), &bound.held)?;
        let cells = Cells::new(kind, &bound.rest, &cotangents);
        let patches = Patches::new(&bound);
        let at_rest = kind.laplacians() * dirichlet(&weights, &bound.rest);
        Ok(Self { kind, bound, cotangents, weights, cells, system, patches, at_rest, last: None })
    }

    /// Where an iteration starts, handles on their targets.
    fn start(&mut self, pose: &HandlePose, targets: &[Lanes], start: Start<'_>) -> Result<Vec<Lanes>, SurfaceError> {
        let mut x = match (start, self.last.take()) {
            (Start::Last, Some(last)) => last,
            (Start::Rest, _) => {
                self.cells.reset();
                self.bound.rest.clone()
            }
            (Start::At(positions), _) => {
                self.cells.reset();
                self.given(positions)?
            }
            (Start::Spread | Start::Last, _) => self.spread(pose, targets),
        };
        self.bound.impose(targets, &mut x);
        Ok(x)
    }

    fn given(&self, positions: &[nalgebra::Point3<f64>]) -> Result<Vec<Lanes>, SurfaceError> {
        if positions.len() != self.bound.rest.len() {
            let (given, handles) = (positions.len(), self.bound.rest.len());
            return Err(SurfaceError::Start { given, vertices: handles });
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
        let turns = self.patches.spread(&self.bound, &mut self.system, &turns);
        match self.kind {
            CellKind::Spokes | CellKind::SpokesAndRims => {
                turns.iter().enumerate().for_each(|(v, turn)| self.cells.set_turn(v, turn));
            }
            CellKind::Elements => {
                for (t, v) in self.cotangents.triangles().iter().enumerate() {
                    self.cells.set_turn(t, &mean(v.map(|v| turns[v as usize])));
                }
            }
        }
        let mut x = vec![Lanes::ZERO; turns.len()];
        self.bound.impose(targets, &mut x);
        let mut b = x.clone();
        self.cells.pull(&mut b);
        let pull = self.system.pull(&x, targets);
        self.system.solve(&b, &pull, &mut x);
        x
    }

    /// Fits the rotations to `x`, writes their pull, and returns the energy.
    fn fit(&mut self, x: &[Lanes], targets: &[Lanes], b: &mut [Lanes]) -> f64 {
        let traces = self.cells.fit(x, b);
        let stretch = self.kind.laplacians() * dirichlet(&self.weights, x);
        stretch + self.at_rest - 2.0 * traces + self.system.soft_energy(x, targets)
    }

    /// Rotations and positions in turn.
    fn local_global(&mut self, targets: &[Lanes], x: &mut [Lanes], convergence: &Convergence) -> (Vec<f64>, Stop) {
        let pull = self.system.pull(x, targets);
        let mut b = vec![Lanes::ZERO; x.len()];
        let mut energies = vec![self.fit(x, targets, &mut b)];
        for _ in 0..convergence.max_iterations {
            self.system.solve(&b, &pull, x);
            energies.push(self.fit(x, targets, &mut b));
            if convergence.reached(&energies) {
                return (energies, Stop::Converged);
            }
        }
        (energies, Stop::IterationsUsedUp)
    }

    /// The energy as it is defined, edge by edge, for the rotations last fitted: exact where it is tiny.
    fn energy(&self, x: &[Lanes]) -> f64 {
        let vector = |v: &[Lanes], i: u32, j: u32| Vector3::from((v[j as usize] - v[i as usize]).xyz());
        let mut energy = 0.0;
        for (t, edges) in self.cotangents.edges().enumerate() {
            let corners = self.cotangents.triangles()[t];
            for (i, j, h) in edges {
                let (now, rest) = (vector(x, i, j), vector(&self.bound.rest, i, j));
                let misfit = |cell: u32| (now - self.cells.turn(cell as usize) * rest).norm_squared();
                energy += h * match self.kind {
                    CellKind::Spokes => misfit(i) + misfit(j),
                    CellKind::SpokesAndRims => corners.iter().map(|&v| misfit(v)).sum::<f64>() / 3.0,
                    CellKind::Elements => misfit(t as u32),
                };
            }
        }
        energy
    }
}

impl Deformer for Arap {
    fn method(&self) -> Method {
        match self.kind {
            CellKind::Spokes => Method::ArapSpokes,
            CellKind::SpokesAndRims => Method::Arap,
            CellKind::Elements => Method::ArapElements,
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
        let (mut energies, stop) = self.local_global(&targets, &mut x, convergence);
        if let Some(last) = energies.last_mut() {
            *last = self.energy(&x) + self.system.soft_energy(&x, &targets);
        }
        let positions = self.bound.outer(&x, pose);
        let report = DeformReport {
            iterations: energies.len() - 1,
            energies,
            stop,
            constraint_error: self.bound.constraint_error(&positions, pose),
            shape: self.bound.gauge.measure(&positions),
            negative_weights: self.weights.negative(),
            degenerate_faces: self.cotangents.degenerate(),
            held_still: self.bound.held.still.clone(),
        };
        self.last = Some(x);
        Ok(Deformation { positions, report })
    }
}

/// `Σ_ij w_ij |xᵢ − xⱼ|²`.
fn dirichlet(weights: &EdgeWeights, x: &[Lanes]) -> f64 {
    let part = |(i, j, w): (usize, usize, f64)| {
        let d = x[i] - x[j];
        w * d.dot(d)
    };
    weights.iter().map(part).sum()
}

/// A rotation between three.
fn mean(turns: [UnitQuaternion<f64>; 3]) -> UnitQuaternion<f64> {
    let first = turns[0].coords;
    let sum = turns.iter().fold(nalgebra::Vector4::zeros(), |sum, q| sum + q.coords * first.dot(&q.coords).signum());
    UnitQuaternion::new_normalize(Quaternion::from_vector(sum))
}
