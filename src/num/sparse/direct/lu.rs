//! LU factorization `P A Q = L U` of any square matrix, column by column.
//!
//! Column `k` of both factors solves one triangular system with the columns of `L` before it,
//!
//! ```text
//! L x = A q_k ,      U_{<k,k} = x on rows already taken as pivots,   L_{·k} = x / pivot on the others,
//! ```
//!
//! whose solution is non-zero exactly in the rows that paths in the graph of `L` reach from those of `A q_k`: found by
//! depth-first search, whose postorder reversed is an order in which to eliminate. The arithmetic is that of the entries that
//! are there, and nothing more.
//!
//! The pivot is the largest entry. Where the matrix is nearly symmetric in structure its columns are ordered as for a
//! symmetric one, and the diagonal entry is taken unless it is smaller by [`DIAGONAL_THRESHOLD`]: that order's fill is then mostly
//! kept. Else columns are ordered by COLAMD, which bounds the fill of any choice of pivots.
//!
//! # Reference
//! J. R. Gilbert, T. Peierls, *Sparse partial pivoting in time proportional to arithmetic operations*, SIAM J. Sci. Stat.
//! Comput. 9 (1988); S. C. Eisenstat, J. W. H. Liu, *Exploiting structural symmetry in a sparse partial pivoting code*, SIAM J.
//! Sci. Comput. 14 (1993), for what the search need not visit; Davis 2006, chapter 6.

use crate::run::Run;
use crate::sparse::etree::NONE;
use crate::sparse::ordering::column_degree;
use crate::sparse::{GeneralMatrix, Ordering, Permutation, SparseError};

/// Fraction of the largest entry of its column from which a diagonal one is taken as pivot. Smaller keeps more of the planned order and
/// lets rounding grow more, at most by the inverse of it per step; 0.1 is the usual compromise (UMFPACK).
const DIAGONAL_THRESHOLD: f64 = 0.1;

/// Fraction of entries with a mirror image from which a matrix is ordered as a symmetric one: the union with the mirror image then has
/// at most half as many entries again. It decides speed alone.
const SYMMETRIC_FRACTION: f64 = 0.5;

/// A triangular factor by columns, its diagonal apart.
#[derive(Debug, Default)]
struct Columns {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl Columns {
    fn column(&self, k: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[k]..self.starts[k + 1];
        self.rows[range.clone()].iter().map(|&i| i as usize).zip(self.values[range].iter().copied())
    }

    fn push(&mut self, row: u32, value: f64) {
        self.rows.push(row);
        self.values.push(value);
    }

    fn end_column(&mut self) {
        self.starts.push(self.rows.len());
    }
}

/// The factors.
#[derive(Debug)]
pub(super) struct Lu {
    columns: Permutation,
    /// Row of each pivot.
    pivot_rows: Vec<u32>,
    /// Unit lower triangular.
    lower: Columns,
    upper: Columns,
    pivots: Vec<f64>,
}

impl Lu {
    /// The factors of a square matrix; a column without a pivot as [`SparseError::Undetermined`].
    pub(super) fn new(a: &GeneralMatrix, ordering: &Ordering, run: &Run) -> Result<Self, SparseError> {
        let symmetric = symmetry(a) >= SYMMETRIC_FRACTION;
        let columns = if symmetric { ordering.permutation(&a.symmetric_pattern()?)? } else { column_degree(a)? };
        let mut work = Elimination::new(a, if symmetric { DIAGONAL_THRESHOLD } else { f64::INFINITY });
        for &column in columns.old_from_new() {
            run.check()?;
            work.eliminate(column as usize)?;
        }
        let Elimination { mut lower, upper, pivots, pivot_rows, pivot_of, .. } = work;
        lower.rows.iter_mut().for_each(|row| *row = pivot_of[*row as usize]);
        Ok(Self { columns, pivot_rows, lower, upper, pivots })
    }

    pub(super) fn solve(&self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.pivot_rows.iter().map(|&row| b[row as usize]).collect();
        for k in 0..x.len() {
            let v = x[k];
            self.lower.column(k).for_each(|(i, l)| x[i] -= l * v);
        }
        for k in (0..x.len()).rev() {
            x[k] /= self.pivots[k];
            let v = x[k];
            self.upper.column(k).for_each(|(i, u)| x[i] -= u * v);
        }
        x.iter().zip(self.columns.old_from_new()).for_each(|(x, &old)| b[old as usize] = *x);
    }

