//! The ARAP energy, its slope and the global step, shared by the solvers.

#![allow(clippy::inline_always)] // A kernel is compiled for wide registers only as far as it is inlined.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::super::SurfaceError;
use super::super::bound::Bound;
use super::super::components::Unknowns;
use super::super::handle_laplacian::HandleLaplacian;
use super::super::lanes::{self, Kernel, Lanes};
use super::cells::{CellKind, Cells};
use super::smoothness::Smoothness;
use crate::mesh::operators::{Cotangents, EdgeWeights};
use plumbline_num::run::Run;

/// The elastic energy of a rest shape with handles.
#[derive(Debug)]
pub(in crate::surface) struct Elastic {
    pub(in crate::surface) kind: CellKind,
    pub(in crate::surface) cotangents: Cotangents,
    pub(in crate::surface) weights: EdgeWeights,
    pub(in crate::surface) cells: Cells,
    pub(in crate::surface) system: HandleLaplacian,
    /// Weight of the vertex cells in the energy; triangle cells have the remaining weight.
    bending: f64,
    /// `Σ_c Σ_e h_e |e|²`: the constant term of the energy.
    pub(in crate::surface) constant: f64,
    /// Coupling of the rotations, supported by the local/global iteration only.
    pub(in crate::surface) smoothness: Option<Smoothness>,
}

impl Elastic {
    pub(in crate::surface) fn new(
        kind: CellKind,
        rest: &[Lanes],
        cotangents: Cotangents,
        unknowns: &Unknowns,
        bending: f64,
        run: &Run,
    ) -> Result<Self, SurfaceError> {
        let weights = EdgeWeights::cotangent(rest.len(), &cotangents);
        let system = HandleLaplacian::new(&weights, kind.laplacians(), unknowns, run)?;
        let cells = Cells::new(kind, rest, &cotangents, bending);
        let mut this = Self { kind, cotangents, weights, cells, system, bending, constant: 0.0, smoothness: None };
        this.constant = this.add_laplacian(rest, &mut vec![Lanes::ZERO; rest.len()]);
        Ok(this)
    }

    /// Fits the rotations to `x` and writes the right-hand side of the cells; returns the energy.
    pub(in crate::surface) fn fit(&mut self, x: &[Lanes], targets: &[Lanes], b: &mut [Lanes]) -> f64 {
        let (traces, coupling) = match &self.smoothness {
            None => (self.cells.fit(x, b), 0.0),
            Some(smoothness) => {
                self.cells.fit_smoothly(smoothness, x, b);
                (dot(b, x), smoothness.energy(&self.cells.rotation_matrices(smoothness.len())))
            }
        };
        let stretch = self.kind.laplacians() * dirichlet(&self.weights, x);
        stretch + self.constant - 2.0 * traces + coupling + self.system.soft_energy(x, targets)
    }

    /// Fits the rotations to `x` and writes half the gradient at the unknowns; returns the energy. `work` is scratch of one
    /// entry per vertex.
    pub(in crate::surface) fn slope(
        &mut self,
        x: &[Lanes],
        targets: &[Lanes],
        work: &mut [Lanes],
        g: &mut [Lanes],
    ) -> f64 {
        let traces = self.cells.fit(x, work);
        for b in work.iter_mut() {
            *b = -*b;
        }
        let stretch = self.add_laplacian(x, work);
        self.gather(work, g);
        self.system.add_soft(x, targets, g);
        stretch + self.constant - 2.0 * traces + self.system.soft_energy(x, targets)
    }

    /// Copies the entries of the unknowns from those of the vertices.
    pub(in crate::surface) fn gather(&self, from: &[Lanes], to: &mut [Lanes]) {
        to.iter_mut().zip(self.system.free()).for_each(|(to, &v)| *to = from[v as usize]);
    }

    /// `y ← x + t p`, `p` given at the unknowns.
    pub(in crate::surface) fn moved(&self, x: &[Lanes], t: f64, p: &[Lanes], y: &mut [Lanes]) {
        let t = Lanes::splat(t);
        p.iter().zip(self.system.free()).for_each(|(&p, &v)| y[v as usize] = x[v as usize] + t * p);
    }

