//! Supernodal Cholesky factorization `P A Pᴴ = L Lᴴ`: analyzed once, refactored in place, solved for many right-hand sides.
//!
//! Positive definiteness is judged pivot by pivot against the diagonal it came from: elimination has cancelled all digits
//! of `aₖₖ` where `lₖₖ² ≤ τ aₖₖ`. The test is invariant under scaling of unknowns, so light and heavy weights may meet in
//! one system.

use std::sync::Arc;

use super::blocks::{self, Analysis};
use super::multifrontal::{Halt, Multifrontal};
use super::wide_registers::clear_upper_halves;
use super::{Ordering, Pattern, Permutation, Scalar, SparseError, SparseMatrix};
use crate::run::Run;

/// `lₖₖ²/aₖₖ` below which a pivot is nothing but rounding: some hundred roundings of `aₖₖ`. Larger refuses long chains
/// (a fourth-order chain of 10⁴ links reaches 10⁻¹²), smaller lets singular systems of some thousand unknowns pass.
const PIVOT_TOLERANCE: f64 = 1e-13;

/// A factorization whose structure is fixed and whose values may be replaced.
///
/// Until [`Self::factor`] has succeeded, and after it has failed, solutions are NaN.
pub struct Cholesky<T = f64> {
    analysis: Analysis,
    pattern: Arc<Pattern>,
    /// Entries of the permuted matrix.
    permuted: Vec<T>,
    /// Panels of the blocks one after another.
    factor: Vec<T>,
    plan: Multifrontal<T>,
    permuted_rhs: Vec<T>,
    /// One entry for each row below a block.
    below: Vec<T>,
}

/// Adjacent columns of the factor, stored densely.
#[derive(Clone, Copy)]
pub(super) struct Block<'a, T> {
    /// First column.
    pub(super) first: usize,
    /// Number of columns.
    pub(super) width: usize,
    /// Rows below the block's own, ascending.
    pub(super) rows: &'a [u32],
    /// Column by column: own rows, then those below.
    values: &'a [T],
}

impl<'a, T> Block<'a, T> {
    /// Values of its `c`-th column.
    pub(super) fn column(&self, c: usize) -> &'a [T] {
        let rows = self.width + self.rows.len();
        &self.values[c * rows..][..rows]
    }
}

impl<T> std::fmt::Debug for Cholesky<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cholesky")
            .field("n", &self.pattern.n())
            .field("stored", &self.factor.len())
            .finish_non_exhaustive()
    }
}

impl<T: Scalar> Cholesky<T> {
    /// Finds the structure of the factor and allocates all that refactoring and one right-hand side need.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`] where a given ordering has another size; [`SparseError::OutOfMemory`].
    pub fn analyze(pattern: &Arc<Pattern>, ordering: &Ordering) -> Result<Self, SparseError> {
        Self::analyze_within(pattern, ordering, f64::INFINITY)
    }

    /// [`Self::analyze`] of a system whose factorization takes at most `most` multiplications; a denser one is refused before its factor is
    /// allocated.
    ///
    /// # Errors
    /// Those of [`Self::analyze`]; [`SparseError::TooDense`].
    pub fn analyze_within(pattern: &Arc<Pattern>, ordering: &Ordering, most: f64) -> Result<Self, SparseError> {
        let analysis = Analysis::new(pattern, &ordering.permutation(pattern)?);
        let flops = analysis.flops();
        if flops > most {
            return Err(pattern.too_dense(flops, most));
        }
        let plan = Multifrontal::new(&analysis.blocks, &analysis.permuted);
        let nan = T::real(f64::NAN);
        let out_of_memory = |_| SparseError::out_of_memory(pattern.n());
        let mut factor = Vec::new();
        factor.try_reserve_exact(plan.stored()).map_err(out_of_memory)?;
        factor.resize(plan.stored(), nan);
        let below = analysis.blocks.iter().map(|block| block.rows.len()).max().unwrap_or(0);
        Ok(Self {
            factor,
            permuted: vec![T::default(); analysis.permuted.rows.len()],
            permuted_rhs: vec![nan; pattern.n()],
            below: vec![T::default(); below],
            pattern: Arc::clone(pattern),
            plan,
            analysis,
        })
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.pattern.n()
    }

    /// Stored entries of the factor, padding of supernodes included.
    pub fn stored(&self) -> usize {
        self.factor.len()
    }

    /// Non-zero entries of `L`, diagonal included, padding not.
    pub fn nnz(&self) -> usize {
        self.analysis.counts.iter().map(|&c| c as usize).sum()
    }

    /// Multiplications of the factorization, `Σⱼ cⱼ²` over the `cⱼ` entries of each column of `L`.
    pub fn flops(&self) -> f64 {
        self.analysis.flops()
    }

    /// The elimination order: given or found, up to exchanges that leave the factor alone.
    pub fn order(&self) -> &Permutation {
        &self.analysis.order
    }

