//! Accelerated local–global: a quasi-Newton method whose first guess of the Hessian is the matrix of the global step.
//!
//! ```text
//! ½ ∇E = g = A x − b(x),      p = −H g,      x ← x + t p
//! ```
//!
//! With `H = A⁻¹` and `t = 1` this is the local–global iteration itself: `A` bounds the Hessian from above, so the step is
//! safe and, in the directions in which the surface bends, far too short. `H` learns those from the last [`MEMORY`] steps
//! (limited-memory BFGS); a product with it costs one back-substitution, as a plain iteration does. Where no step along `p`
//! lowers the energy, what was learnt is forgotten and the plain step is taken, which always does.
//!
//! # Reference
//! T. Liu, S. Bouaziz, L. Kavan, *Quasi-Newton methods for real-time simulation of hyperelastic materials*, TOG 36 (2017);
//! J. Nocedal, *Updating quasi-Newton matrices with limited storage*, Mathematics of Computation 35 (1980).

use std::collections::VecDeque;

use super::super::lanes::Lanes;
use super::descent::Directions;
use super::elastic::{Elastic, add, dot};
use plumbline_num::run::{Run, Stopped};

/// Steps that are remembered. Three need a third more iterations, eight save few and cost more per iteration than they save.
const MEMORY: usize = 5;

/// One remembered step `s = Δx`, the change of the gradient `y = Δg`, and `1 / sᵀy`.
#[derive(Debug, Default)]
struct Pair {
    s: Vec<Lanes>,
    y: Vec<Lanes>,
    rho: f64,
}

/// The inverse Hessian learnt from the last steps.
#[derive(Debug, Default)]
pub(super) struct Memory {
    pairs: VecDeque<Pair>,
}

impl Directions for Memory {
    fn choose(&mut self, elastic: &mut Elastic, g: &[Lanes], p: &mut [Lanes], _run: &Run) -> Result<(), Stopped> {
        p.copy_from_slice(g);
        self.apply(p, |v| elastic.system.solve_unknowns(v));
        for p in p {
            *p = -*p;
        }
        Ok(())
    }

    /// Unless the energy is not convex along the step.
    fn learn(&mut self, t: f64, p: &[Lanes], g: &[Lanes], next: &[Lanes]) {
        let mut pair =
            if self.pairs.len() == MEMORY { self.pairs.pop_front().unwrap_or_default() } else { Pair::default() };
        pair.s.clear();
        pair.s.extend(p.iter().map(|&p| Lanes::splat(t) * p));
        pair.y.clear();
        pair.y.extend(next.iter().zip(g).map(|(&next, &g)| next - g));
        let sy = dot(&pair.s, &pair.y);
        if sy > 1e-12 * (dot(&pair.s, &pair.s) * dot(&pair.y, &pair.y)).sqrt() {
            pair.rho = 1.0 / sy;
            self.pairs.push_back(pair);
        }
    }

    /// Forgets: what is left is the plain step.
    fn give_way(&mut self) -> bool {
        let known = !self.pairs.is_empty();
        self.pairs.clear();
        known
    }
}

impl Memory {
    /// Replaces `g` by `H g`; `solve` replaces a vector by `A⁻¹` times it.
    fn apply(&self, g: &mut [Lanes], solve: impl FnOnce(&mut [Lanes])) {
        let mut alphas = Vec::with_capacity(MEMORY);
        for pair in self.pairs.iter().rev() {
            let alpha = pair.rho * dot(&pair.s, g);
            add(g, -alpha, &pair.y);
            alphas.push(alpha);
        }
        solve(g);
        for (pair, alpha) in self.pairs.iter().zip(alphas.into_iter().rev()) {
            let beta = pair.rho * dot(&pair.y, g);
            add(g, alpha - beta, &pair.s);
        }
    }
}
