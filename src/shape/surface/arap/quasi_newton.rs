//! Accelerated local/global iteration: L-BFGS with the matrix of the global step as initial Hessian.
//!
//! ```text
//! ½ ∇E = g = A x − b(x),      p = −H g,      x ← x + t p
//! ```
//!
//! With `H = A⁻¹` and `t = 1` this is the local/global iteration itself: `A` bounds the Hessian from above, so the step is safe
//! but far too short in bending directions. `H` is updated from the last [`MEMORY`] steps; a product with it costs one
//! back-substitution, as a plain iteration does. Where no step along `p` decreases the energy, the memory is cleared and the
//! plain step taken, which always decreases it.
//!
//! # Reference
//! T. Liu, S. Bouaziz, L. Kavan, *Quasi-Newton methods for real-time simulation of hyperelastic materials*, TOG 36 (2017);
//! J. Nocedal, *Updating quasi-Newton matrices with limited storage*, Mathematics of Computation 35 (1980).

use std::collections::VecDeque;

use super::super::lanes::Lanes;
use super::descent::Directions;
use super::elastic::{Elastic, add, dot};
use plumbline_num::run::{Run, Stopped};

/// Number of stored steps. Three need a third more iterations; eight save fewer iterations than their products cost.
const MEMORY: usize = 5;

/// Minimum cosine between a stored step and its gradient change; below it `1 / sᵀy` is dominated by rounding.
const MIN_CURVATURE: f64 = 1e-12;

/// One stored step `s = Δx`, the change of the gradient `y = Δg`, and `1 / sᵀy`.
#[derive(Debug, Default)]
struct Pair {
    s: Vec<Lanes>,
    y: Vec<Lanes>,
    rho: f64,
}

/// The limited-memory approximation of the inverse Hessian.
#[derive(Debug, Default)]
pub(super) struct Lbfgs {
    pairs: VecDeque<Pair>,
}

impl Directions for Lbfgs {
    fn direction(&mut self, elastic: &mut Elastic, g: &[Lanes], p: &mut [Lanes], _run: &Run) -> Result<(), Stopped> {
        p.copy_from_slice(g);
        self.apply(p, |v| elastic.system.solve_unknowns(v));
        for p in p {
            *p = -*p;
        }
        Ok(())
    }

    /// Stores the step, unless the energy is not convex along it.
    fn update(&mut self, t: f64, p: &[Lanes], g: &[Lanes], next: &[Lanes]) {
        let mut pair =
            if self.pairs.len() == MEMORY { self.pairs.pop_front().unwrap_or_default() } else { Pair::default() };
        pair.s.clear();
        pair.s.extend(p.iter().map(|&p| Lanes::splat(t) * p));
        pair.y.clear();
        pair.y.extend(next.iter().zip(g).map(|(&next, &g)| next - g));
        let sy = dot(&pair.s, &pair.y);
        if sy > MIN_CURVATURE * (dot(&pair.s, &pair.s) * dot(&pair.y, &pair.y)).sqrt() {
            pair.rho = 1.0 / sy;
            self.pairs.push_back(pair);
        }
    }

    /// Clears the memory: the next direction is the plain step.
    fn restart(&mut self) -> bool {
        let had_pairs = !self.pairs.is_empty();
        self.pairs.clear();
        had_pairs
    }
}

impl Lbfgs {
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