    /// Factors `A`, which must have the analyzed pattern. Allocates nothing, but for a packing buffer of the kernels the first
    /// time on each thread.
    ///
    /// # Errors
    /// [`SparseError::NotFinite`], [`SparseError::Singular`], [`SparseError::NotPositiveDefinite`],
    /// [`SparseError::Interrupted`].
    pub fn factor(&mut self, a: &SparseMatrix<T>, run: &Run) -> Result<(), SparseError> {
        let result = self.try_factor(a, run);
        if result.is_err() {
            self.factor.fill(T::real(f64::NAN));
        }
        result
    }

    fn try_factor(&mut self, a: &SparseMatrix<T>, run: &Run) -> Result<(), SparseError> {
        assert!(
            Arc::ptr_eq(a.pattern(), &self.pattern) || *a.pattern() == self.pattern,
            "the matrix has another pattern than the one analyzed"
        );
        if let Some((row, col)) = a.first_non_finite() {
            return Err(SparseError::NotFinite { row, col });
        }
        self.refill(a.values());
        match self.eliminate(run) {
            Ok(()) => match self.first_vanished_pivot() {
                None => Ok(()),
                Some(k) => Err(SparseError::Singular { component: a.component_of(self.old(k)) }),
            },
            Err(Halt::Stopped(stopped)) => Err(stopped.into()),
            Err(Halt::Pivot(column)) => {
                let explained = self.explain(a, column, run);
                // A second elimination that was stopped explains nothing.
                run.check()?;
                Err(explained)
            }
        }
    }

    fn old(&self, k: usize) -> usize {
        self.order().old_from_new()[k.min(self.n() - 1)] as usize
    }

    fn refill(&mut self, values: &[T]) {
        for (to, (from, mirrored)) in self.permuted.iter_mut().zip(self.analysis.permuted.sources()) {
            *to = if mirrored { values[from].conjugate() } else { values[from] };
        }
    }

    fn eliminate(&mut self, run: &Run) -> Result<(), Halt> {
        let result = self.plan.factor(&self.permuted, &mut self.factor, run);
        clear_upper_halves();
        result
    }

    /// Diagonal entry of the permuted matrix.
    fn diagonal(&self, k: usize) -> f64 {
        self.permuted[self.analysis.permuted.starts[k]].re()
    }

    /// First column, in elimination order, whose pivot is rounding only.
    fn first_vanished_pivot(&self) -> Option<usize> {
        self.blocks().find_map(|block| {
            let sound = |k: usize| block.column(k)[k].norm_sqr() > PIVOT_TOLERANCE * self.diagonal(block.first + k);
            (0..block.width).find(|&k| !sound(k)).map(|k| block.first + k)
        })
    }

    /// A pivot was not positive: rounding of a zero, or truly negative? A shift far above rounding decides.
    fn explain(&mut self, a: &SparseMatrix<T>, failed: usize, run: &Run) -> SparseError {
        let component = a.component_of(self.old(failed));
        self.refill(a.values());
        let largest = (0..self.n()).map(|k| self.diagonal(k)).fold(0.0, f64::max);
        for k in 0..self.n() {
            let shifted = self.diagonal(k) * (1.0 + 1e-10) + largest * f64::MIN_POSITIVE;
            self.permuted[self.analysis.permuted.starts[k]] = T::real(shifted);
        }
        let negative_diagonal = (0..self.n()).any(|k| self.diagonal(k) < 0.0);
        let vanishing_row = (0..self.n()).any(|k| self.diagonal(k) <= largest * f64::MIN_POSITIVE);
        if !negative_diagonal && (vanishing_row || self.eliminate(run).is_ok()) {
            SparseError::Singular { component }
        } else {
            SparseError::NotPositiveDefinite { component }
        }
    }

    /// Replaces each column `b` of `rhs` (columns of `n` entries one after another) by `A⁻¹ b`.
    ///
    /// Allocates only when given more columns than ever before.
    pub fn solve_in_place(&mut self, rhs: &mut [T]) {
        let n = self.n();
        if n == 0 {
            return;
        }
        assert!(rhs.len().is_multiple_of(n), "{} values are not columns of {n}", rhs.len());
        self.reserve_columns(rhs.len() / n);
        let mut x = std::mem::take(&mut self.permuted_rhs);
        let mut below = std::mem::take(&mut self.below);
        let old = self.order().old_from_new();
        for (column, x) in rhs.chunks_exact(n).zip(x.chunks_exact_mut(n)) {
            x.iter_mut().zip(old).for_each(|(x, &old)| *x = column[old as usize]);
        }
        let columns = &mut x[..rhs.len()];
        for block in self.blocks() {
            columns.chunks_exact_mut(n).for_each(|x| forwards(&block, x, &mut below));
        }
        for block in self.blocks().rev() {
            columns.chunks_exact_mut(n).for_each(|x| backwards(&block, x, &mut below));
        }
        for (column, x) in rhs.chunks_exact_mut(n).zip(x.chunks_exact(n)) {
            x.iter().zip(old).for_each(|(&x, &old)| column[old as usize] = x);
        }
        (self.permuted_rhs, self.below) = (x, below);
    }

