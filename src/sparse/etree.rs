//! Elimination tree of a permuted pattern, and its postorder.
//!
//! Column `p` is the parent of `j` when `p` is the first row below the diagonal in column `j` of the Cholesky factor.
//! Numbering columns by a postorder of that tree changes neither fill nor arithmetic, but puts columns with equal
//! structure side by side: without it a supernodal factorization finds only fragments.
//!
//! # Reference
//! Liu 1990; Davis 2006, sections 4.1 and 4.5.

use super::{Pattern, Permutation};

const NONE: u32 = u32::MAX;

/// Parent of each column of the factor of `P A Pᵀ`, [`NONE`] at roots.
fn elimination_tree(pattern: &Pattern, order: &Permutation) -> Vec<u32> {
    let (start, neighbors) = pattern.adjacency();
    let n = pattern.n();
    let (mut parent, mut ancestor) = (vec![NONE; n], vec![NONE; n]);
    for row in 0..n {
        let old = order.old_from_new()[row] as usize;
        for &neighbor in &neighbors[start[old] as usize..start[old + 1] as usize] {
            // Climb from each column left of `row` to its root, compressing the path on the way.
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

/// The same elimination order up to exchanges that leave the factor alone, columns of equal structure adjacent.
pub(super) fn postordered(pattern: &Pattern, order: &Permutation) -> Permutation {
    let post = postorder(&elimination_tree(pattern, order));
    let old_from_new = post.iter().map(|&k| order.old_from_new()[k as usize]).collect();
    Permutation::from_old_from_new(old_from_new)
}
