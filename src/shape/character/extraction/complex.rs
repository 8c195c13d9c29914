//! A triangle mesh under edge collapse, with the vertex that each vertex merged into.
//!
//! A half-edge collapse `i → j` removes the triangles at the edge and reassigns the others from `i` to `j`. It preserves the topology if the
//! *link condition* holds: the common neighbors of `i` and `j` are exactly those opposite to the edge, and an edge between two boundary
//! vertices is itself a boundary edge.
//!
//! # Reference
//! T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, Publ. Inst. Math. 66 (1999).

use std::collections::HashSet;

use nalgebra::{Point3, Vector3};

use super::budget::Budget;

/// Missing vertex or triangle.
pub(super) const NONE: u32 = u32::MAX;

/// A mesh under edge collapse.
#[derive(Clone)]
pub(super) struct Complex {
    /// Positions; those of merged vertices are meaningless.
    pub(super) positions: Vec<Point3<f64>>,
    /// Corners of the original triangles; `[NONE; 3]` for removed ones.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Triangles around each vertex; stale for merged ones.
    fans: Vec<Vec<u32>>,
    /// The vertex that each merged into; itself if alive.
    into: Vec<u32>,
    boundary: Vec<bool>,
    alive: usize,
    /// Collapses so far, in order.
    pub(super) collapses: Vec<Collapse>,
    /// Work left.
    pub(super) budget: Budget,
}

/// A collapse along an edge of a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Collapse {
    pub(super) gone: u32,
    pub(super) kept: u32,
    pub(super) triangle: u32,
    /// Corner indices in the triangle of the removed and the kept vertex.
    pub(super) corners: [u8; 2],
}

impl Complex {
    pub(super) fn new(positions: Vec<Point3<f64>>, triangles: Vec<[u32; 3]>) -> Self {
        let n = positions.len();
        let mut fans = vec![Vec::new(); n];
        for (t, corners) in triangles.iter().enumerate() {
            for v in corners {
                fans[*v as usize].push(t as u32);
            }
        }
        let mut this = Self {
            budget: Budget::new(triangles.len()),
            positions,
            triangles,
            fans,
            into: (0..n as u32).collect(),
            boundary: vec![false; n],
            alive: n,
            collapses: Vec::new(),
        };
        // Each triangle at an edge names its far end once: counted at all edges of a vertex together, a hub takes no square of its edges.
        let mut ends = Vec::new();
        for v in 0..n as u32 {
            this.edge_ends(v, &mut ends);
            this.boundary[v as usize] = ends.chunk_by(|a, b| a == b).any(|triangles| triangles.len() == 1);
        }
        this
    }

    /// Number of vertices that have not merged.
    pub(super) fn alive_count(&self) -> usize {
        self.alive
    }

    pub(super) fn is_alive(&self, v: u32) -> bool {
        self.into[v as usize] == v
    }

