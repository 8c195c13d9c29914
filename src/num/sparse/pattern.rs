//! The entries of a symmetric matrix that may be non-zero.

use super::SparseError;
use crate::math::Lists;

/// Lower triangle of a symmetric `n×n` pattern, compressed by columns: rows ascending, every diagonal entry present.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pattern {
    col_ptr: Vec<u32>,
    row_idx: Vec<u32>,
}

impl Pattern {
    /// The pattern that contains each entry `(i, j)` (either triangle, repeats allowed) and the diagonal.
    ///
    /// # Errors
    /// [`SparseError::OutOfRange`] for an index ≥ `n`; [`SparseError::TooLarge`] past 2³¹ entries.
    pub fn new(n: usize, entries: impl IntoIterator<Item = (usize, usize)>) -> Result<Self, SparseError> {
        if n > i32::MAX as usize {
            return Err(SparseError::TooLarge { size: n });
        }
        // By counting: columns are short, so that sorting all entries at once would cost several times as much.
        let mut lower = Vec::new();
        for (i, j) in entries {
            if i.max(j) >= n {
                return Err(SparseError::OutOfRange { index: i.max(j), unknowns: n });
            }
            if i != j {
                lower.push((i.min(j) as u32, i.max(j) as u32));
            }
        }
        let mut columns = Lists::new(n, lower.iter().copied());
        drop(lower);
        let (mut col_ptr, mut row_idx) = (Vec::with_capacity(n + 1), Vec::with_capacity(n + columns.items().len()));
        col_ptr.push(0);
        for j in 0..n {
            row_idx.push(j as u32);
            let column = columns.of_mut(j);
            column.sort_unstable();
            row_idx.extend(column.chunk_by(|a, b| a == b).map(|same| same[0]));
            col_ptr.push(row_idx.len() as u32);
        }
        if row_idx.len() > i32::MAX as usize {
            return Err(SparseError::TooLarge { size: row_idx.len() });
        }
        row_idx.shrink_to_fit();
        Ok(Self { col_ptr, row_idx })
    }

    /// Number of unknowns.
    pub fn n(&self) -> usize {
        self.col_ptr.len() - 1
    }

    /// Number of stored entries (lower triangle with diagonal).
    pub fn nnz(&self) -> usize {
        self.row_idx.len()
    }

    /// Slots of column `j`: a range into [`Self::rows`].
    pub fn column(&self, j: usize) -> std::ops::Range<usize> {
        self.col_ptr[j] as usize..self.col_ptr[j + 1] as usize
    }

    /// Row of every slot.
    pub fn rows(&self) -> &[u32] {
        &self.row_idx
    }

    /// Start of every column, `n + 1` entries.
    pub fn column_starts(&self) -> &[u32] {
        &self.col_ptr
    }

    /// Slot of the entry `(i, j)`, given in either triangle; `None` where it is a structural zero.
    pub fn slot(&self, i: usize, j: usize) -> Option<usize> {
        let (row, col) = (i.max(j), i.min(j));
        let range = self.column(col);
        let at = self.row_idx[range.clone()].binary_search(&(row as u32)).ok()?;
        Some(range.start + at)
    }

    /// Iterates over `(row, column, slot)`, columns ascending, rows ascending within each.
    pub fn entries(&self) -> impl Iterator<Item = (usize, usize, usize)> + Clone + '_ {
        (0..self.n()).flat_map(move |j| self.column(j).map(move |s| (self.row_idx[s] as usize, j, s)))
    }

    /// The refusal of a factorization of so many multiplications, with the unknown of the most neighbors.
    pub fn too_dense(&self, flops: f64, most: f64) -> SparseError {
        let mut neighbors = vec![0_u32; self.n()];
        for (i, j, _) in self.entries().filter(|(i, j, _)| i != j) {
            neighbors[i] += 1;
            neighbors[j] += 1;
        }
        let (unknown, &neighbors) = neighbors.iter().enumerate().rev().max_by_key(|(_, n)| **n).unwrap_or((0, &0));
        SparseError::TooDense { flops, most, unknown, neighbors: neighbors as usize }
    }

    /// Neighbors of each unknown in both triangles, without itself.
    pub(super) fn adjacency(&self) -> Lists<u32> {
        let off_diagonal = self.entries().filter(|(i, j, _)| i != j);
        let pairs = off_diagonal.flat_map(|(i, j, _)| [(i as u32, j as u32), (j as u32, i as u32)]);
        Lists::new(self.n(), pairs)
    }
}
