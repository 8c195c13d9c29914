//! A factor copied for many solves: non-zeros only, in the order in which the solves read them.
//!
//! A supernodal factorization pads its blocks with zeros and solves one block at a time through dense kernels: right for
//! factoring, wrong for thousands of solves with few right-hand sides, which are bound by the memory they pass. Here
//!
//! * columns of equal structure share one list of rows: their *panel*, at most [`MAX_WIDTH`] columns wide;
//! * a panel's entries are stored row by row, so that a row of the unknowns is loaded and stored once per panel;
//! * the right-hand sides of one unknown are side by side in one vector register;
//! * the permutation is part of copying in and out.
//!
//! `L x = b` passes the panels forwards, `Lᵀ x = b` backwards ([`super::sweep`]).
//!
//! # Reference
//! E. Ng, B. W. Peyton, *Block sparse Cholesky algorithms on advanced uniprocessor computers*, SIAM J. Sci. Comput. 14 (1993),
//! for supernodes; the panels are ours.

use super::etree::NONE;
use super::sweep::{Lanes, MAX_WIDTH, Panels, Stored};
use super::{Cholesky, Ordering, Permutation, SparseError, SparseMatrix};
use crate::run::Run;

/// The factor `L` of `P A Pᵀ = L Lᵀ` without padding, for solves only.
///
/// Solutions agree with those of the [`Cholesky`] it was copied from up to rounding. In single precision ([`Self::rounded`])
/// they are off by some 10⁻⁷ times the condition number: a preconditioner.
#[derive(Clone, Debug)]
pub struct CompactFactor<V = f64> {
    order: Permutation,
    panels: Panels<V>,
    nnz: usize,
    one: Vec<Lanes<1>>,
    four: Vec<Lanes<4>>,
}

impl CompactFactor {
    /// Copies the factor. Where `cholesky` holds none (not factored, or refused), solutions are NaN as its own.
    pub fn new(cholesky: &Cholesky) -> Self {
        let mut this = Self {
            order: cholesky.order().clone(),
            panels: panels_of(cholesky),
            nnz: cholesky.nnz(),
            one: Vec::new(),
            four: Vec::new(),
        };
        this.refill(cholesky);
        this
    }

    /// Analyzes, factors and copies a positive definite matrix whose values do not change.
    ///
    /// # Errors
    /// As [`Cholesky::analyze`] and [`Cholesky::factor`].
    pub fn of(matrix: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Self, SparseError> {
        Self::of_within(matrix, ordering, f64::INFINITY, run)
    }

    /// [`Self::of`] where the factorization takes at most `most` multiplications; a denser system is refused before its factor is
    /// allocated.
    ///
    /// # Errors
    /// Those of [`Self::of`]; [`SparseError::TooDense`].
    pub fn of_within(matrix: &SparseMatrix, ordering: &Ordering, most: f64, run: &Run) -> Result<Self, SparseError> {
        let ordering = if matrix.n() == 0 { &Ordering::Natural } else { ordering };
        let mut cholesky = Cholesky::analyze_within(matrix.pattern(), ordering, most)?;
        cholesky.factor(matrix, run)?;
        Ok(Self::new(&cholesky))
    }

    /// The factor in single precision: half of the memory and of what a solve reads. Solves are still summed in double precision. `None`
    /// where an entry is too large or too small for single precision.
    pub fn rounded(&self) -> Option<CompactFactor<f32>> {
        let (order, panels) = (self.order.clone(), self.panels.rounded()?);
        Some(CompactFactor { order, panels, nnz: self.nnz, one: Vec::new(), four: Vec::new() })
    }

    /// Takes the values of the same analysis factored anew. Allocates nothing.
    ///
    /// # Panics
    /// Where `cholesky` is not the analysis this was made from.
    pub fn refill(&mut self, cholesky: &Cholesky) {
        assert!(self.order == *cholesky.order() && self.nnz == cholesky.nnz(), "another analysis than the one copied");
        let mut to = self.panels.values.iter_mut();
        let mut rows = &self.panels.rows[..];
        let mut panels = self.panels.list.iter().peekable();
        for block in cholesky.blocks() {
            let width = block.width;
            while let Some(panel) = panels.next_if(|p| (p.first as usize) < block.first + width) {
                let own = panel.first as usize - block.first;
                let below;
                (below, rows) = rows.split_at(panel.below as usize);
                let last = panel.width as usize - 1;
                let columns: [&[f64]; MAX_WIDTH] = std::array::from_fn(|c| block.column(own + c.min(last)));
                let columns = &columns[..panel.width as usize];
                for k in 0..columns.len() {
                    for (c, column) in columns[..=k].iter().enumerate() {
                        let l = column[own + k];
                        *to.next().expect("as many values as positions") = if c == k { 1.0 / l } else { l };
                    }
                }
                // Both lists ascend: one pass finds each row of the panel among those of the block.
                let mut at = 0;
                for &row in below {
                    let row = row as usize;
                    let position = if row < block.first + width {
                        row - block.first
                    } else {
                        at += block.rows[at..].iter().take_while(|&&r| (r as usize) < row).count();
                        width + at
                    };
                    for column in columns {
                        *to.next().expect("as many values as positions") = column[position];
                    }
                }
            }
        }
    }
}

impl<V: Stored> CompactFactor<V> {
    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.order.len()
    }

