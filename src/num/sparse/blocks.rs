//! Blocks of columns of the factor that are eliminated together.
//!
//! Columns of equal structure form a block ("supernode") whose entries make a dense trapezoid: `w` columns, their own triangle
//! and `b` rows below. On surfaces most such blocks are of a few columns, and what counts is not their arithmetic but each
//! block's own cost. A child of the elimination tree is therefore merged into its parent where the zeros stored thereby are
//! few against the entries ([`RELAXATION`]). Merging needs the columns of both side by side; elimination in any order that
//! puts children before parents gives the same factor, so columns are renumbered to have them so.
//!
//! # Reference
//! C. Ashcraft, R. Grimes, *The influence of relaxed supernode partitions on the multifrontal method*, ACM TOMS 15 (1989);
//! J. W. H. Liu, *On the storage requirement in the out-of-core multifrontal method*, ACM TOMS 12 (1986), for the order of
//! children.

use super::etree::{Elimination, NONE};
use super::permuted::Permuted;
use super::{Pattern, Permutation};
use crate::math::Lists;

/// Fraction of zeros up to which a merged block is kept, by its maximum number of columns: zeros cost multiplications, narrow blocks the
/// speed of the dense kernels, hence more of them are accepted in narrow blocks (the scheme of CHOLMOD).
const RELAXATION: [(u32, f64); 4] = [(4, 0.4), (16, 0.2), (48, 0.1), (u32::MAX, 0.05)];

/// Adjacent columns and the rows below them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block<'a> {
    /// First column.
    pub(super) first: usize,
    /// Number of columns.
    pub(super) width: usize,
    /// Rows below the block's own, ascending.
    pub(super) rows: &'a [u32],
}

/// All blocks of a factor; each comes after the blocks that send rows to it.
#[derive(Debug, Default)]
pub(super) struct Blocks {
    /// First column of each block, and the number of columns.
    firsts: Vec<u32>,
    /// Where the rows of each block start, and their number.
    starts: Vec<usize>,
    rows: Vec<u32>,
}

impl Blocks {
    pub(super) fn len(&self) -> usize {
        self.firsts.len().saturating_sub(1)
    }

    pub(super) fn get(&self, s: usize) -> Block<'_> {
        let (first, end) = (self.firsts[s] as usize, self.firsts[s + 1] as usize);
        Block { first, width: end - first, rows: &self.rows[self.starts[s]..self.starts[s + 1]] }
    }

    pub(super) fn iter(&self) -> impl DoubleEndedIterator<Item = Block<'_>> + ExactSizeIterator + Clone {
        (0..self.len()).map(|s| self.get(s))
    }

    /// The block whose columns contain the first row below each, [`NONE`] at roots.
    pub(super) fn parents(&self) -> Vec<u32> {
        let mut block_of = vec![NONE; self.firsts.last().map_or(0, |&n| n as usize)];
        for (s, block) in self.iter().enumerate() {
            block_of[block.first..block.first + block.width].fill(s as u32);
        }
        self.iter().map(|block| block.rows.first().map_or(NONE, |&row| block_of[row as usize])).collect()
    }
}

/// Where a factor has its entries, and in which blocks they are found.
#[derive(Debug)]
pub(super) struct Analysis {
    /// The elimination order, equivalent to the one asked for.
    pub(super) order: Permutation,
    /// Parent of each column in the elimination tree, larger than the column; [`NONE`] at roots.
    pub(super) parent: Vec<u32>,
    /// Entries of each column of the factor, its diagonal included.
    pub(super) counts: Vec<u32>,
    pub(super) permuted: Permuted,
    pub(super) blocks: Blocks,
}

impl Analysis {
    /// Multiplications of the factorization.
    pub(super) fn flops(&self) -> f64 {
        self.counts.iter().map(|&c| f64::from(c) * f64::from(c)).sum()
    }

