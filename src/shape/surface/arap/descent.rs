//! Steps along directions of descent, each as long as the energy allows: what quasi-Newton and Gauss–Newton share.

use super::super::Stop;
use super::super::lanes::Lanes;
use super::elastic::{Elastic, dot};
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// The decrease must be at least this fraction of what the slope promises (Armijo). Small, as usual: it only rules out steps
/// that gain nothing.
const ENOUGH: f64 = 1e-4;

/// Trials of one direction. The last is at most 1/1000 of the first where the energy curves hardest.
const TRIALS: usize = 6;

/// Where to go.
pub(super) trait Directions {
    /// Writes a direction of descent for the slope `g` (half the gradient at the unknowns) to `p`.
    fn choose(&mut self, elastic: &mut Elastic, g: &[Lanes], p: &mut [Lanes], run: &Run) -> Result<(), Stopped>;

    /// Hears of a step `t p` that took the slope from `g` to `next`.
    fn learn(&mut self, _t: f64, _p: &[Lanes], _g: &[Lanes], _next: &[Lanes]) {}

    /// Hears that no step along the last direction lowers the energy; says whether it knows another one.
    fn give_way(&mut self) -> bool {
        false
    }
}

/// Minimizes from `x`, held vertices on their targets; returns the energies at the start and after each iteration.
pub(super) fn descend(
    elastic: &mut Elastic,
    directions: &mut impl Directions,
    targets: &[Lanes],
    x: &mut [Lanes],
    convergence: &Convergence,
    run: &Run,
) -> Result<(Vec<f64>, Stop), Stopped> {
    let n = elastic.system.free().len();
    let (mut work, mut trial) = (vec![Lanes::ZERO; x.len()], x.to_vec());
    let (mut g, mut next, mut p) = (vec![Lanes::ZERO; n], vec![Lanes::ZERO; n], vec![Lanes::ZERO; n]);
    let mut energies = vec![elastic.slope(x, targets, &mut work, &mut g)];
    while energies.len() <= convergence.max_iterations {
        run.step((energies.len() - 1) as f64 / convergence.max_iterations as f64)?;
        directions.choose(elastic, &g, &mut p, run)?;
        let before = energies[energies.len() - 1];
        let descent = -dot(&p, &g);
        let scratch = (&mut trial[..], &mut work[..], &mut next[..]);
        let Some((t, energy)) = search(elastic, targets, (x, &p), (before, descent), scratch) else {
            if directions.give_way() {
                continue;
            }
            // All digits are used up. Rotations are fitted to where it stays.
            elastic.slope(x, targets, &mut work, &mut g);
            return Ok((energies, Stop::Converged));
        };
        directions.learn(t, &p, &g, &next);
        x.copy_from_slice(&trial);
        std::mem::swap(&mut g, &mut next);
        energies.push(energy);
        if convergence.reached(&energies) {
            return Ok((energies, Stop::Converged));
        }
    }
    Ok((energies, Stop::IterationsUsedUp))
}

/// Tries `trial = x + t p` for `t` = 1 and then for minimizers of parabolas, until the energy has fallen enough below
/// `before`; `descent = −gᵀp > 0`. Returns `t` and the energy, and leaves the slope there in `g`. None where no trial did.
fn search(
    elastic: &mut Elastic,
    targets: &[Lanes],
    (x, p): (&[Lanes], &[Lanes]),
    (before, descent): (f64, f64),
    (trial, work, g): (&mut [Lanes], &mut [Lanes], &mut [Lanes]),
) -> Option<(f64, f64)> {
    let mut t = 1.0;
    for _ in 0..TRIALS {
        elastic.moved(x, t, p, trial);
        let energy = elastic.slope(trial, targets, work, g);
        // The gradient is 2 g.
        if energy <= before - 2.0 * ENOUGH * t * descent {
            return Some((t, energy));
        }
        let parabola = descent * t * t / (energy - before + 2.0 * descent * t);
        t = if parabola.is_finite() { parabola.clamp(0.1 * t, 0.5 * t) } else { 0.1 * t };
    }
    None
}