    /// Replaces each column `b` of `rhs` by `y = L⁻¹ P b`, in elimination order: `yᴴ y′ = bᴴ A⁻¹ b′` of any two, at less than half of
    /// what solving costs, since the blocks that a column does not reach are passed over.
    ///
    /// Allocates only when given more columns than ever before.
    pub fn half_solve_in_place(&mut self, rhs: &mut [T]) {
        let n = self.n();
        if n == 0 {
            return;
        }
        assert!(rhs.len().is_multiple_of(n), "{} values are not columns of {n}", rhs.len());
        self.reserve_columns(1);
        let mut x = std::mem::take(&mut self.permuted_rhs);
        let mut below = std::mem::take(&mut self.below);
        let old = self.order().old_from_new();
        for column in rhs.chunks_exact_mut(n) {
            let x = &mut x[..n];
            x.iter_mut().zip(old).for_each(|(x, &old)| *x = column[old as usize]);
            let reached = |block: &Block<'_, T>, x: &[T]| {
                x[block.first..block.first + block.width].iter().any(|x| *x != T::default())
            };
            for block in self.blocks() {
                if reached(&block, x) {
                    forwards(&block, x, &mut below);
                }
            }
            column.copy_from_slice(x);
        }
        (self.permuted_rhs, self.below) = (x, below);
    }

    /// Makes room for solves with this many right-hand sides at once.
    pub fn reserve_columns(&mut self, columns: usize) {
        let size = self.n() * columns;
        if size > self.permuted_rhs.len() {
            self.permuted_rhs.resize(size, T::default());
        }
    }

    /// Structure of the factor: parent and size of each column, in elimination order.
    pub(super) fn columns(&self) -> (&[u32], &[u32]) {
        (&self.analysis.parent, &self.analysis.counts)
    }

    /// Rows of column `j` of the permuted matrix, lower triangle.
    pub(super) fn permuted_rows(&self, j: usize) -> &[u32] {
        self.analysis.permuted.column(j)
    }

    /// The factor's blocks of columns, left to right.
    pub(super) fn blocks(&self) -> impl DoubleEndedIterator<Item = Block<'_, T>> {
        self.analysis.blocks.iter().enumerate().map(|(s, block)| {
            let blocks::Block { first, width, rows } = block;
            Block { first, width, rows, values: &self.factor[self.plan.panel(s)] }
        })
    }

    /// One step of iterative refinement: `x ← x + A⁻¹(b − A x)`; returns `‖b − A x‖` before the step, in units of `b`.
    ///
    /// `correction` is scratch of `n` entries.
    pub fn refine(&mut self, a: &SparseMatrix<T>, b: &[T], x: &mut [T], correction: &mut [T]) -> f64 {
        a.residual(x, b, correction);
        let norm = correction.iter().map(|r| r.norm_sqr()).sum::<f64>().sqrt();
        self.solve_in_place(correction);
        for (x, &d) in x.iter_mut().zip(correction.iter()) {
            *x += d;
        }
        norm
    }
}

/// `x_own ← T⁻¹ x_own`, and what the rows below take from it, for a block of triangle `T`.
fn forwards<T: Scalar>(block: &Block<'_, T>, x: &mut [T], below: &mut [T]) {
    let below = &mut below[..block.rows.len()];
    below.fill(T::default());
    let own = &mut x[block.first..block.first + block.width];
    for k in 0..block.width {
        let (triangle, rows) = block.column(k).split_at(block.width);
        let value = own[k].times(1.0 / triangle[k].re());
        own[k] = value;
        own[k + 1..].iter_mut().zip(&triangle[k + 1..]).for_each(|(x, &l)| *x = x.less::<false>(l, value));
        below.iter_mut().zip(rows).for_each(|(x, &l)| *x = x.less::<false>(l, value));
    }
    block.rows.iter().zip(below).for_each(|(&row, taken)| x[row as usize] += *taken);
}

/// What the rows below take from `x_own`, then `x_own ← T⁻ᴴ x_own`.
fn backwards<T: Scalar>(block: &Block<'_, T>, x: &mut [T], below: &mut [T]) {
    let below = &mut below[..block.rows.len()];
    below.iter_mut().zip(block.rows).for_each(|(to, &row)| *to = x[row as usize]);
    let own = &mut x[block.first..block.first + block.width];
    for k in (0..block.width).rev() {
        let (triangle, rows) = block.column(k).split_at(block.width);
        let inner = product(&triangle[k + 1..], &own[k + 1..]) + product(rows, below);
        own[k] = (own[k] - inner).times(1.0 / triangle[k].re());
    }
}

/// `lᴴ x`, in four sums so that they need not wait for each other.
fn product<T: Scalar>(l: &[T], x: &[T]) -> T {
    let mut sums = [T::default(); 4];
    let (l_tail, x_tail) = (l.chunks_exact(4).remainder(), x.chunks_exact(4).remainder());
    for (l, x) in l.chunks_exact(4).zip(x.chunks_exact(4)) {
        (0..4).for_each(|c| sums[c] += l[c].conjugate() * x[c]);
    }
    let tail = l_tail.iter().zip(x_tail).fold(T::default(), |sum, (&l, &x)| sum + l.conjugate() * x);
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + tail
}
