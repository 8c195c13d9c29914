//! A symmetric pattern with its unknowns renumbered.

use super::{Pattern, Permutation};
use crate::math::Lists;

/// Marks a slot whose entry comes from the other triangle.
const MIRRORED: u32 = 1 << 31;

/// The lower triangle of `P A Pᵀ`, compressed by columns, rows ascending, the diagonal first.
#[derive(Debug, Default)]
pub(super) struct Permuted {
    /// Start of each column, and the number of entries.
    pub(super) starts: Vec<usize>,
    /// Row of each entry.
    pub(super) rows: Vec<u32>,
    /// Slot of the pattern that each entry is read from, perhaps [`MIRRORED`].
    source: Vec<u32>,
}

impl Permuted {
    /// Two stable passes of distribution, by row and then by column, leave the rows of each column ascending.
    pub(super) fn new(pattern: &Pattern, order: &Permutation) -> Self {
        let new = order.new_from_old();
        let entries = pattern.entries().map(|(i, j, slot)| {
            let (row, col) = (new[i], new[j]);
            let flag = if row < col { MIRRORED } else { 0 };
            (row.max(col), (row.max(col), row.min(col), slot as u32 | flag))
        });
        let by_row = Lists::new(pattern.n(), entries);
        let columns = Lists::new(pattern.n(), by_row.items().iter().map(|&(row, col, from)| (col, (row, from))));
        let (rows, source) = columns.items().iter().copied().unzip();
        Self { starts: columns.starts().to_vec(), rows, source }
    }

    /// Rows of column `j`.
    pub(super) fn column(&self, j: usize) -> &[u32] {
        &self.rows[self.range(j)]
    }

    /// Entries of column `j`.
    pub(super) fn range(&self, j: usize) -> std::ops::Range<usize> {
        self.starts[j]..self.starts[j + 1]
    }

    /// For each entry, the slot of the pattern, and whether it is the mirror image of the entry there.
    pub(super) fn sources(&self) -> impl ExactSizeIterator<Item = (usize, bool)> + '_ {
        self.source.iter().map(|&from| ((from & !MIRRORED) as usize, from & MIRRORED != 0))
    }
}