    /// Vertices that have not merged, ascending.
    pub(super) fn vertices(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.into.len() as u32).filter(|v| self.is_alive(*v))
    }

    /// The vertex that `v` merged into.
    pub(super) fn root(&self, mut v: u32) -> u32 {
        while self.into[v as usize] != v {
            v = self.into[v as usize];
        }
        v
    }

    /// Remaining triangles.
    pub(super) fn faces(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.triangles.iter().copied().filter(|t| t[0] != NONE)
    }

    /// Triangles around a vertex.
    pub(super) fn fan(&self, v: u32) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.fans[v as usize].iter().map(|t| self.triangles[*t as usize])
    }

    /// Neighbors of a vertex, ascending.
    pub(super) fn neighbors(&self, v: u32, into: &mut Vec<u32>) {
        self.edge_ends(v, into);
        into.dedup();
    }

    /// Neighbors of a vertex, ascending, each as often as triangles are at the edge.
    fn edge_ends(&self, v: u32, into: &mut Vec<u32>) {
        self.budget.visit(self.fans[v as usize].len());
        into.clear();
        for [a, b, c] in self.fan(v) {
            into.extend(if a == v {
                [b, c]
            } else if b == v {
                [a, c]
            } else {
                [a, b]
            });
        }
        into.sort_unstable();
    }

    fn edge_triangles(&self, a: u32, b: u32) -> impl Iterator<Item = u32> + '_ {
        self.fans[a as usize].iter().copied().filter(move |t| self.triangles[*t as usize].contains(&b))
    }

    /// Whether collapsing an edge preserves the topology.
    pub(super) fn link_condition(&self, i: u32, j: u32, around: &mut Vec<u32>) -> bool {
        // Everything is counted at the vertex with fewer triangles: the other may be a hub.
        let (slim, other) = if self.valence(i) <= self.valence(j) { (i, j) } else { (j, i) };
        self.neighbors(slim, around);
        let opposite = self.edge_triangles(slim, other).count();
        let shared = around.iter().filter(|v| self.are_adjacent(**v, other)).count();
        if opposite == 0 || shared != opposite {
            return false;
        }
        if self.boundary[i as usize] && self.boundary[j as usize] && opposite != 1 {
            return false;
        }
        // A tetrahedron or an isolated triangle would fold onto itself. Both bounds need the neighbors of the other only up to six.
        let (one, two) = (around.len(), self.neighbors_up_to_six(other));
        one.min(two) > if opposite == 1 { 2 } else { 3 } || (opposite == 2 && one + two > 6)
    }

    /// Number of triangles at a vertex.
    pub(super) fn valence(&self, v: u32) -> usize {
        self.fans[v as usize].len()
    }

    fn are_adjacent(&self, a: u32, b: u32) -> bool {
        let (slim, other) = if self.valence(a) <= self.valence(b) { (a, b) } else { (b, a) };
        self.budget.visit(self.valence(slim));
        a != b && self.edge_triangles(slim, other).next().is_some()
    }

    /// Number of neighbors of a vertex, six where there are more.
    fn neighbors_up_to_six(&self, v: u32) -> usize {
        let mut found = [NONE; 6];
        let mut count = 0;
        for u in self.fan(v).flatten().filter(|u| *u != v) {
            if count < found.len() && !found[..count].contains(&u) {
                found[count] = u;
                count += 1;
            }
            if count == found.len() {
                break;
            }
        }
        count
    }

    /// Twice the area vector of a triangle with `v` moved to `position`.
    fn normal_with(&self, t: [u32; 3], v: u32, position: &Point3<f64>) -> Vector3<f64> {
        let [a, b, c] = t.map(|u| if u == v { *position } else { self.positions[u as usize] });
        (b - a).cross(&(c - a))
    }

    /// Whether moving `i` onto `j` rotates the normal of a remaining triangle by more than about 80° (cosine 0.2).
    pub(super) fn would_fold(&self, i: u32, j: u32) -> bool {
        let position = self.positions[j as usize];
        self.budget.visit(self.valence(i));
        self.fan(i).filter(|t| !t.contains(&j)).any(|t| {
            let (before, after) =
                (self.normal_with(t, i, &self.positions[i as usize]), self.normal_with(t, i, &position));
            before.dot(&after) <= 0.2 * before.norm() * after.norm()
        })
    }

    /// Merges `i` into `j`, whose position is kept.
    pub(super) fn collapse(&mut self, i: u32, j: u32) {
        self.merge(i, j, |_| false);
    }

    /// As [`Self::collapse`]; a triangle that would have the corners of another vanishes.
    pub(super) fn collapse_without_doubles(&mut self, i: u32, j: u32) {
        self.budget.visit(self.valence(j));
        let mut there: HashSet<[u32; 3]> = self.fan(j).map(sorted).collect();
        self.merge(i, j, |moved| !there.insert(sorted(moved)));
    }

    /// Merges `i` into `j`; of the triangles without `j` those that are `dropped` after the move vanish.
    fn merge(&mut self, i: u32, j: u32, mut dropped: impl FnMut([u32; 3]) -> bool) {
        let corner = |corners: [u32; 3], v: u32| corners.iter().position(|c| *c == v).map(|k| k as u8);
        let mut losing = Vec::new();
        for t in std::mem::take(&mut self.fans[i as usize]) {
            let corners = self.triangles[t as usize];
            let moved = corners.map(|v| if v == i { j } else { v });
            if let (Some(from), Some(to)) = (corner(corners, i), corner(corners, j))
                && self.collapses.last().is_none_or(|c| c.gone != i)
            {
                self.collapses.push(Collapse { gone: i, kept: j, triangle: t, corners: [from, to] });
            }
            if corners.contains(&j) || dropped(moved) {
                losing.extend(corners.into_iter().filter(|v| *v != i));
                self.triangles[t as usize] = [NONE; 3];
            } else {
                self.triangles[t as usize] = moved;
                self.fans[j as usize].push(t);
            }
        }
        losing.sort_unstable();
        losing.dedup();
        for v in losing {
            self.budget.visit(self.fans[v as usize].len());
            self.fans[v as usize].retain(|t| self.triangles[*t as usize][0] != NONE);
        }
        self.into[i as usize] = j;
        self.boundary[j as usize] |= self.boundary[i as usize];
        self.alive -= 1;
    }

    /// Total area.
    pub(super) fn area(&self) -> f64 {
        self.faces().map(|t| 0.5 * self.normal_with(t, NONE, &Point3::origin()).norm()).sum()
    }
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles around one vertex: a disk whose rim is `n` vertices.
    fn fan(n: u32) -> Complex {
        let rim = |k: u32| std::f64::consts::TAU * f64::from(k) / f64::from(n);
        let rim = (0..n).map(|k| Point3::new(rim(k).cos(), rim(k).sin(), 0.0));
        let positions = std::iter::once(Point3::origin()).chain(rim).collect();
        Complex::new(positions, (0..n).map(|k| [0, 1 + k, 1 + (k + 1) % n]).collect())
    }

    /// Units of work of the link condition at every edge of the rim.
    fn work_at_rim(n: u32) -> u64 {
        let complex = fan(n);
        let before = complex.budget.left();
        let mut around = Vec::new();
        assert!((1..n).all(|k| complex.link_condition(k, k + 1, &mut around)));
        before - complex.budget.left()
    }

    #[test]
    fn the_work_at_a_hub_is_proportional_to_its_triangles() {
        assert!(work_at_rim(4000) <= 2 * work_at_rim(2000) + 100, "{} {}", work_at_rim(4000), work_at_rim(2000));
        let complex = fan(500);
        assert!(
            !complex.boundary[0] && complex.boundary[1..].iter().all(|on| *on),
            "the rim is the boundary, the hub is inside"
        );
    }

    #[test]
    fn of_two_triangles_that_become_one_a_single_one_is_left() {
        // Two triangles over the edge 1–2, whose apexes 0 and 3 are joined by a third one.
        let positions = (0..5).map(|k| Point3::new(f64::from(k), f64::from(k * k), 0.0)).collect();
        let mut complex = Complex::new(positions, vec![[0, 1, 2], [3, 2, 1], [0, 3, 4]]);
        complex.collapse_without_doubles(0, 3);
        assert_eq!(complex.faces().collect::<Vec<_>>(), [[3, 2, 1]]);
        assert_eq!([1, 2, 3, 4].map(|v| complex.valence(v)), [1, 1, 1, 0]);
    }
}
