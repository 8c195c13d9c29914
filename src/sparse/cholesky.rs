//! Supernodal Cholesky factorization `P A Pᴴ = L Lᴴ`: analyzed once, refactored in place, solved for many right-hand sides.
//!
//! Positive definiteness is judged pivot by pivot against the diagonal it came from: elimination has cancelled all digits
//! of `aₖₖ` where `lₖₖ² ≤ τ aₖₖ`. The test is invariant under scaling of unknowns, so light and heavy weights may meet in
//! one system.

use std::sync::Arc;

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::{SupernodalThreshold, SymbolicSupernodalParams};
use faer::sparse::{SparseColMat, SymbolicSparseColMat};
use faer::{Conj, MatMut, MatRef, Par, Side};

use super::etree::Elimination;
use super::multifrontal::Multifrontal;
use super::wide_registers::clear_upper_halves;
use super::{Ordering, Pattern, Permutation, Scalar, SparseError, SparseMatrix};

/// `lₖₖ²/aₖₖ` below which a pivot is nothing but rounding: some hundred roundings of `aₖₖ`. Larger refuses long chains
/// (a fourth-order chain of 10⁴ links reaches 10⁻¹²), smaller lets singular systems of some thousand unknowns pass.
const PIVOT_TOLERANCE: f64 = 1e-13;

/// Marks a slot whose entry comes from the other triangle.
const MIRRORED: u32 = 1 << 31;

/// A factorization whose structure is fixed and whose values may be replaced.
///
/// Until [`Self::factor`] has succeeded, and after it has failed, solutions are NaN.
pub struct Cholesky<T = f64> {
    order: Permutation,
    /// Elimination tree, in the permuted numbering.
    parent: Vec<u32>,
    /// Entries of each column of `L`, without padding.
    counts: Vec<u32>,
    pattern: Arc<Pattern>,
    /// For each slot of the permuted matrix, the slot of `A` it is read from, perhaps [`MIRRORED`].
    source: Vec<u32>,
    permuted: SparseColMat<u32, T>,
    symbolic: SymbolicCholesky<u32>,
    factor: Vec<T>,
    /// The plan of the factorization of real matrices.
    multifrontal: Option<Multifrontal>,
    memory: MemBuffer,
    permuted_rhs: Vec<T>,
    columns_ready: usize,
}

/// Adjacent columns of the factor, stored densely.
pub(super) struct Block<'a, T> {
    /// First column.
    pub(super) first: usize,
    /// Rows below the block's own, ascending.
    pub(super) rows: &'a [u32],
    /// Own rows, then those below, × own columns.
    pub(super) values: MatRef<'a, T>,
}