    pub(super) fn solve_transposed(&self, b: &mut [f64]) {
        let mut x: Vec<f64> = self.columns.old_from_new().iter().map(|&old| b[old as usize]).collect();
        for k in 0..x.len() {
            let known: f64 = self.upper.column(k).map(|(i, u)| u * x[i]).sum();
            x[k] = (x[k] - known) / self.pivots[k];
        }
        for k in (0..x.len()).rev() {
            x[k] -= self.lower.column(k).map(|(i, l)| l * x[i]).sum::<f64>();
        }
        x.iter().zip(&self.pivot_rows).for_each(|(x, &row)| b[row as usize] = *x);
    }
}

/// Share of the entries off the diagonal whose mirror image is an entry, 1 where there are none; 0 where most of the diagonal
/// is missing.
fn symmetry(a: &GeneralMatrix) -> f64 {
    let transposed = a.transposed();
    let (mut mirrored, mut diagonal) = (0, 0);
    for j in 0..a.columns() {
        let mut others = transposed.column(j).peekable();
        for (i, _) in a.column(j) {
            while others.next_if(|&(k, _)| k < i).is_some() {}
            let mirror = others.peek().is_some_and(|&(k, _)| k == i);
            mirrored += usize::from(mirror && i != j);
            diagonal += usize::from(i == j);
        }
    }
    let off = a.nnz() - diagonal;
    if 2 * diagonal < a.columns() {
        0.0
    } else if off == 0 {
        1.0
    } else {
        mirrored as f64 / off as f64
    }
}

/// The factors as they grow, rows of `lower` still in the numbering of the matrix.
struct Elimination<'a> {
    a: &'a GeneralMatrix,
    /// Share of the largest entry from which the diagonal is preferred.
    preference: f64,
    lower: Columns,
    upper: Columns,
    pivots: Vec<f64>,
    pivot_rows: Vec<u32>,
    /// Which pivot each row is, [`NONE`] where it is none yet.
    pivot_of: Vec<u32>,
    /// End of what the search visits of each column of `lower`.
    visited_end: Vec<usize>,
    pruned: Vec<bool>,
    x: Vec<f64>,
    /// Last column that reached each row.
    reached: Vec<u32>,
    /// Pivots reached, in postorder, and the other rows.
    known: Vec<u32>,
    open: Vec<u32>,
    /// Pivots on the path down, each with the next entry to visit.
    path: Vec<(u32, usize)>,
}

impl<'a> Elimination<'a> {
    fn new(a: &'a GeneralMatrix, preference: f64) -> Self {
        let n = a.columns();
        let empty = || Columns { starts: vec![0], ..Columns::default() };
        Self {
            a,
            preference,
            lower: empty(),
            upper: empty(),
            pivots: Vec::with_capacity(n),
            pivot_rows: Vec::with_capacity(n),
            pivot_of: vec![NONE; n],
            visited_end: Vec::with_capacity(n),
            pruned: vec![false; n],
            x: vec![0.0; n],
            reached: vec![NONE; n],
            known: Vec::new(),
            open: Vec::new(),
            path: Vec::new(),
        }
    }

    fn eliminate(&mut self, column: usize) -> Result<(), SparseError> {
        let k = self.pivots.len() as u32;
        self.known.clear();
        self.open.clear();
        for (row, value) in self.a.column(column) {
            self.x[row] = value;
            self.search(row as u32, k);
        }
        for at in (0..self.known.len()).rev() {
            let j = self.known[at];
            let value = std::mem::take(&mut self.x[self.pivot_rows[j as usize] as usize]);
            for (row, l) in self.lower.column(j as usize) {
                self.x[row] -= l * value;
            }
            self.upper.push(j, value);
        }
        self.upper.end_column();
        let row = self.choose(column).ok_or(SparseError::Undetermined { unknown: column })?;
        let pivot = self.x[row as usize];
        for &other in &self.open {
            let value = std::mem::take(&mut self.x[other as usize]) / pivot;
            // Zeros that come out stay: pruning counts on the structure.
            if other != row {
                self.lower.push(other, value);
            }
        }
        self.lower.end_column();
        self.pivots.push(pivot);
        self.pivot_rows.push(row);
        self.pivot_of[row as usize] = k;
        self.visited_end.push(self.lower.rows.len());
        self.prune(row);
        Ok(())
    }

    /// Adds what paths in the graph of `L` reach from a row.
    fn search(&mut self, row: u32, k: u32) {
        if std::mem::replace(&mut self.reached[row as usize], k) == k {
            return;
        }
        let j = self.pivot_of[row as usize];
        if j == NONE {
            self.open.push(row);
            return;
        }
        self.path.push((j, self.lower.starts[j as usize]));
        while let Some((j, next)) = self.path.last_mut() {
            if *next == self.visited_end[*j as usize] {
                self.known.push(*j);
                self.path.pop();
                continue;
            }
            let row = self.lower.rows[*next];
            *next += 1;
            if std::mem::replace(&mut self.reached[row as usize], k) == k {
                continue;
            }
            match self.pivot_of[row as usize] {
                NONE => self.open.push(row),
                j => self.path.push((j, self.lower.starts[j as usize])),
            }
        }
    }

    /// The row of the pivot: the column's own where its entry is large enough, else that of the largest.
    fn choose(&self, column: usize) -> Option<u32> {
        let size = |row: u32| self.x[row as usize].abs();
        let largest = self.open.iter().copied().max_by(|&i, &j| size(i).total_cmp(&size(j)).then(j.cmp(&i)))?;
        let own = column as u32;
        let available = self.pivot_of[column] == NONE && self.reached[column] == self.pivots.len() as u32;
        let row = if available && size(own) >= self.preference * size(largest) { own } else { largest };
        (size(row) > 0.0).then_some(row)
    }

    /// Where `u_jk` and `l_kj` are both stored, all rows of column `j` that are no pivots yet are reached through `k` as well:
    /// later searches need visit only those that are.
    fn prune(&mut self, row: u32) {
        for at in self.upper.starts[self.pivots.len() - 1]..self.upper.rows.len() {
            let j = self.upper.rows[at] as usize;
            let range = self.lower.starts[j]..self.lower.starts[j + 1];
            if self.pruned[j] || !self.lower.rows[range.clone()].contains(&row) {
                continue;
            }
            let mut end = range.start;
            for at in range {
                if self.pivot_of[self.lower.rows[at] as usize] != NONE {
                    self.lower.rows.swap(at, end);
                    self.lower.values.swap(at, end);
                    end += 1;
                }
            }
            self.visited_end[j] = end;
            self.pruned[j] = true;
        }
    }
}