    pub(super) fn new(pattern: &Pattern, order: &Permutation) -> Self {
        let Elimination { order, parent } = Elimination::postordered(pattern, order);
        let permuted = Permuted::new(pattern, &order);
        let elimination = Elimination { order, parent };
        let counts = elimination.column_counts(|j| permuted.column(j).iter().copied());
        let groups = Groups::new(&elimination.parent, &counts);
        let columns = groups.columns();
        let mut new = vec![NONE; columns.len()];
        columns.iter().enumerate().for_each(|(k, &j)| new[j as usize] = k as u32);
        let parent_of = |&j: &u32| new.get(elimination.parent[j as usize] as usize).copied().unwrap_or(NONE);
        let old = elimination.order.old_from_new();
        let order = Permutation::from_old_from_new(columns.iter().map(|&j| old[j as usize]).collect());
        let permuted = Permuted::new(pattern, &order);
        Self {
            parent: columns.iter().map(parent_of).collect(),
            counts: columns.iter().map(|&j| counts[j as usize]).collect(),
            blocks: groups.blocks(&permuted),
            permuted,
            order,
        }
    }
}

/// Columns of equal structure, and which of them are merged. Numbered as postorder left them: children first.
struct Groups {
    list: Vec<Group>,
    /// Groups that remain, in the order of elimination.
    order: Vec<u32>,
}

struct Group {
    first: u32,
    /// Columns of its own.
    width: u32,
    /// Columns with those merged into it.
    merged: u32,
    below: u32,
    /// Entries of the factor in all of them.
    entries: u64,
    parent: u32,
    /// The group this one is merged into, itself where it remains.
    into: u32,
}

impl Groups {
    fn new(parent: &[u32], counts: &[u32]) -> Self {
        let n = parent.len();
        let mut list: Vec<Group> = Vec::new();
        let mut group_of = vec![NONE; n];
        for j in 0..n {
            let continues = j > 0 && parent[j - 1] == j as u32 && counts[j - 1] == counts[j] + 1;
            if !continues {
                let (first, into) = (j as u32, list.len() as u32);
                list.push(Group { first, width: 0, merged: 0, below: 0, entries: 0, parent: NONE, into });
            }
            group_of[j] = list.len() as u32 - 1;
            let Some(group) = list.last_mut() else { continue };
            group.width += 1;
            group.merged += 1;
            group.below = counts[j] - 1;
            group.entries += u64::from(counts[j]);
            // Of the last column in the end.
            group.parent = parent[j];
        }
        for g in &mut list {
            g.parent = group_of.get(g.parent as usize).copied().unwrap_or(NONE);
        }
        let mut this = Self { list, order: Vec::new() };
        this.merge();
        this.put_in_order();
        this
    }

    /// Children of each group.
    fn children(&self) -> Lists<u32> {
        let child = |&(g, group): &(u32, &Group)| group.parent != NONE && group.into == g;
        let children = (0..).zip(&self.list).filter(child);
        Lists::new(self.list.len(), children.map(|(g, group)| (group.parent, g)))
    }

    /// Merges children into parents where that is inexpensive, those with the most rows first.
    fn merge(&mut self) {
        let mut all = self.children();
        for p in 0..self.list.len() {
            let children = all.of_mut(p);
            children.sort_by_key(|&c| std::cmp::Reverse((self.list[c as usize].below, c)));
            for &c in &*children {
                let (child, parent) = (&self.list[c as usize], &self.list[p]);
                let width = child.merged + parent.merged;
                let entries = child.entries + parent.entries;
                let stored = u64::from(width) * u64::from(width + 1) / 2 + u64::from(width) * u64::from(parent.below);
                let zeros = (stored - entries) as f64 / stored as f64;
                if RELAXATION.iter().any(|&(columns, fraction)| width <= columns && zeros <= fraction) {
                    (self.list[p].merged, self.list[p].entries) = (width, entries);
                    self.list[c as usize].into = p as u32;
                }
            }
        }
        // Parents come after their children: from the last, each finds its parent where that ended up.
        for g in (0..self.list.len()).rev() {
            let Group { parent, into, .. } = self.list[g];
            if into as usize != g {
                self.list[g].into = self.list[into as usize].into;
            } else if parent != NONE {
                self.list[g].parent = self.list[parent as usize].into;
            }
        }
    }

