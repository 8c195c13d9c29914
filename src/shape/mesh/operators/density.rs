//! Which systems of a surface are too dense to be formed and factored.
//!
//! On a surface each unknown depends on a few neighbors, and a good elimination order has a factor of the order of `n log n` entries that
//! takes of the order of `n^1.5` multiplications. Where thousands of triangles meet at one vertex, every two vertices around it depend on one
//! another in what sums over cells or squares a Laplacian; triangles between vertices at random leave no small separator. Then time is that of a
//! dense matrix, and memory gigabytes. Such systems are refused, by what is known before each step takes its memory.

use plumbline_num::energy::{ConstrainedLaplacian, FactoredLaplacian};
use plumbline_num::run::Run;
use plumbline_num::sparse::{Ordering, SparseError};

/// Multiplications of a factorization that any surface may take: some seconds, and 300 MB in a dense factor of 3900 unknowns.
const MIN_MULTIPLICATIONS: f64 = 2e10;
/// Multiplications per `n^1.5`, the growth of nested dissection on surfaces: they take about 150 in a Laplacian, and less than 4000 in a
/// squared one. Lattices in space grow by `n²`: 10⁵ unknowns are within the bound.
const MULTIPLICATIONS_PER_GROWTH: f64 = 2e4;
/// Entries of the lower triangle that any surface may have: 400 MB while they are collected.
const MIN_ENTRIES: usize = 10_000_000;
/// Entries per unknown: squared Laplacians of regular meshes have 10, and forms over their cells, of 3 × 3 blocks, 30.
const ENTRIES_PER_UNKNOWN: usize = 200;

/// Largest number of multiplications of a factorization of `n` unknowns.
pub(crate) fn max_multiplications(n: usize) -> f64 {
    MIN_MULTIPLICATIONS + MULTIPLICATIONS_PER_GROWTH * (n as f64).powf(1.5)
}

/// The factor of a Laplacian of a surface.
///
/// # Errors
/// Those of [`ConstrainedLaplacian::factor_within`]; the bound is [`max_multiplications`].
pub(crate) fn factored_laplacian(
    laplacian: ConstrainedLaplacian,
    ordering: &Ordering,
    run: &Run,
) -> Result<FactoredLaplacian, SparseError> {
    let most = max_multiplications(laplacian.matrix().n());
    laplacian.factor_within(ordering, most, run)
}

/// A matrix of `n` unknowns before it is formed: the vertex of the most neighbors, and in how many unknowns a vertex has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Forming {
    pub(crate) unknowns: usize,
    pub(crate) per_vertex: usize,
    pub(crate) vertex: usize,
    pub(crate) neighbors: usize,
}

impl Forming {
    /// By the vertex alone: it and its neighbors make a dense part of `k` unknowns, whose elimination takes `k³/3` multiplications in
    /// whichever order.
    pub(crate) fn check_clique(&self) -> Result<(), SparseError> {
        let flops = (self.per_vertex as f64 * (self.neighbors as f64 + 1.0)).powi(3) / 3.0;
        if flops <= max_multiplications(self.unknowns) { Ok(()) } else { Err(self.refused(flops)) }
    }

    /// By the entries of the lower triangle, as far as they are counted.
    pub(crate) fn check_entries(&self, entries: usize) -> Result<(), SparseError> {
        if entries <= MIN_ENTRIES.saturating_add(ENTRIES_PER_UNKNOWN.saturating_mul(self.unknowns)) {
            return Ok(());
        }
        // Of columns with so many entries in all the sum of squares is no smaller.
        Err(self.refused((entries as f64).powi(2) / self.unknowns as f64))
    }

    fn refused(&self, flops: f64) -> SparseError {
        let most = max_multiplications(self.unknowns);
        let Self { vertex: unknown, neighbors, .. } = *self;
        SparseError::TooDense { flops: flops.max(most), most, unknown, neighbors }
    }
}
