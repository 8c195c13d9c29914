//! Descent with a line search, for quasi-Newton and Gauss–Newton directions.

use super::super::Stop;
use super::super::lanes::Lanes;
use super::elastic::{Elastic, dot};
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Sufficient decrease as a fraction of that predicted by the slope (Armijo). Small, as usual: it only rejects steps without
/// gain.
const ARMIJO: f64 = 1e-4;

/// Maximum trial steps of one direction. Each is 0.1 to 0.5 of the previous one, so that the last is 10⁻⁵ to 0.03 of the first.
const MAX_TRIALS: usize = 6;

/// Search directions.
pub(super) trait Directions {
    /// Writes a descent direction for the slope `g` (half the gradient at the unknowns) to `p`.
    fn direction(&mut self, elastic: &mut Elastic, g: &[Lanes], p: &mut [Lanes], run: &Run) -> Result<(), Stopped>;

    /// Called after a step `t p` that changed the slope from `g` to `next`.
    fn update(&mut self, _t: f64, _p: &[Lanes], _g: &[Lanes], _next: &[Lanes]) {}

    /// Called when no step along the last direction decreases the energy; true if there is another direction.
    fn restart(&mut self) -> bool {
        false
    }
}

/// Minimizes from `x`, with hard constraints at their targets; returns the energies of the initial guess and after each iteration.
/// With `partial` a run that ends after an iteration ends the minimization there, as the iteration limit does.
pub(super) fn descend(
    elastic: &mut Elastic,
    directions: &mut impl Directions,
    targets: &[Lanes],
    x: &mut [Lanes],
    (convergence, partial): (&Convergence, bool),
    run: &Run,
) -> Result<(Vec<f64>, Stop), Stopped> {
    let n = elastic.system.free().len();
    let (mut work, mut trial) = (vec![Lanes::ZERO; x.len()], x.to_vec());
    let (mut g, mut next, mut p) = (vec![Lanes::ZERO; n], vec![Lanes::ZERO; n], vec![Lanes::ZERO; n]);
    let mut energies = vec![elastic.slope(x, targets, &mut work, &mut g)];
    while energies.len() <= convergence.max_iterations {
        match run.step((energies.len() - 1) as f64 / convergence.max_iterations as f64) {
            Err(_) if partial && energies.len() > 1 => return Ok((energies, Stop::IterationLimit)),
            ended => ended?,
        }
        directions.direction(elastic, &g, &mut p, run)?;
        let before = energies[energies.len() - 1];
        let descent = -dot(&p, &g);
        let scratch = (&mut trial[..], &mut work[..], &mut next[..]);
        let Some((t, energy)) = search(elastic, targets, (x, &p), (before, descent), scratch) else {
            if directions.restart() {
                continue;
            }
            // The decrease is below rounding. Fit the rotations to the current positions.
            elastic.slope(x, targets, &mut work, &mut g);
            return Ok((energies, Stop::Converged));
        };
        directions.update(t, &p, &g, &next);
        x.copy_from_slice(&trial);
        std::mem::swap(&mut g, &mut next);
        energies.push(energy);
        if convergence.reached(&energies) {
            return Ok((energies, Stop::Converged));
        }
    }
    Ok((energies, Stop::IterationLimit))
}

/// Tries `trial = x + t p` for `t` = 1 and then for minimizers of parabolas, until the energy has decreased
/// sufficiently from `before`; `descent = −gᵀp > 0`. Returns `t` and the energy, with the slope in `g`; `None` if no trial did.
fn search(
    elastic: &mut Elastic,
    targets: &[Lanes],
    (x, p): (&[Lanes], &[Lanes]),
    (before, descent): (f64, f64),
    (trial, work, g): (&mut [Lanes], &mut [Lanes], &mut [Lanes]),
) -> Option<(f64, f64)> {
    let mut t = 1.0;
    for _ in 0..MAX_TRIALS {
        elastic.moved(x, t, p, trial);
        let energy = elastic.slope(trial, targets, work, g);
        // The gradient is 2 g.
        if energy <= before - 2.0 * ARMIJO * t * descent {
            return Some((t, energy));
        }
        let parabola = descent * t * t / (energy - before + 2.0 * descent * t);
        t = if parabola.is_finite() { parabola.clamp(0.1 * t, 0.5 * t) } else { 0.1 * t };
    }
    None
}
