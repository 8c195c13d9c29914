//! Rotations and positions in turn: each the minimizer for the other, so that the energy never rises. It falls by a large
//! fraction at first and by ever smaller ones later: a thousand iterations where a surface bends.
//!
//! # Reference
//! O. Sorkine, M. Alexa, *As-rigid-as-possible surface modeling*, SGP 2007, section 3.

use super::super::Stop;
use super::super::lanes::Lanes;
use super::elastic::Elastic;
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Minimizes from `x`, held vertices on their targets; returns the energies at the start and after each iteration.
pub(super) fn minimize(
    elastic: &mut Elastic,
    targets: &[Lanes],
    x: &mut [Lanes],
    convergence: &Convergence,
    run: &Run,
) -> Result<(Vec<f64>, Stop), Stopped> {
    let pull = elastic.system.pull(x, targets);
    let mut b = vec![Lanes::ZERO; x.len()];
    let mut energies = vec![elastic.fit(x, targets, &mut b)];
    for k in 0..convergence.max_iterations {
        run.step(k as f64 / convergence.max_iterations as f64)?;
        elastic.system.solve(&b, &pull, x);
        energies.push(elastic.fit(x, targets, &mut b));
        if convergence.reached(&energies) {
            return Ok((energies, Stop::Converged));
        }
    }
    Ok((energies, Stop::IterationsUsedUp))
}
