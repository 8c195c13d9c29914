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

use super::super::Stop;
use super::super::lanes::Lanes;
use super::elastic::{Elastic, add, dot};
use super::line_search::search;
use crate::energy::Convergence;

/// Steps that are remembered. Three need a third more iterations, eight save few and cost more per iteration than they save.
const MEMORY: usize = 5;

/// Minimizes from `x`, held vertices on their targets; returns the energies at the start and after each iteration.
pub(super) fn minimize(
    elastic: &mut Elastic,
    targets: &[Lanes],
    x: &mut [Lanes],
    convergence: &Convergence,
) -> (Vec<f64>, Stop) {
    let n = elastic.system.free().len();
    let (mut work, mut trial) = (vec![Lanes::ZERO; x.len()], x.to_vec());
    let (mut g, mut next, mut p) = (vec![Lanes::ZERO; n], vec![Lanes::ZERO; n], vec![Lanes::ZERO; n]);
    let mut memory = Memory::default();
    let mut before = elastic.slope(x, targets, &mut work, &mut g);
    let mut energies = vec![before];
    while energies.len() <= convergence.max_iterations {
        p.copy_from_slice(&g);
        memory.apply(&mut p, |v| elastic.system.solve_unknowns(v));
        p.iter_mut().for_each(|p| *p = -*p);
        let descent = -dot(&p, &g);
        let scratch = (&mut trial[..], &mut work[..], &mut next[..]);
        let step = search(elastic, targets, (x, &p), (before, descent), scratch);
        let Some(step) = step else {
            if memory.is_empty() {
                // Not even the plain step: all digits are used up. Rotations are fitted to where it stays.
                elastic.slope(x, targets, &mut work, &mut g);
                return (energies, Stop::Converged);
            }
            memory.forget();
            continue;
        };
        memory.learn(step.length, &p, &g, &next);
        x.copy_from_slice(&trial);
        std::mem::swap(&mut g, &mut next);
        before = step.energy;
        energies.push(before);
        if convergence.reached(&energies) {
            return (energies, Stop::Converged);
        }
    }
    (energies, Stop::IterationsUsedUp)
}

/// One remembered step `s = Δx`, the change of the gradient `y = Δg`, and `1 / sᵀy`.
#[derive(Debug, Default)]
struct Pair {
    s: Vec<Lanes>,
    y: Vec<Lanes>,
    rho: f64,
}

/// The inverse Hessian learnt from the last steps.
#[derive(Debug, Default)]
struct Memory {
    pairs: VecDeque<Pair>,
}

impl Memory {
    fn forget(&mut self) {
        self.pairs.clear();
    }

    fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Learns from a step `t p` that took the gradient from `g` to `next`, unless the energy is not convex along it.
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