impl<T> std::fmt::Debug for Cholesky<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cholesky")
            .field("n", &self.order.len())
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
        let n = pattern.n();
        let out_of_memory = || SparseError::OutOfMemory { unknowns: n };
        let elimination = Elimination::postordered(pattern, &ordering.permutation(pattern)?);
        let (permuted, source) = permute(pattern, &elimination.order);
        let counts = elimination.column_counts(|j| permuted.row_idx_of_col_raw(j).iter().copied());
        let params = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            supernodal_params: SymbolicSupernodalParams::default(),
            ..Default::default()
        };
        // Without a permutation faer's analysis reads the upper triangle, whatever side it is told.
        let upper = transpose(&permuted);
        let symbolic = factorize_symbolic_cholesky(upper.as_ref(), Side::Upper, SymmetricOrdering::Identity, params)
            .map_err(|_| out_of_memory())?;
        let multifrontal = T::reals(&[]).is_some().then(|| plan(&symbolic, &permuted));
        let numeric = numeric_scratch::<T>(&symbolic, multifrontal.as_ref());
        let solve = symbolic.solve_in_place_scratch::<T>(1, Par::Seq);
        let memory = MemBuffer::try_new(StackReq::any_of(&[numeric, solve])).map_err(|_| out_of_memory())?;
        let nan = T::real(f64::NAN);
        Ok(Self {
            factor: vec![nan; symbolic.len_val()],
            permuted: SparseColMat::new(permuted, vec![T::default(); source.len()]),
            permuted_rhs: vec![nan; n],
            columns_ready: 1,
            pattern: Arc::clone(pattern),
            parent: elimination.parent,
            order: elimination.order,
            counts,
            source,
            symbolic,
            multifrontal,
            memory,
        })
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.order.len()
    }

    /// Stored entries of the factor, padding of supernodes included.
    pub fn stored(&self) -> usize {
        self.factor.len()
    }

    /// Non-zero entries of `L`, diagonal included, padding not.
    pub fn nnz(&self) -> usize {
        self.counts.iter().map(|&c| c as usize).sum()
    }

    /// Multiplications of the factorization, `Σⱼ cⱼ²` over the `cⱼ` entries of each column of `L`.
    pub fn flops(&self) -> f64 {
        self.counts.iter().map(|&c| f64::from(c) * f64::from(c)).sum()
    }

    /// The elimination order: given or found, then postordered.
    pub fn order(&self) -> &Permutation {
        &self.order
    }

    /// Factors `A`, which must have the analyzed pattern. Allocates nothing, but for a packing buffer of the kernels the first
    /// time on each thread.
    ///
    /// # Errors
    /// [`SparseError::NotFinite`], [`SparseError::Singular`], [`SparseError::NotPositiveDefinite`].
    pub fn factor(&mut self, a: &SparseMatrix<T>) -> Result<(), SparseError> {
        let result = self.try_factor(a);
        if result.is_err() {
            self.factor.fill(T::real(f64::NAN));
        }
        result
    }

    fn try_factor(&mut self, a: &SparseMatrix<T>) -> Result<(), SparseError> {
        assert!(
            Arc::ptr_eq(a.pattern(), &self.pattern) || *a.pattern() == self.pattern,
            "the matrix has another pattern than the one analyzed"
        );
        if let Some((row, col)) = a.first_non_finite() {
            return Err(SparseError::NotFinite { row, col });
        }
        self.refill(a.values());
        match self.eliminate() {
            Ok(()) => match self.first_vanished_pivot() {
                None => Ok(()),
                Some(k) => Err(SparseError::Singular { component: a.component_of(self.old(k)) }),
            },
            Err(LltError::NonPositivePivot { index }) => Err(self.explain(a, index)),
        }
    }

    fn old(&self, k: usize) -> usize {
        self.order.old_from_new()[k.min(self.n() - 1)] as usize
    }

    fn refill(&mut self, values: &[T]) {
        for (to, &from) in self.permuted.val_mut().iter_mut().zip(&self.source) {
            let v = values[(from & !MIRRORED) as usize];
            *to = if from & MIRRORED == 0 { v } else { v.conjugate() };
        }
    }

    fn eliminate(&mut self) -> Result<(), LltError> {
        let memory = MemStack::new(&mut self.memory);
        if let (Some(plan), Some(a), Some(l)) =
            (&mut self.multifrontal, T::reals(self.permuted.val()), T::reals_mut(&mut self.factor))
        {
            let result = plan.factor(a, l, memory);
            clear_upper_halves();
            return result;
        }
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                self.permuted.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                memory,
                faer::Spec::default(),
            )
            .map(|_| ())
    }

    /// Diagonal entry of the permuted matrix.
    fn diagonal(&self, k: usize) -> f64 {
        self.permuted.val()[self.permuted.col_ptr()[k] as usize].re()
    }

    /// First column, in elimination order, whose pivot is rounding only.
    fn first_vanished_pivot(&self) -> Option<usize> {
        self.blocks().find_map(|block| {
            let sound = |k: usize| block.values[(k, k)].norm_sqr() > PIVOT_TOLERANCE * self.diagonal(block.first + k);
            (0..block.values.ncols()).find(|&k| !sound(k)).map(|k| block.first + k)
        })
    }

    /// A pivot was not positive: rounding of a zero, or truly negative? A shift far above rounding tells.
    fn explain(&mut self, a: &SparseMatrix<T>, failed: usize) -> SparseError {
        let component = a.component_of(self.old(failed));
        self.refill(a.values());
        let starts: Vec<usize> = self.permuted.col_ptr()[..self.n()].iter().map(|&s| s as usize).collect();
        let largest = starts.iter().map(|&s| self.permuted.val()[s].re()).fold(0.0, f64::max);
        for s in starts {
            let d = self.permuted.val()[s];
            self.permuted.val_mut()[s] = T::real(d.re() * (1.0 + 1e-10) + largest * f64::MIN_POSITIVE);
        }
        let negative_diagonal = (0..self.n()).any(|k| self.diagonal(k) < 0.0);
        let vanishing_row = (0..self.n()).any(|k| self.diagonal(k) <= largest * f64::MIN_POSITIVE);
        if !negative_diagonal && (vanishing_row || self.eliminate().is_ok()) {
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
        let columns = rhs.len() / n;
        self.reserve_columns(columns);
        for (column, permuted) in rhs.chunks_exact(n).zip(self.permuted_rhs.chunks_exact_mut(n)) {
            for (to, &old) in permuted.iter_mut().zip(self.order.old_from_new()) {
                *to = column[old as usize];
            }
        }
        let b = MatMut::from_column_major_slice_mut(&mut self.permuted_rhs[..n * columns], n, columns);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            b,
            Par::Seq,
            MemStack::new(&mut self.memory),
        );
        for (column, permuted) in rhs.chunks_exact_mut(n).zip(self.permuted_rhs.chunks_exact(n)) {
            for (&from, &old) in permuted.iter().zip(self.order.old_from_new()) {
                column[old as usize] = from;
            }
        }
    }

    /// Makes room for solves with this many right-hand sides at once.
    pub fn reserve_columns(&mut self, columns: usize) {
        if columns > self.columns_ready {
            let numeric = numeric_scratch::<T>(&self.symbolic, self.multifrontal.as_ref());
            let solve = self.symbolic.solve_in_place_scratch::<T>(columns, Par::Seq);
            self.memory = MemBuffer::new(StackReq::any_of(&[numeric, solve]));
            self.permuted_rhs.resize(self.n() * columns, T::default());
            self.columns_ready = columns;
        }
    }

    /// Structure of the factor: parent and size of each column, in elimination order.
    pub(super) fn columns(&self) -> (&[u32], &[u32]) {
        (&self.parent, &self.counts)
    }

    /// Rows of column `j` of the permuted matrix, lower triangle.
    pub(super) fn permuted_rows(&self, j: usize) -> &[u32] {
        self.permuted.row_idx_of_col_raw(j)
    }

    /// The factor's blocks of columns, left to right.
    pub(super) fn blocks(&self) -> impl Iterator<Item = Block<'_, T>> {
        // A system without unknowns has no supernodes.
        let symbolic = match self.symbolic.raw() {
            SymbolicCholeskyRaw::Supernodal(symbolic) => Some(symbolic),
            SymbolicCholeskyRaw::Simplicial(_) => None,
        };
        symbolic.into_iter().flat_map(|symbolic| {
            let factor = SupernodalLltRef::new(symbolic, &self.factor);
            (0..symbolic.n_supernodes()).map(move |s| {
                let node = factor.supernode(s);
                Block { first: node.start(), rows: node.pattern(), values: node.val() }
            })
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

/// The plan for real matrices.
fn plan(symbolic: &SymbolicCholesky<u32>, permuted: &SymbolicSparseColMat<u32>) -> Multifrontal {
    // Forced to be supernodal, the analysis is something else only where there is nothing to analyze.
    let SymbolicCholeskyRaw::Supernodal(blocks) = symbolic.raw() else {
        return Multifrontal::new(std::iter::empty(), permuted.col_ptr(), permuted.row_idx());
    };
    let (begin, end) = (blocks.supernode_begin(), blocks.supernode_end());
    let list = (0..blocks.n_supernodes())
        .map(|s| (begin[s] as usize, (end[s] - begin[s]) as usize, blocks.supernode(s).pattern()));
    Multifrontal::new(list, permuted.col_ptr(), permuted.row_idx())
}

/// Memory for the numeric factorization.
fn numeric_scratch<T: Scalar>(symbolic: &SymbolicCholesky<u32>, plan: Option<&Multifrontal>) -> StackReq {
    match plan {
        Some(plan) => plan.scratch(),
        None => symbolic.factorize_numeric_llt_scratch::<T>(Par::Seq, faer::Spec::default()),
    }
}

/// Pattern of `P A Pᵀ` (lower triangle, rows ascending) and where each of its slots is read from.
fn permute(pattern: &Pattern, order: &Permutation) -> (SymbolicSparseColMat<u32>, Vec<u32>) {
    let mut entries: Vec<(u32, u32, u32)> = pattern
        .places()
        .map(|(i, j, slot)| {
            let (row, col) = (order.new_from_old()[i], order.new_from_old()[j]);
            let flag = if row < col { MIRRORED } else { 0 };
            (row.min(col), row.max(col), slot as u32 | flag)
        })
        .collect();
    entries.sort_unstable();
    let symbolic = compress(pattern.n(), entries.iter().map(|&(col, row, _)| (col, row)));
    (symbolic, entries.into_iter().map(|(_, _, from)| from).collect())
}

/// The upper triangle of a pattern given by its lower one.
fn transpose(lower: &SymbolicSparseColMat<u32>) -> SymbolicSparseColMat<u32> {
    let n = lower.nrows();
    let mut upper: Vec<(u32, u32)> =
        (0..n).flat_map(|j| lower.row_idx_of_col(j).map(move |i| (i as u32, j as u32))).collect();
    upper.sort_unstable();
    compress(n, upper.into_iter())
}

/// Column-compressed pattern from `(column, row)` in ascending order.
fn compress(n: usize, places: impl Iterator<Item = (u32, u32)>) -> SymbolicSparseColMat<u32> {
    let mut col_ptr = vec![0_u32; n + 1];
    let rows = places.map(|(col, row)| {
        col_ptr[col as usize + 1] += 1;
        row
    });
    let rows: Vec<u32> = rows.collect();
    for j in 0..n {
        col_ptr[j + 1] += col_ptr[j];
    }
    SymbolicSparseColMat::new_checked(n, n, col_ptr, None, rows)
}
