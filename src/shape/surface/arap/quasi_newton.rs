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

use super::super::lanes::{LANES, Lanes};
use super::descent::Directions;
use super::elastic::Elastic;
use plumbline_num::run::{Run, Stopped};

/// Number of stored steps. Three need a third more iterations; eight save fewer iterations than their products cost.
const MEMORY: usize = 5;

/// Minimum cosine between a stored step and its gradient change; below it `1 / sᵀy` is dominated by rounding.
const MIN_CURVATURE: f64 = 1e-12;

/// One stored step `s = Δx`, the change of the gradient `y = Δg`, and `1 / sᵀy`, both in units of the longest coordinate of the step, which
/// changes no product with `H`, and in single precision, which halves what one reads.
#[derive(Debug, Default)]
struct Pair {
    s: Vec<Single>,
    y: Vec<Single>,
    rho: f64,
}

/// The coordinates of a vertex in single precision.
#[derive(Clone, Copy, Debug)]
struct Single([f32; LANES]);

impl From<Lanes> for Single {
    fn from(lanes: Lanes) -> Self {
        Self(lanes.0.map(|x| x as f32))
    }
}

impl From<Single> for Lanes {
    fn from(single: Single) -> Self {
        Self(single.0.map(f64::from))
    }
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
        pair.y.clear();
        let longest = p.iter().flat_map(|p| p.0).fold(0.0, |longest: f64, p| longest.max(p.abs()));
        let (of_step, of_change) = (Lanes::splat(1.0 / longest), Lanes::splat(1.0 / (t * longest)));
        let (mut sy, mut ss, mut yy) = (Lanes::ZERO, Lanes::ZERO, Lanes::ZERO);
        for ((&p, &next), &g) in p.iter().zip(next).zip(g) {
            let (stored_s, stored_y) = (Single::from(of_step * p), Single::from(of_change * (next - g)));
            let (s, y) = (Lanes::from(stored_s), Lanes::from(stored_y));
            sy += s * y;
            ss += s * s;
            yy += y * y;
            pair.s.push(stored_s);
            pair.y.push(stored_y);
        }
        let [sy, ss, yy] = [sy, ss, yy].map(|sum| sum.dot(Lanes::splat(1.0)));
        if sy > MIN_CURVATURE * (ss * yy).sqrt() {
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

fn dot(a: &[Single], b: &[Lanes]) -> f64 {
    let sum = a.iter().zip(b).fold(Lanes::ZERO, |sum, (&a, &b)| sum + Lanes::from(a) * b);
    sum.dot(Lanes::splat(1.0))
}

/// `a ← a + t b`.
fn add(a: &mut [Lanes], t: f64, b: &[Single]) {
    let t = Lanes::splat(t);
    a.iter_mut().zip(b).for_each(|(a, &b)| *a += t * Lanes::from(b));
}
