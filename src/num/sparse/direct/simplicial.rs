//! Cholesky factorization row by row of `L`: for small systems and very sparse ones.
//!
//! Row `i` of `L` solves a triangular system with the rows above it,
//!
//! ```text
//! L_{<i,<i} lᵢ = a_{<i,i} ,     l_ii = √(a_ii − lᵢᵀ lᵢ) ,
//! ```
//!
//! and is non-zero in the columns on the path up the elimination tree from those of row `i` of `A`.
//!
//! # Reference
//! Davis 2006, section 4.7 (up-looking Cholesky).

use crate::math::Lists;
use crate::run::Run;
use crate::sparse::blocks::Analysis;
use crate::sparse::{Ordering, Permutation, SparseError, SparseMatrix};

/// `P A Pᵀ = L Lᵀ`, `L` compressed by columns, the diagonal first.
#[derive(Debug)]
pub(super) struct Simplicial {
    order: Permutation,
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl Simplicial {
    /// The factor, or `None` where a pivot is not positive.
    pub(super) fn new(a: &SparseMatrix, ordering: &Ordering, run: &Run) -> Result<Option<Self>, SparseError> {
        let n = a.n();
        let Analysis { order, parent, counts, permuted, .. } =
            Analysis::new(a.pattern(), &ordering.permutation(a.pattern())?);
        let mut starts = vec![0_usize; n + 1];
        (0..n).for_each(|j| starts[j + 1] = starts[j] + counts[j] as usize);
        let mut end = starts.clone();
        let (mut rows, mut values) = (vec![0_u32; starts[n]], vec![0.0; starts[n]]);
        // `(column, slot)` of the entries of each row.
        let slots = (0..n).flat_map(|j| permuted.range(j).map(move |slot| (j as u32, slot as u32)));
        let by_row = Lists::new(n, slots.map(|(j, slot)| (permuted.rows[slot as usize], (j, slot))));
        let entry: Vec<f64> = permuted.sources().map(|(slot, _)| a.values()[slot]).collect();
        let (mut x, mut seen, mut reach) = (vec![0.0; n], vec![usize::MAX; n], Vec::new());
        for i in 0..n {
            run.check()?;
            seen[i] = i;
            reach.clear();
            let mut pivot = 0.0;
            for &(column, slot) in by_row.of(i) {
                let mut j = column as usize;
                if j == i {
                    pivot = entry[slot as usize];
                    continue;
                }
                x[j] = entry[slot as usize];
                while seen[j] != i {
                    seen[j] = i;
                    reach.push(j);
                    j = parent[j] as usize;
                }
            }
            // Ascending columns are in an order in which each comes before those that need it.
            reach.sort_unstable();
            for &j in &reach {
                let range = starts[j] + 1..end[j];
                let l = std::mem::take(&mut x[j]) / values[starts[j]];
                for (&row, &v) in rows[range.clone()].iter().zip(&values[range]) {
                    x[row as usize] -= v * l;
                }
                pivot -= l * l;
                (rows[end[j]], values[end[j]]) = (i as u32, l);
                end[j] += 1;
            }
            if !(pivot > 0.0) {
                return Ok(None);
            }
            (rows[end[i]], values[end[i]]) = (i as u32, pivot.sqrt());
            end[i] += 1;
        }
        Ok(Some(Self { order, starts, rows, values }))
    }

    pub(super) fn solve(&self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.order.old_from_new().iter().map(|&old| b[old as usize]).collect();
        let column = |j: usize| {
            let range = self.starts[j] + 1..self.starts[j + 1];
            self.rows[range.clone()].iter().map(|&i| i as usize).zip(&self.values[range])
        };
        for j in 0..x.len() {
            x[j] /= self.values[self.starts[j]];
            let v = x[j];
            column(j).for_each(|(i, l)| x[i] -= l * v);
        }
        for j in (0..x.len()).rev() {
            let known: f64 = column(j).map(|(i, l)| l * x[i]).sum();
            x[j] = (x[j] - known) / self.values[self.starts[j]];
        }
        x.iter().zip(self.order.old_from_new()).for_each(|(x, &old)| b[old as usize] = *x);
    }
}
