//! A step along a direction of descent, as long as the energy allows.

use super::super::lanes::Lanes;
use super::elastic::Elastic;

/// The decrease must be at least this fraction of what the slope promises (Armijo). Small, as usual: it only rules out steps
/// that gain nothing.
const ENOUGH: f64 = 1e-4;

/// Trials of one direction. The last is at most 1/1000 of the first where the energy curves hardest.
const TRIALS: usize = 6;

/// Where a step led.
#[derive(Debug)]
pub(super) struct Step {
    /// Length of the step over that of the direction.
    pub(super) length: f64,
    pub(super) energy: f64,
}

/// Tries `trial = x + t p` for `t` = 1 and then for minimizers of parabolas, until the energy has fallen enough below
/// `before`; `descent = −gᵀp > 0`. Leaves half the gradient there in `g`. None where no trial did.
pub(super) fn search(
    elastic: &mut Elastic,
    targets: &[Lanes],
    (x, p): (&[Lanes], &[Lanes]),
    (before, descent): (f64, f64),
    (trial, work, g): (&mut [Lanes], &mut [Lanes], &mut [Lanes]),
) -> Option<Step> {
    let mut t = 1.0;
    for _ in 0..TRIALS {
        elastic.moved(x, t, p, trial);
        let energy = elastic.slope(trial, targets, work, g);
        // The gradient is 2 g.
        if energy <= before - 2.0 * ENOUGH * t * descent {
            return Some(Step { length: t, energy });
        }
        let parabola = descent * t * t / (energy - before + 2.0 * descent * t);
        t = if parabola.is_finite() { parabola.clamp(0.1 * t, 0.5 * t) } else { 0.1 * t };
    }
    None
}