    /// Children before parents, and among the children of one parent in the order that keeps least waiting: by how much the
    /// highest stack within a child's subtree exceeds what it leaves behind.
    fn put_in_order(&mut self) {
        let mut all = self.children();
        let mut peak = vec![0_u64; self.list.len()];
        let left = |g: u32| u64::from(self.list[g as usize].below).pow(2);
        // A group that took in another has children of both, all of them before itself.
        for g in 0..self.list.len() {
            let children = all.of_mut(g);
            children.sort_by_key(|&c| std::cmp::Reverse((peak[c as usize] - left(c), c)));
            let mut waiting = 0;
            for &c in &*children {
                peak[g] = peak[g].max(waiting + peak[c as usize]);
                waiting += left(c);
            }
            peak[g] = peak[g].max(waiting + left(g as u32));
        }
        let mut next = vec![0; self.list.len()];
        for root in (0..self.list.len()).filter(|&g| self.list[g].into as usize == g && self.list[g].parent == NONE) {
            let mut path = vec![root];
            while let Some(&g) = path.last() {
                if let Some(&child) = all.of(g).get(next[g]) {
                    path.push(child as usize);
                    next[g] += 1;
                } else {
                    self.order.push(g as u32);
                    path.pop();
                }
            }
        }
    }

    /// Columns in the order of elimination.
    fn columns(&self) -> Vec<u32> {
        let mut at = vec![0_usize; self.list.len()];
        let mut total = 0;
        for &g in &self.order {
            at[g as usize] = total;
            total += self.list[g as usize].merged as usize;
        }
        let mut columns = vec![NONE; total];
        for group in &self.list {
            for j in group.first..group.first + group.width {
                columns[at[group.into as usize]] = j;
                at[group.into as usize] += 1;
            }
        }
        columns
    }

    /// The blocks with their rows: those of their columns in the matrix, and those that children leave.
    fn blocks(&self, permuted: &Permuted) -> Blocks {
        let n = permuted.starts.len() - 1;
        let place_of: Vec<u32> = {
            let mut position = vec![NONE; self.list.len()];
            self.order.iter().enumerate().for_each(|(k, &g)| position[g as usize] = k as u32);
            position
        };
        let (mut first_child, mut sibling) = (vec![NONE; self.order.len()], vec![NONE; self.order.len()]);
        let mut mark = vec![NONE; n];
        let mut blocks = Blocks { firsts: vec![0], starts: vec![0], rows: Vec::new() };
        for (s, &g) in self.order.iter().enumerate() {
            let group = &self.list[g as usize];
            let first = blocks.firsts[s];
            let end = first + group.merged;
            let start = blocks.rows.len();
            let Blocks { starts, rows, .. } = &mut blocks;
            for j in first..end {
                rows.extend(permuted.column(j as usize).iter().filter(|&&row| take(row, end, s, &mut mark)));
            }
            let mut child = first_child[s];
            while child != NONE {
                for k in starts[child as usize]..starts[child as usize + 1] {
                    let row = rows[k];
                    if take(row, end, s, &mut mark) {
                        rows.push(row);
                    }
                }
                child = sibling[child as usize];
            }
            rows[start..].sort_unstable();
            debug_assert_eq!(rows.len() - start, group.below as usize, "rows below columns {first}..{end}");
            starts.push(rows.len());
            blocks.firsts.push(end);
            if group.parent != NONE {
                let parent = place_of[group.parent as usize] as usize;
                sibling[s] = first_child[parent];
                first_child[parent] = s as u32;
            }
        }
        blocks
    }
}

/// True where `row` is at or after `end` and is met for the first time by block `s`.
fn take(row: u32, end: u32, s: usize, mark: &mut [u32]) -> bool {
    row >= end && std::mem::replace(&mut mark[row as usize], s as u32) != s as u32
}
