//! Robust search (MSAC) among correspondences of equal weight.

use plumbline_num::optim::ransac::{Consensus, MsacOptions, Solution, msac};
use plumbline_num::run::{Run, Stopped};

/// The model that explains the correspondences of `problem` best; `initial`, if given, competes with the sampled models.
/// The samples depend on `seed` alone.
pub(super) fn robust_search<P: Consensus>(
    problem: &P,
    options: &MsacOptions,
    initial: Option<P::Model>,
    seed: u64,
    run: &Run,
) -> Result<Option<Solution<P::Model>>, Stopped> {
    msac(problem, &vec![1.0; problem.len()], options, initial, &mut fastrand::Rng::with_seed(seed), run)
}
