//! A symmetric pattern with its unknowns renumbered.

use super::{Pattern, Permutation};

/// Marks a slot whose entry comes from the other triangle.
const MIRRORED: u32 = 1 << 31;

/// The lower triangle of `P A Pᵀ`, compressed by columns, rows ascending, the diagonal first.
#[derive(Debug, Default)]
pub(super) struct Permuted {
    /// Start of each column, and the number of entries.
    pub(super) starts: Vec<u32>,
    /// Row of each entry.
    pub(super) rows: Vec<u32>,
    /// Slot of the pattern that each entry is read from, perhaps [`MIRRORED`].
    source: Vec<u32>,
}

impl Permuted {
    /// Two stable passes of distribution, by row and then by column, leave the rows of each column ascending.
    pub(super) fn new(pattern: &Pattern, order: &Permutation) -> Self {
        let new = order.new_from_old();
        let entries: Vec<(u32, u32, u32)> = pattern
            .entries()
            .map(|(i, j, slot)| {
                let (row, col) = (new[i], new[j]);
                let flag = if row < col { MIRRORED } else { 0 };
                (row.max(col), row.min(col), slot as u32 | flag)
            })
            .collect();
        let n = pattern.n();
        let (by_row, _) = distribute(&entries, n, |e| e.0);
        let (sorted, starts) = distribute(&by_row, n, |e| e.1);
        let (rows, source) = sorted.into_iter().map(|(row, _, from)| (row, from)).unzip();
        Self { starts, rows, source }
    }

    /// Rows of column `j`.
    pub(super) fn column(&self, j: usize) -> &[u32] {
        &self.rows[self.range(j)]
    }

    /// Entries of column `j`.
    pub(super) fn range(&self, j: usize) -> std::ops::Range<usize> {
        self.starts[j] as usize..self.starts[j + 1] as usize
    }

    /// For each entry, the slot of the pattern, and whether it is the mirror image of the entry there.
    pub(super) fn sources(&self) -> impl ExactSizeIterator<Item = (usize, bool)> + '_ {
        self.source.iter().map(|&from| ((from & !MIRRORED) as usize, from & MIRRORED != 0))
    }
}

type Entry = (u32, u32, u32);

/// Entries by ascending key, those of equal keys in the order given; and where each key starts.
fn distribute(entries: &[Entry], keys: usize, key: impl Fn(&Entry) -> u32) -> (Vec<Entry>, Vec<u32>) {
    let mut starts = vec![0_u32; keys + 1];
    for e in entries {
        starts[key(e) as usize + 1] += 1;
    }
    (0..keys).for_each(|k| starts[k + 1] += starts[k]);
    let mut next = starts.clone();
    let mut sorted = vec![(0, 0, 0); entries.len()];
    for e in entries {
        let at = &mut next[key(e) as usize];
        sorted[*at as usize] = *e;
        *at += 1;
    }
    (sorted, starts)
}
