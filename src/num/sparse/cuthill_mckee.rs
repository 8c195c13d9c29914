//! Reverse Cuthill–McKee: an order that keeps every non-zero near the diagonal.
//!
//! Number the unknowns by breadth-first search from one at the rim of its component, the neighbors of each by ascending
//! degree, and reverse the numbering. Fill then stays within the envelope of a narrow band: for long, thin systems,
//! and for seeing what a band costs beside a dissection (`O(n^{3/2})` entries in the plane, against `O(n log n)`).
//!
//! # Reference
//! E. Cuthill, J. McKee, *Reducing the bandwidth of sparse symmetric matrices*, ACM 1969; A. George, J. W. H. Liu, *Computer
//! Solution of Large Sparse Positive Definite Systems*, 1981, chapter 4 (the search for an initial vertex at the rim).

use super::{FactorStructure, Pattern, Permutation};
use crate::math::Lists;

/// The reverse Cuthill–McKee order: started from either end of each component, whichever fills less.
///
/// On a surface with limbs the two differ by a fifth, and the envelope, which is cheaper to count, may prefer the worse.
pub(super) fn reverse_cuthill_mckee(pattern: &Pattern) -> Permutation {
    let n = pattern.n();
    let mut search = Search { neighbors: pattern.adjacency(), depth: vec![UNSEEN; n] };
    let mut by_degree: Vec<u32> = (0..n as u32).collect();
    by_degree.sort_by_key(|&v| search.degree(v));
    let (mut from_one, mut from_other) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for seed in by_degree {
        if search.depth[seed as usize] == UNSEEN {
            let [one, other] = search.rim(seed);
            let component = search.breadth_first(other);
            search.forget(&component);
            from_other.extend(component);
            from_one.extend(search.breadth_first(one));
        }
    }
    let [one, other] = [from_one, from_other].map(|mut order: Vec<u32>| {
        order.reverse();
        Permutation::from_old_from_new(order)
    });
    let fill = |order: &Permutation| FactorStructure::of_order(pattern, order).nnz();
    if fill(&other) < fill(&one) { other } else { one }
}

/// Not numbered yet.
const UNSEEN: u32 = u32::MAX;

struct Search {
    neighbors: Lists<u32>,
    /// Distance from the root of the last search, [`UNSEEN`] in components not yet reached.
    depth: Vec<u32>,
}

impl Search {
    fn degree(&self, v: u32) -> usize {
        self.neighbors.of(v as usize).len()
    }

    /// The component of `root` in breadth-first order, siblings by ascending degree.
    fn breadth_first(&mut self, root: u32) -> Vec<u32> {
        self.depth[root as usize] = 0;
        let (mut found, mut next) = (vec![root], 0);
        while next < found.len() {
            let (v, first) = (found[next], found.len());
            for &w in self.neighbors.of(v as usize) {
                if self.depth[w as usize] == UNSEEN {
                    self.depth[w as usize] = self.depth[v as usize] + 1;
                    found.push(w);
                }
            }
            found[first..].sort_by_key(|&w| self.degree(w));
            next += 1;
        }
        found
    }

    /// Makes the unknowns as if never reached.
    fn forget(&mut self, found: &[u32]) {
        for &v in found {
            self.depth[v as usize] = UNSEEN;
        }
    }

    /// Two unknowns about as far apart as any: search on from the last level's lowest degree while depth grows.
    fn rim(&mut self, seed: u32) -> [u32; 2] {
        let (mut root, mut height) = (seed, None);
        loop {
            let found = self.breadth_first(root);
            let depth = |v: u32| self.depth[v as usize];
            let deepest = found.last().map_or(0, |&v| depth(v));
            let farthest = found.iter().copied().filter(|&v| depth(v) == deepest).min_by_key(|&v| self.degree(v));
            let farthest = farthest.unwrap_or(root);
            self.forget(&found);
            if height.is_some_and(|h| deepest <= h) {
                return [root, farthest];
            }
            (root, height) = (farthest, Some(deepest));
        }
    }
}