    /// Non-zero entries of `L`, diagonal included.
    pub fn nnz(&self) -> usize {
        self.nnz
    }

    /// Bytes that a solve reads, twice.
    pub fn bytes(&self) -> usize {
        self.panels.bytes()
    }

    /// Replaces `b` by `A⁻¹ b`. Allocates the first time only; so do all solves.
    ///
    /// # Panics
    /// Unless `b` has [`Self::n`] entries; so for all solves.
    pub fn solve(&mut self, b: &mut [f64]) {
        assert!(b.len() == self.n(), "{} values for {} unknowns", b.len(), self.n());
        self.one.resize(self.n(), Lanes::default());
        for (to, &old) in self.one.iter_mut().zip(self.order.old_from_new()) {
            to.0[0] = b[old as usize];
        }
        self.panels.solve(&mut self.one);
        for (from, &old) in self.one.iter().zip(self.order.old_from_new()) {
            b[old as usize] = from.0[0];
        }
    }

    /// Solves for columns of `n` entries one after another, four at a time.
    pub fn solve_columns(&mut self, columns: &mut [f64]) {
        let n = self.n();
        if n == 0 {
            return;
        }
        assert!(columns.len().is_multiple_of(n), "{} values are not columns of {n}", columns.len());
        for group in columns.chunks_mut(4 * n) {
            if group.len() == n {
                self.solve(group);
                continue;
            }
            self.four.resize(n, Lanes::default());
            for (to, &old) in self.four.iter_mut().zip(self.order.old_from_new()) {
                for (to, column) in to.0.iter_mut().zip(group.chunks_exact(n)) {
                    *to = column[old as usize];
                }
            }
            self.panels.solve(&mut self.four);
            for (from, &old) in self.four.iter().zip(self.order.old_from_new()) {
                for (from, column) in from.0.iter().zip(group.chunks_exact_mut(n)) {
                    column[old as usize] = *from;
                }
            }
        }
    }

    /// Solves for `D` ≤ 4 right-hand sides at once: the coordinates of each point.
    pub fn solve_points<const D: usize>(&mut self, b: &mut [[f64; D]]) {
        assert!(b.len() == self.n(), "{} values for {} unknowns", b.len(), self.n());
        self.four.resize(self.n(), Lanes::default());
        for (to, &old) in self.four.iter_mut().zip(self.order.old_from_new()) {
            to.0[..D].copy_from_slice(&b[old as usize]);
        }
        self.panels.solve(&mut self.four);
        for (from, &old) in self.four.iter().zip(self.order.old_from_new()) {
            b[old as usize].copy_from_slice(&from.0[..D]);
        }
    }
}

