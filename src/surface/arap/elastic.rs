//! The energy, its slope and the global step: what the solvers share.

use nalgebra::Vector3;

use super::super::SurfaceError;
use super::super::held::Held;
use super::super::held_laplacian::HeldLaplacian;
use super::super::lanes::{self, Kernel, Lanes};
use super::cells::{CellKind, Cells};
use crate::mesh::operators::{Cotangents, EdgeWeights};

/// The elastic energy of a surface at rest with handles on it.
#[derive(Debug)]
pub(super) struct Elastic {
    pub(super) kind: CellKind,
    pub(super) cotangents: Cotangents,
    pub(super) weights: EdgeWeights,
    pub(super) cells: Cells,
    pub(super) system: HeldLaplacian,
    /// `Σ_c Σ_e h_e |e|²`: the part of the energy that does not depend on `x`.
    pub(super) at_rest: f64,
}

impl Elastic {
    pub(super) fn new(
        kind: CellKind,
        rest: &[Lanes],
        cotangents: Cotangents,
        held: &Held,
    ) -> Result<Self, SurfaceError> {
        let weights = EdgeWeights::cotangent(rest.len(), &cotangents);
        let system = HeldLaplacian::new(&weights, kind.laplacians(), held)?;
        let cells = Cells::new(kind, rest, &cotangents);
        let mut this = Self { kind, cotangents, weights, cells, system, at_rest: 0.0 };
        this.at_rest = this.add_laplacian(rest, &mut vec![Lanes::ZERO; rest.len()]);
        Ok(this)
    }

    /// Fits the rotations to `x` and writes the pull of the cells; returns the energy.
    pub(super) fn fit(&mut self, x: &[Lanes], targets: &[Lanes], b: &mut [Lanes]) -> f64 {
        let traces = self.cells.fit(x, b);
        let stretch = self.kind.laplacians() * dirichlet(&self.weights, x);
        stretch + self.at_rest - 2.0 * traces + self.system.soft_energy(x, targets)
    }

    /// Fits the rotations to `x` and writes half the gradient at the unknowns; returns the energy. `work` is scratch of one
    /// entry per vertex.
    pub(super) fn slope(&mut self, x: &[Lanes], targets: &[Lanes], work: &mut [Lanes], g: &mut [Lanes]) -> f64 {
        let traces = self.cells.fit(x, work);
        work.iter_mut().for_each(|b| *b = -*b);
        let stretch = self.add_laplacian(x, work);
        self.gather(work, g);
        self.system.add_soft(x, targets, g);
        stretch + self.at_rest - 2.0 * traces + self.system.soft_energy(x, targets)
    }

    /// Entries of the unknowns among those of the vertices.
    pub(super) fn gather(&self, from: &[Lanes], to: &mut [Lanes]) {
        to.iter_mut().zip(self.system.free()).for_each(|(to, &v)| *to = from[v as usize]);
    }

    /// `y ← x + t p`, `p` given at the unknowns.
    pub(super) fn moved(&self, x: &[Lanes], t: f64, p: &[Lanes], y: &mut [Lanes]) {
        let t = Lanes::splat(t);
        p.iter().zip(self.system.free()).for_each(|(&p, &v)| y[v as usize] = x[v as usize] + t * p);
    }

    /// Adds `q L x` to `y`; returns `q xᵀ L x`.
    pub(super) fn add_laplacian(&self, x: &[Lanes], y: &mut [Lanes]) -> f64 {
        lanes::run(AddLaplacian { weights: &self.weights, q: self.kind.laplacians(), x, y })
    }

    /// The energy as it is defined, edge by edge, for the rotations last fitted: exact where it is tiny.
    pub(super) fn defined(&self, rest: &[Lanes], x: &[Lanes]) -> f64 {
        let vector = |v: &[Lanes], i: u32, j: u32| Vector3::from((v[j as usize] - v[i as usize]).xyz());
        let mut energy = 0.0;
        for (t, edges) in self.cotangents.edges().enumerate() {
            let corners = self.cotangents.triangles()[t];
            for (i, j, h) in edges {
                let (now, rest) = (vector(x, i, j), vector(rest, i, j));
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

struct AddLaplacian<'a> {
    weights: &'a EdgeWeights,
    q: f64,
    x: &'a [Lanes],
    y: &'a mut [Lanes],
}

impl Kernel for AddLaplacian<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut sum = Lanes::ZERO;
        for (i, j, w) in self.weights.iter() {
            let d = self.x[i] - self.x[j];
            let pull = Lanes::splat(self.q * w) * d;
            sum += pull * d;
            self.y[i] += pull;
            self.y[j] -= pull;
        }
        sum.dot(Lanes::splat(1.0))
    }
}

/// `Σ_ij w_ij |xᵢ − xⱼ|²`.
fn dirichlet(weights: &EdgeWeights, x: &[Lanes]) -> f64 {
    let part = |(i, j, w): (usize, usize, f64)| {
        let d = x[i] - x[j];
        Lanes::splat(w) * d * d
    };
    weights.iter().map(part).fold(Lanes::ZERO, |sum, d| sum + d).dot(Lanes::splat(1.0))
}

/// `aᵀ b`, over all coordinates.
pub(super) fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let sum = a.iter().zip(b).fold(Lanes::ZERO, |sum, (&a, &b)| sum + a * b);
    sum.dot(Lanes::splat(1.0))
}

/// `a ← a + t b`.
pub(super) fn add(a: &mut [Lanes], t: f64, b: &[Lanes]) {
    let t = Lanes::splat(t);
    a.iter_mut().zip(b).for_each(|(a, &b)| *a += t * b);
}
