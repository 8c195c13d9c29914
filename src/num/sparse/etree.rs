//! Elimination tree of a permuted pattern, its postorder, and the sizes of the factor's columns.
//!
//! Column `p` is the parent of `j` when `p` is the first row below the diagonal in column `j` of the Cholesky factor.
//! Numbering columns by a postorder of that tree changes neither fill nor arithmetic, but puts columns with equal
//! structure side by side: without it a supernodal factorization finds only fragments.
//!
//! # Reference
//! Liu 1990; Davis 2006, sections 4.1 and 4.5; J. R. Gilbert, E. G. Ng, B. W. Peyton, *An efficient algorithm to compute row
//! and column counts for sparse Cholesky factorization*, SIAM J. Matrix Anal. Appl. 15 (1994).

use super::{Pattern, Permutation};

/// No parent, no child, no sibling.
pub(super) const NONE: u32 = u32::MAX;

/// Parent of each column of the factor of `P A Pᵀ`, [`NONE`] at roots.
fn elimination_tree(pattern: &Pattern, order: &Permutation) -> Vec<u32> {
    let neighbors = pattern.adjacency();
    let n = pattern.n();
    let (mut parent, mut ancestor) = (vec![NONE; n], vec![NONE; n]);
    for row in 0..n {
        let old = order.old_from_new()[row] as usize;
        for &neighbor in neighbors.of(old) {
            // Climb from each column left of `row` to its root, compressing the path.
            let mut j = order.new_from_old()[neighbor as usize];
            while j != NONE && (j as usize) < row {
                let next = ancestor[j as usize];
                ancestor[j as usize] = row as u32;
                if next == NONE {
                    parent[j as usize] = row as u32;
                }
                j = next;
            }
        }
    }
    parent
}

/// Nodes of a forest, each after all its descendants.
fn postorder(parent: &[u32]) -> Vec<u32> {
    let n = parent.len();
    let (mut first_child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
    for j in (0..n).rev() {
        if parent[j] != NONE {
            sibling[j] = first_child[parent[j] as usize];
            first_child[parent[j] as usize] = j as u32;
        }
    }
    let mut order = Vec::with_capacity(n);
    for root in (0..n as u32).filter(|&j| parent[j as usize] == NONE) {
        let mut stack = vec![root];
        while let Some(&v) = stack.last() {
            let child = first_child[v as usize];
            if child == NONE {
                order.push(v);
                stack.pop();
            } else {
                first_child[v as usize] = sibling[child as usize];
                stack.push(child);
            }
        }
    }
    order
}

/// An elimination order whose columns of equal structure are adjacent, and what the tree says of its factor.
#[derive(Debug)]
pub(super) struct Elimination {
    /// The order, postordered.
    pub(super) order: Permutation,
    /// Parent of each column, larger than the column; [`NONE`] at roots.
    pub(super) parent: Vec<u32>,
}

impl Elimination {
    /// The same order up to exchanges that leave the factor alone.
    pub(super) fn postordered(pattern: &Pattern, order: &Permutation) -> Self {
        let tree = elimination_tree(pattern, order);
        let post = postorder(&tree);
        let mut rank = vec![NONE; post.len()];
        for (new, &k) in post.iter().enumerate() {
            rank[k as usize] = new as u32;
        }
        let parent_of = |&k: &u32| rank.get(tree[k as usize] as usize).copied().unwrap_or(NONE);
        Self {
            parent: post.iter().map(parent_of).collect(),
            order: Permutation::from_old_from_new(post.iter().map(|&k| order.old_from_new()[k as usize]).collect()),
        }
    }

    /// Entries of each column of the factor, its diagonal included.
    ///
    /// `rows_of(j)` are the rows of column `j` of the permuted lower triangle. Row `i` of the factor is the subtree of
    /// columns between `i` and the leaves it has entries in; a column counts the leaves below it that start such a subtree,
    /// less the columns where two branches of one subtree meet (Gilbert, Ng, Peyton 1994).
    pub(super) fn column_counts<I: IntoIterator<Item = u32>>(&self, rows_of: impl Fn(usize) -> I) -> Vec<u32> {
        let n = self.parent.len();
        let first = self.first_descendants();
        let mut count: Vec<i64> = (0..n).map(|j| i64::from(first[j] == j as u32)).collect();
        let (mut last_leaf, mut last_first) = (vec![NONE; n], vec![NONE; n]);
        let mut ancestor: Vec<u32> = (0..n as u32).collect();
        for j in 0..n {
            for i in rows_of(j).into_iter().filter(|&i| i as usize > j) {
                let i = i as usize;
                // `j` is a leaf of the subtree of row `i` unless that has an entry below `j`.
                if last_first[i] != NONE && first[j] <= last_first[i] {
                    continue;
                }
                count[j] += 1;
                if last_leaf[i] != NONE {
                    count[root_of(&mut ancestor, last_leaf[i]) as usize] -= 1;
                }
                (last_first[i], last_leaf[i]) = (first[j], j as u32);
            }
            if self.parent[j] != NONE {
                count[self.parent[j] as usize] -= 1;
                ancestor[j] = self.parent[j];
            }
        }
        for j in 0..n {
            if self.parent[j] != NONE {
                count[self.parent[j] as usize] += count[j];
            }
        }
        count.into_iter().map(|c| c as u32).collect()
    }

    /// Smallest column of each subtree.
    fn first_descendants(&self) -> Vec<u32> {
        let mut first: Vec<u32> = (0..self.parent.len() as u32).collect();
        for j in 0..first.len() {
            if self.parent[j] != NONE {
                let p = self.parent[j] as usize;
                first[p] = first[p].min(first[j]);
            }
        }
        first
    }
}

/// Last node on the path up from `k`, compressing that path.
fn root_of(ancestor: &mut [u32], k: u32) -> u32 {
    let mut root = k;
    while ancestor[root as usize] != root {
        root = ancestor[root as usize];
    }
    let mut k = k;
    while k != root {
        k = std::mem::replace(&mut ancestor[k as usize], root);
    }
    root
}
