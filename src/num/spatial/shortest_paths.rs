//! Shortest paths from a node of a graph to all others.
//!
//! # Reference
//! E. W. Dijkstra, *A note on two problems in connexion with graphs*, Numerische Mathematik 1, 1959.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No node.
const NONE: u32 = u32::MAX;

/// Shortest paths from one or more nodes.
#[derive(Clone, Debug)]
pub struct ShortestPaths {
    /// Length to each node; infinite where no path leads.
    pub length: Vec<f64>,
    before: Vec<u32>,
}

impl ShortestPaths {
    /// The paths among `nodes` nodes from those of `from`; `edges` lists the ends of the edges from a node and their lengths,
    /// none negative.
    pub fn new<E: IntoIterator<Item = (u32, f64)>>(
        nodes: usize,
        from: impl IntoIterator<Item = u32>,
        edges: impl Fn(u32) -> E,
    ) -> Self {
        Self::search(nodes, from, None, edges)
    }

    /// The nodes of a shortest path, both ends included; `None` where none leads. As [`Self::new`], but searched only as far as
    /// the path is long.
    pub fn between<E: IntoIterator<Item = (u32, f64)>>(
        nodes: usize,
        from: u32,
        to: u32,
        edges: impl Fn(u32) -> E,
    ) -> Option<Vec<u32>> {
        let paths = Self::search(nodes, [from], Some(to), edges);
        let mut path = paths.back_from(to);
        path.reverse();
        paths.length[to as usize].is_finite().then_some(path)
    }

    /// The paths that are no longer than that to `end`.
    fn search<E: IntoIterator<Item = (u32, f64)>>(
        nodes: usize,
        from: impl IntoIterator<Item = u32>,
        end: Option<u32>,
        edges: impl Fn(u32) -> E,
    ) -> Self {
        let mut paths = Self { length: vec![f64::INFINITY; nodes], before: vec![NONE; nodes] };
        // Lengths are not negative: their bits are in the order of their values.
        let mut queue = BinaryHeap::new();
        for v in from {
            paths.length[v as usize] = 0.0;
            queue.push(Reverse((0_u64, v)));
        }
        while let Some(Reverse((bits, v))) = queue.pop() {
            let length = f64::from_bits(bits);
            if end == Some(v) {
                break;
            }
            if length > paths.length[v as usize] {
                continue;
            }
            for (u, edge) in edges(v) {
                let through = length + edge;
                if through < paths.length[u as usize] {
                    (paths.length[u as usize], paths.before[u as usize]) = (through, v);
                    queue.push(Reverse((through.to_bits(), u)));
                }
            }
        }
        paths
    }

    /// The node before another on the path to it; `None` where the path begins, or none leads.
    pub fn before(&self, node: u32) -> Option<u32> {
        Some(self.before[node as usize]).filter(|v| *v != NONE)
    }

    /// The nodes from `to` back to where its path begins, both included.
    pub fn back_from(&self, to: u32) -> Vec<u32> {
        std::iter::successors(Some(to), |v| self.before(*v)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_those_that_relaxing_all_edges_finds_and_paths_add_up() {
        let mut rng = fastrand::Rng::with_seed(2);
        let mut edges: Vec<(u32, u32, f64)> =
            (0..120).map(|_| (rng.u32(0..40), rng.u32(0..40), f64::from(rng.u32(0..5)))).collect();
        edges.retain(|e| e.0 != 39 && e.1 != 39);
        let paths = ShortestPaths::new(40, [3, 8], |v| {
            let from = move |&(a, b, length): &(u32, u32, f64)| (a == v).then_some((b, length));
            edges.iter().filter_map(from)
        });
        let mut length = [f64::INFINITY; 40];
        (length[3], length[8]) = (0.0, 0.0);
        for _ in 0..40 {
            for &(a, b, edge) in &edges {
                length[b as usize] = length[b as usize].min(length[a as usize] + edge);
            }
        }
        assert_eq!(paths.length, length);
        assert!(length[39].is_infinite() && paths.back_from(39) == [39]);
        for v in (0..39).filter(|v| length[*v as usize].is_finite()) {
            let path = paths.back_from(v);
            assert!([3, 8].contains(path.last().unwrap()));
            for step in path.windows(2) {
                let edge = length[step[0] as usize] - length[step[1] as usize];
                assert!(edges.contains(&(step[1], step[0], edge)));
            }
        }
    }
}
