//! Alternates rotations and positions, each the minimizer for the other, so that the energy never increases. Convergence is
//! linear and slow: a thousand iterations where a surface bends.
//!
//! # Reference
//! O. Sorkine, M. Alexa, *As-rigid-as-possible surface modeling*, SGP 2007, section 3.

use super::super::Stop;
use super::super::lanes::Lanes;
use super::elastic::Elastic;
use plumbline_num::energy::Convergence;
use plumbline_num::run::{Run, Stopped};

/// Minimizes from `x`, with hard constraints at their targets; returns the energies of the initial guess and after each iteration.
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
    Ok((energies, Stop::IterationLimit))
}
