//! Gauss–Newton on positions and rotations together.
//!
//! With rotations `R exp[ω]ₓ` the residuals `e' − R e` are linear in the steps `(p, ω)`. Each cell's `ω` is eliminated, which
//! leaves a positive semidefinite system for the positions alone:
//!
//! ```text
//! min over p, ω   Σ_c Σ_e h |e' + e_p − R_c(e + ω_c × e)|²
//! (A − Bᵀ C⁻¹ B) p = −g,      C_c = Σ h (|e|² I − e eᵀ),      (B p)_c = Σ c_ij × Rᵀ(pⱼ − pᵢ)
//! ```
//!
//! It couples the coordinates, so that a factorization would cost some thirty times that of `A` and be used once. Conjugate
//! gradients preconditioned by the existing factor of `A` solve it inexactly; the slow modes of the local/global iteration
//! are the few small eigenvalues, which conjugate gradients resolve first. Rotations are fitted again at every trial step, and
//! a line search keeps the energy decreasing.
//!
//! # Reference
//! Q. Huang, M. Wicke, B. Adams, L. Guibas, *Shape decomposition using modal analysis*, Eurographics 2009, section 3, for
//! the elimination (whose `C` is misprinted there as `Σ e eᵀ`); S. C. Eisenstat, H. F. Walker, *Choosing the forcing terms in
//! an inexact Newton method*, SIAM J. Sci. Comput. 17 (1996).

use super::super::lanes::Lanes;
use super::cells::Inertia;
use super::descent::Directions;
use super::elastic::{Elastic, add, dot};
use plumbline_num::run::{Run, Stopped};

/// Initial forcing term: the residual of the linear system relative to its right-hand side. Smaller values waste work on a
/// linearization that is still inaccurate; larger ones fall back to local/global steps.
const FORCING: f64 = 0.3;

/// Maximum conjugate gradient iterations per linearization: by then the slow modes are resolved.
const MAX_CG_ITERATIONS: usize = 40;

/// Preconditioned conjugate gradients on the eliminated system.
#[derive(Debug)]
pub(super) struct Linearized<'a> {
    inertia: &'a [Inertia],
    /// The current solution.
    p: Vec<Lanes>,
    /// Residual, preconditioned residual, direction, its product.
    r: Vec<Lanes>,
    z: Vec<Lanes>,
    d: Vec<Lanes>,
    hd: Vec<Lanes>,
    /// Direction and product at all vertices; the direction vanishes at the fixed ones.
    d_all: Vec<Lanes>,
    hd_all: Vec<Lanes>,
    rz: f64,
    /// `rz` of the first linearization.
    first: Option<f64>,
}

impl Directions for Linearized<'_> {
    fn direction(&mut self, elastic: &mut Elastic, g: &[Lanes], p: &mut [Lanes], run: &Run) -> Result<(), Stopped> {
        self.reset(elastic, g);
        let first = *self.first.get_or_insert(self.rz);
        self.solve(elastic, FORCING.min((self.rz / first).powf(0.25)), run)?;
        p.copy_from_slice(&self.p);
        Ok(())
    }
}

impl<'a> Linearized<'a> {
    pub(super) fn new(inertia: &'a [Inertia], unknowns: usize, vertices: usize) -> Self {
        let zero = |n: usize| vec![Lanes::ZERO; n];
        let [p, r, z, d, hd] = [(); 5].map(|()| zero(unknowns));
        Self { inertia, p, r, z, d, hd, d_all: zero(vertices), hd_all: zero(vertices), rz: 0.0, first: None }
    }

    /// Initializes at `p = 0`.
    fn reset(&mut self, elastic: &mut Elastic, g: &[Lanes]) {
        self.p.fill(Lanes::ZERO);
        self.r.iter_mut().zip(g).for_each(|(r, &g)| *r = -g);
        self.z.copy_from_slice(&self.r);
        elastic.system.solve_unknowns(&mut self.z);
        self.d.copy_from_slice(&self.z);
        self.rz = dot(&self.r, &self.z);
    }

    /// Iterates until the residual has decreased by `forcing`, in the norm of `A⁻¹`. The first step is always taken, so that `p`
    /// is a descent direction: at worst that of the local/global step.
    fn solve(&mut self, elastic: &mut Elastic, forcing: f64, run: &Run) -> Result<(), Stopped> {
        let goal = self.rz * forcing * forcing;
        for k in 0..MAX_CG_ITERATIONS {
            run.check()?;
            self.multiply(elastic);
            let curvature = dot(&self.d, &self.hd);
            if !(curvature > 0.0) {
                if k == 0 {
                    self.p.copy_from_slice(&self.z);
                }
                return Ok(());
            }
            let t = self.rz / curvature;
            add(&mut self.p, t, &self.d);
            add(&mut self.r, -t, &self.hd);
            self.z.copy_from_slice(&self.r);
            elastic.system.solve_unknowns(&mut self.z);
            let rz = dot(&self.r, &self.z);
            if !(rz > goal) {
                return Ok(());
            }
            let beta = Lanes::splat(rz / self.rz);
            self.d.iter_mut().zip(&self.z).for_each(|(d, &z)| *d = z + beta * *d);
            self.rz = rz;
        }
        Ok(())
    }

    /// `hd = (A − Bᵀ C⁻¹ B) d`.
    fn multiply(&mut self, elastic: &Elastic) {
        for (&d, &v) in self.d.iter().zip(elastic.system.free()) {
            self.d_all[v as usize] = d;
        }
        self.hd_all.fill(Lanes::ZERO);
        elastic.add_laplacian(&self.d_all, &mut self.hd_all);
        elastic.cells.subtract_rotation_term(self.inertia, &self.d_all, &mut self.hd_all);
        elastic.gather(&self.hd_all, &mut self.hd);
        elastic.system.add_soft_product(&self.d, &mut self.hd);
    }
}
