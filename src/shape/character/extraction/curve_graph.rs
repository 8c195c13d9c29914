//! An editable curve skeleton: nodes that merge, edges, and the node of each surface vertex.

use nalgebra::Point3;

use super::complex::NONE;

/// Nodes connected by edges.
#[derive(Clone, Debug, Default)]
pub(super) struct CurveGraph {
    pub(super) nodes: Vec<Point3<f64>>,
    pub(super) pinned: Vec<bool>,
    neighbors: Vec<Vec<u32>>,
    into: Vec<u32>,
    node_of_vertex: Vec<u32>,
}

/// A chain of nodes between two ends or junctions; a loop starts and ends with the same node.
pub(super) type Branch = Vec<u32>;

impl CurveGraph {
    pub(super) fn new(nodes: Vec<Point3<f64>>, edges: &[[u32; 2]], node_of_vertex: Vec<u32>) -> Self {
        let mut neighbors = vec![Vec::new(); nodes.len()];
        for &[a, b] in edges {
            neighbors[a as usize].push(b);
            neighbors[b as usize].push(a);
        }
        let into = (0..nodes.len() as u32).collect();
        Self { pinned: vec![false; nodes.len()], nodes, neighbors, into, node_of_vertex }
    }

    pub(super) fn is_alive(&self, v: u32) -> bool {
        self.into[v as usize] == v
    }

    pub(super) fn alive(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.nodes.len() as u32).filter(|v| self.is_alive(*v))
    }

    pub(super) fn neighbors(&self, v: u32) -> &[u32] {
        &self.neighbors[v as usize]
    }

    pub(super) fn degree(&self, v: u32) -> usize {
        self.neighbors[v as usize].len()
    }

    pub(super) fn length(&self, a: u32, b: u32) -> f64 {
        nalgebra::distance(&self.nodes[a as usize], &self.nodes[b as usize])
    }

    /// Node of a surface vertex.
    pub(super) fn node_of(&self, vertex: usize) -> u32 {
        let mut v = self.node_of_vertex[vertex];
        while v != NONE && self.into[v as usize] != v {
            v = self.into[v as usize];
        }
        v
    }

    /// Merges `i` into its neighbor `j`. Parallel edges merge.
    pub(super) fn merge(&mut self, i: u32, j: u32) {
        for k in std::mem::take(&mut self.neighbors[i as usize]) {
            let of_k = &mut self.neighbors[k as usize];
            let slot = of_k.iter().position(|v| *v == i).expect("edges are known at both ends");
            if k == j || of_k.contains(&j) {
                of_k.swap_remove(slot);
            } else {
                of_k[slot] = j;
                self.neighbors[j as usize].push(k);
            }
        }
        self.into[i as usize] = j;
        self.pinned[j as usize] |= self.pinned[i as usize];
    }

    /// Appends a node to the end of a branch.
    pub(super) fn append(&mut self, end: u32, position: Point3<f64>) -> u32 {
        let new = self.nodes.len() as u32;
        self.nodes.push(position);
        self.pinned.push(false);
        self.into.push(new);
        self.neighbors.push(vec![end]);
        self.neighbors[end as usize].push(new);
        new
    }

    /// Splits an edge by a new node.
    pub(super) fn split(&mut self, a: u32, b: u32, position: Point3<f64>) -> u32 {
        let new = self.nodes.len() as u32;
        self.nodes.push(position);
        self.pinned.push(false);
        self.into.push(new);
        self.neighbors.push(vec![a, b]);
        for (from, to) in [(a, b), (b, a)] {
            if let Some(spoke) = self.neighbors[from as usize].iter_mut().find(|v| **v == to) {
                *spoke = new;
            }
        }
        new
    }

    /// All branches between ends and junctions, each once; loops without either start at their first node.
    pub(super) fn branches(&self) -> Vec<Branch> {
        let mut seen = vec![false; self.nodes.len()];
        let mut branches = Vec::new();
        let knots: Vec<u32> = self.alive().filter(|v| self.degree(*v) != 2).collect();
        for &v in &knots {
            for &to in self.neighbors(v) {
                let branch = self.row(v, to, f64::INFINITY);
                let last = branch[branch.len() - 1];
                let inner = branch.get(1..branch.len() - 1).unwrap_or_default();
                let first_time = match inner.first() {
                    Some(first) => !seen[*first as usize],
                    None => v < last,
                };
                if first_time {
                    for v in inner {
                        seen[*v as usize] = true;
                    }
                    branches.push(branch);
                }
            }
        }
        for v in self.alive() {
            if self.degree(v) == 2 && !seen[v as usize] {
                let branch = self.row(v, self.neighbors(v)[0], f64::INFINITY);
                for v in &branch {
                    seen[*v as usize] = true;
                }
                branches.push(branch);
            }
        }
        branches
    }

    /// The chain from a node toward its neighbor `to`, until a node is at distance `reach` or the branch ends.
    pub(super) fn row(&self, from: u32, to: u32, reach: f64) -> Branch {
        let mut row = vec![from, to];
        let (mut before, mut at) = (from, to);
        while self.degree(at) == 2 && at != from && self.length(from, at) < reach {
            let next = self.neighbors(at).iter().copied().find(|v| *v != before).unwrap_or(before);
            row.push(next);
            (before, at) = (at, next);
        }
        row
    }

    /// The chain of a branch from its end, until a node is at distance `reach` or the branch ends; only the end itself if isolated.
    pub(super) fn row_back(&self, end: u32, reach: f64) -> Branch {
        self.neighbors(end).first().map_or_else(|| vec![end], |to| self.row(end, *to, reach))
    }

    /// Ends that are not pinned.
    pub(super) fn free_ends(&self) -> Vec<u32> {
        self.alive().filter(|v| self.degree(*v) == 1 && !self.pinned[*v as usize]).collect()
    }

    /// The branch from a junction to an unpinned end; none if the node is no such end.
    pub(super) fn limb(&self, end: u32) -> Option<Branch> {
        if !self.is_alive(end) || self.degree(end) != 1 || self.pinned[end as usize] {
            return None;
        }
        let mut branch = self.row_back(end, f64::INFINITY);
        branch.reverse();
        (self.degree(branch[0]) >= 3).then_some(branch)
    }

    /// Merges a chain of nodes into its first.
    pub(super) fn remove_branch(&mut self, row: &[u32]) {
        for pair in row.windows(2).rev() {
            self.merge(pair[1], pair[0]);
        }
    }

    /// Length of a branch.
    pub(super) fn branch_length(&self, branch: &[u32]) -> f64 {
        branch.windows(2).map(|w| self.length(w[0], w[1])).sum()
    }

    pub(super) fn vertex_count(&self) -> usize {
        self.node_of_vertex.len()
    }
}