    /// Sets the rotations of the cells from those of the vertices.
    pub(in crate::surface) fn set_rotations(&mut self, rotations: &[UnitQuaternion<f64>]) {
        let vertices = if self.kind == CellKind::Elements { 0 } else { rotations.len() };
        rotations[..vertices].iter().enumerate().for_each(|(v, q)| self.cells.set_rotation(v, q));
        if self.kind == CellKind::Elements || self.bending < 1.0 {
            for (t, v) in self.cotangents.triangles().iter().enumerate() {
                self.cells.set_rotation(vertices + t, &mean(v.map(|v| rotations[v as usize])));
            }
        }
    }

    /// The global step: the minimizer for the current rotations.
    pub(in crate::surface) fn global_step(&mut self, bound: &Bound, targets: &[Lanes]) -> Vec<Lanes> {
        let mut x = vec![Lanes::ZERO; bound.rest.len()];
        bound.impose(targets, &mut x);
        let mut b = x.clone();
        self.cells.right_hand_side(&mut b);
        let pull = self.system.pull(&x, targets);
        self.system.solve(&b, &pull, &mut x);
        x
    }

    /// Adds `q L x` to `y`; returns `q xᵀ L x`.
    pub(in crate::surface) fn add_laplacian(&self, x: &[Lanes], y: &mut [Lanes]) -> f64 {
        lanes::run(AddLaplacian { weights: &self.weights, q: self.kind.laplacians(), x, y })
    }

    /// The energy summed edge by edge for the current rotations: without cancellation, hence exact where it is small.
    pub(in crate::surface) fn exact_energy(&self, rest: &[Lanes], x: &[Lanes]) -> f64 {
        let vector = |v: &[Lanes], i: u32, j: u32| Vector3::from((v[j as usize] - v[i as usize]).xyz());
        let coupling = |s: &Smoothness| s.energy(&self.cells.rotation_matrices(s.len()));
        let mut energy = self.smoothness.as_ref().map_or(0.0, coupling);
        let mixed = self.kind != CellKind::Elements && self.bending < 1.0;
        for (t, edges) in self.cotangents.edges().enumerate() {
            let corners = self.cotangents.triangles()[t];
            for (i, j, h) in edges {
                let (now, rest_edge) = (vector(x, i, j), vector(rest, i, j));
                let residual = |cell: usize| (now - self.cells.rotation(cell) * rest_edge).norm_squared();
                let own = match self.kind {
                    CellKind::Spokes => residual(i as usize) + residual(j as usize),
                    CellKind::SpokesAndRims => corners.iter().map(|&v| residual(v as usize)).sum::<f64>() / 3.0,
                    CellKind::Elements => residual(t),
                };
                let of_triangle = if mixed { self.kind.laplacians() * residual(rest.len() + t) } else { own };
                energy += h * (self.bending * own + (1.0 - self.bending) * of_triangle);
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
    let term = |(i, j, w): (usize, usize, f64)| {
        let d = x[i] - x[j];
        Lanes::splat(w) * d * d
    };
    weights.iter().map(term).fold(Lanes::ZERO, |sum, d| sum + d).dot(Lanes::splat(1.0))
}

/// `aᵀ b`, over all coordinates.
pub(in crate::surface) fn dot(a: &[Lanes], b: &[Lanes]) -> f64 {
    let sum = a.iter().zip(b).fold(Lanes::ZERO, |sum, (&a, &b)| sum + a * b);
    sum.dot(Lanes::splat(1.0))
}

/// `a ← a + t b`.
pub(in crate::surface) fn add(a: &mut [Lanes], t: f64, b: &[Lanes]) {
    let t = Lanes::splat(t);
    a.iter_mut().zip(b).for_each(|(a, &b)| *a += t * b);
}

/// The normalized mean of three quaternions.
fn mean(rotations: [UnitQuaternion<f64>; 3]) -> UnitQuaternion<f64> {
    let first = rotations[0].coords;
    let sum =
        rotations.iter().fold(nalgebra::Vector4::zeros(), |sum, q| sum + q.coords * first.dot(&q.coords).signum());
    UnitQuaternion::new_normalize(Quaternion::from_vector(sum))
}