/// The structure of `L` in panels, values not yet filled.
///
/// The rows of a group of columns of equal structure are those of its columns of the matrix, and those of the groups whose
/// parent is among its columns. Ascending they come out of the padded list of the block around them.
fn panels_of(cholesky: &Cholesky) -> Panels<f64> {
    let (parent, counts) = cholesky.columns();
    let mut panels = Panels::default();
    let mut mark = vec![NONE; cholesky.n()];
    // Rows of each group, as a range of `panels.rows`; the last group whose parent is a column, and the one before it.
    let (mut rows_of, mut last_child, mut sibling) = (Vec::new(), vec![NONE; cholesky.n()], Vec::new());
    for block in cholesky.blocks() {
        let end = block.first + block.width;
        let mut first = block.first;
        while first < end {
            let same = |j: &usize| parent[j - 1] == *j as u32 && counts[j - 1] == counts[*j] + 1;
            let next = (first + 1..end).find(|j| !same(j)).unwrap_or(end);
            for (j, child) in (first..next).zip(last_child[first..next].to_vec()) {
                cholesky.permuted_rows(j).iter().for_each(|&row| mark[row as usize] = first as u32);
                let mut child = child;
                while child != NONE {
                    let range: &std::ops::Range<usize> = &rows_of[child as usize];
                    panels.rows[range.clone()].iter().for_each(|&row| mark[row as usize] = first as u32);
                    child = sibling[child as usize];
                }
            }
            let candidates = (next as u32..end as u32).chain(block.rows.iter().copied());
            let below: Vec<u32> = candidates.filter(|&r| mark[r as usize] == first as u32).collect();
            debug_assert_eq!(below.len() + next - first, counts[first] as usize, "columns {first}..{next}");
            for k in (first..next).step_by(MAX_WIDTH) {
                panels.push(k, (k + MAX_WIDTH).min(next), next, &below);
            }
            let parent = parent[next - 1];
            sibling.push(if parent == NONE { NONE } else { last_child[parent as usize] });
            if parent != NONE {
                last_child[parent as usize] = rows_of.len() as u32;
            }
            rows_of.push(panels.rows.len() - below.len()..panels.rows.len());
            first = next;
        }
    }
    panels
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;

    fn fixed_grid(side: usize) -> SparseMatrix {
        let mut triplets = vec![];
        for i in 0..side * side {
            triplets.push((i, i, 5.0 + (i as f64).sin()));
            if i % side > 0 {
                triplets.push((i, i - 1, -1.0));
            }
            if i >= side {
                triplets.push((i, i - side, -0.9));
            }
        }
        SparseMatrix::from_triplets(side * side, &triplets).expect("in range")
    }

    #[test]
    fn a_factor_beyond_single_precision_is_not_rounded() {
        for (value, fits) in [(1e70, true), (1e90, false), (1e-90, false)] {
            let a = SparseMatrix::from_triplets(2, &[(0, 0, 1.0), (1, 1, value)]).expect("in range");
            let factor = CompactFactor::of(&a, &Ordering::Natural, &Run::default()).expect("positive definite");
            assert_eq!(factor.rounded().is_some(), fits, "{value}");
        }
    }

    #[test]
    fn the_copy_solves_as_the_factor_does() {
        for side in [1, 2, 5, 13, 40] {
            let a = fixed_grid(side);
            let n = side * side;
            for ordering in [Ordering::Natural, Ordering::Amd] {
                let mut cholesky = Cholesky::analyze(&Arc::clone(a.pattern()), &ordering).expect("valid");
                cholesky.factor(&a, &Run::default()).expect("positive definite");
                let mut compact = CompactFactor::new(&cholesky);
                let b: Vec<f64> = (0..n).map(|i| (1.3 * i as f64).cos()).collect();
                let mut x = b.clone();
                cholesky.solve_in_place(&mut x);
                let mut y = b.clone();
                compact.solve(&mut y);
                let mut z: Vec<[f64; 3]> = b.iter().map(|&b| [b, 2.0 * b, -b]).collect();
                compact.solve_points(&mut z);
                let mut w: Vec<f64> =
                    [1.0, -3.0, 0.5, 2.0, 4.0].iter().flat_map(|s| b.iter().map(move |b| s * b)).collect();
                compact.solve_columns(&mut w);
                let mut rounded = b.clone();
                compact.rounded().expect("entries of order one").solve(&mut rounded);
                for i in 0..n {
                    assert!((x[i] - rounded[i]).abs() < 1e-6, "{side}: {} {}", x[i], rounded[i]);
                    assert!((x[i] - y[i]).abs() < 1e-14, "{side}: {} {}", x[i], y[i]);
                    let error =
                        z[i].iter().zip([1.0, 2.0, -1.0]).map(|(z, s)| (z - s * x[i]).abs()).fold(0.0, f64::max);
                    assert!(error < 1e-14, "{side}, unknown {i}: {error}");
                    for (k, s) in [1.0, -3.0, 0.5, 2.0, 4.0].into_iter().enumerate() {
                        assert!((w[k * n + i] - s * x[i]).abs() < 1e-13);
                    }
                }
            }
        }
    }
}
