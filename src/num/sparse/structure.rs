//! Where the Cholesky factor of a pattern is non-zero, without factoring.
//!
//! Row `i` of `L` has an entry in every column on the path up the elimination tree from the columns in which row `i` of `A`
//! has one (Davis 2006, section 4.2): its entries can be named one after another in memory of the order of `n`.

use super::etree::{Elimination, NONE};
use super::{Ordering, Pattern, Permutation, SparseError};
use crate::math::Lists;

/// The structure of a factor: its order, its size, its entries.
#[derive(Debug)]
pub struct FactorStructure<'a> {
    pattern: &'a Pattern,
    neighbors: Lists<u32>,
    elimination: Elimination,
    counts: Vec<u32>,
}

impl<'a> FactorStructure<'a> {
    /// What elimination in this order makes of the pattern.
    ///
    /// # Errors
    /// As [`super::Cholesky::analyze`].
    pub fn new(pattern: &'a Pattern, ordering: &Ordering) -> Result<Self, SparseError> {
        Ok(Self::of_order(pattern, &ordering.permutation(pattern)?))
    }

    pub(super) fn of_order(pattern: &'a Pattern, order: &Permutation) -> Self {
        let elimination = Elimination::postordered(pattern, order);
        let mut this = Self { pattern, neighbors: pattern.adjacency(), elimination, counts: Vec::new() };
        this.counts = this.elimination.column_counts(|j| this.row_of_matrix(j));
        this
    }

    /// The elimination order, postordered: exchanges that leave fill and arithmetic alone. [`Self::for_each`] names entries in
    /// this numbering.
    pub fn order(&self) -> &Permutation {
        &self.elimination.order
    }

    /// Non-zero entries of `L`, diagonal included.
    pub fn nnz(&self) -> usize {
        self.counts.iter().map(|&c| c as usize).sum()
    }

    /// `nnz(L)` over the entries of the lower triangle of `A`; ≥ 1.
    pub fn fill(&self) -> f64 {
        self.nnz() as f64 / self.pattern.nnz().max(1) as f64
    }

    /// Multiplications of the factorization: the sum of the squares of the columns' entries.
    pub fn flops(&self) -> f64 {
        self.counts.iter().map(|&c| f64::from(c) * f64::from(c)).sum()
    }

    /// Columns, permuted, in which row `i` of the permuted matrix has an entry off the diagonal.
    fn row_of_matrix(&self, i: usize) -> impl Iterator<Item = u32> + '_ {
        let order = &self.elimination.order;
        let old = order.old_from_new()[i] as usize;
        self.neighbors.of(old).iter().map(|&w| order.new_from_old()[w as usize])
    }

    /// Calls `visit(row, column, whether A has an entry there)` for each entry of `L`, row by row.
    pub fn for_each(&self, mut visit: impl FnMut(usize, usize, bool)) {
        let n = self.pattern.n();
        let (mut seen, mut own) = (vec![NONE; n], vec![NONE; n]);
        for i in 0..n {
            visit(i, i, true);
            seen[i] = i as u32;
            self.row_of_matrix(i).for_each(|j| own[j as usize] = i as u32);
            for j in self.row_of_matrix(i) {
                let mut j = j as usize;
                while j < i && seen[j] != i as u32 {
                    seen[j] = i as u32;
                    visit(i, j, own[j] == i as u32);
                    j = self.elimination.parent[j] as usize;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn places_and_counts_are_those_of_elimination() {
        let mut rng = fastrand::Rng::with_seed(4);
        for n in [1, 2, 9, 40] {
            let entries: Vec<(usize, usize)> = (0..2 * n).map(|_| (rng.usize(..n), rng.usize(..n))).collect();
            let pattern = Pattern::new(n, entries).expect("in range");
            for ordering in [Ordering::Natural, Ordering::Amd, Ordering::ReverseCuthillMcKee, Ordering::GraphDissection]
            {
                let structure = FactorStructure::new(&pattern, &ordering).expect("valid");
                let new = structure.order().new_from_old();
                // Elimination by hand: each column couples all rows below it that it has.
                let mut full = DMatrix::from_element(n, n, false);
                for (i, j, _) in pattern.entries() {
                    let (i, j) = (new[i] as usize, new[j] as usize);
                    full[(i.max(j), i.min(j))] = true;
                }
                let original = full.clone();
                for k in 0..n {
                    let rows: Vec<usize> = (k + 1..n).filter(|&i| full[(i, k)]).collect();
                    for (i, j) in rows.iter().flat_map(|&i| rows.iter().map(move |&j| (i, j))).filter(|(i, j)| j <= i) {
                        full[(i, j)] = true;
                    }
                }
                let mut found = DMatrix::from_element(n, n, false);
                structure.for_each(|i, j, own| {
                    assert!(!std::mem::replace(&mut found[(i, j)], true), "({i}, {j}) is named twice");
                    assert_eq!(own, original[(i, j)], "({i}, {j})");
                });
                assert_eq!(found, full, "{ordering:?}");
                let count = |j: usize| full.column(j).iter().filter(|&&x| x).count();
                assert_eq!(structure.nnz(), (0..n).map(count).sum::<usize>());
                assert_eq!(structure.flops(), (0..n).map(|j| (count(j) * count(j)) as f64).sum::<f64>());
                assert_eq!(structure.fill(), structure.nnz() as f64 / pattern.nnz() as f64);
            }
        }
    }
}
