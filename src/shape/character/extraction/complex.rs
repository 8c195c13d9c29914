//! A triangle mesh under edge collapse, with the vertex that each vertex merged into.
//!
//! A half-edge collapse `i → j` removes the triangles at the edge and reassigns the others from `i` to `j`. It preserves the topology if the
//! *link condition* holds: the common neighbors of `i` and `j` are exactly those opposite to the edge, and an edge between two boundary
//! vertices is itself a boundary edge.
//!
//! # Reference
//! T. K. Dey, H. Edelsbrunner, S. Guha, D. V. Nekhayev, *Topology preserving edge contraction*, Publ. Inst. Math. 66 (1999).

use nalgebra::{Point3, Vector3};

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
            positions,
            triangles,
            fans,
            into: (0..n as u32).collect(),
            boundary: vec![false; n],
            alive: n,
            collapses: Vec::new(),
        };
        let mut neighbors = Vec::new();
        for v in 0..n as u32 {
            this.neighbors(v, &mut neighbors);
            this.boundary[v as usize] = neighbors.iter().any(|u| this.edge_triangles(v, *u).count() == 1);
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
        into.dedup();
    }

    fn edge_triangles(&self, a: u32, b: u32) -> impl Iterator<Item = u32> + '_ {
        self.fans[a as usize].iter().copied().filter(move |t| self.triangles[*t as usize].contains(&b))
    }

    /// Whether collapsing an edge preserves the topology.
    pub(super) fn link_condition(&self, i: u32, j: u32, scratch: &mut [Vec<u32>; 2]) -> bool {
        let [of_i, of_j] = scratch;
        self.neighbors(i, of_i);
        self.neighbors(j, of_j);
        let opposite = self.edge_triangles(i, j).count();
        let shared = of_i.iter().filter(|v| of_j.binary_search(v).is_ok()).count();
        if opposite == 0 || shared != opposite {
            return false;
        }
        if self.boundary[i as usize] && self.boundary[j as usize] && opposite != 1 {
            return false;
        }
        // A tetrahedron or an isolated triangle would fold onto itself.
        of_i.len().min(of_j.len()) > if opposite == 1 { 2 } else { 3 } || (opposite == 2 && of_i.len() + of_j.len() > 6)
    }

    /// Twice the area vector of a triangle with `v` moved to `position`.
    fn normal_with(&self, t: [u32; 3], v: u32, position: &Point3<f64>) -> Vector3<f64> {
        let [a, b, c] = t.map(|u| if u == v { *position } else { self.positions[u as usize] });
        (b - a).cross(&(c - a))
    }

    /// Whether moving `i` onto `j` rotates the normal of a remaining triangle by more than about 80° (cosine 0.2).
    pub(super) fn would_fold(&self, i: u32, j: u32) -> bool {
        let position = self.positions[j as usize];
        self.fan(i).filter(|t| !t.contains(&j)).any(|t| {
            let (before, after) =
                (self.normal_with(t, i, &self.positions[i as usize]), self.normal_with(t, i, &position));
            before.dot(&after) <= 0.2 * before.norm() * after.norm()
        })
    }

    /// Merges `i` into `j`, whose position is kept.
    pub(super) fn collapse(&mut self, i: u32, j: u32) {
        self.merge(i, j, |_, _| false);
    }

    /// As [`Self::collapse`]; a triangle that would have the corners of another vanishes.
    pub(super) fn collapse_without_doubles(&mut self, i: u32, j: u32) {
        let sorted = |mut corners: [u32; 3]| {
            corners.sort_unstable();
            corners
        };
        self.merge(i, j, |this, moved| this.fan(j).any(|other| sorted(other) == sorted(moved)));
    }

    /// Merges `i` into `j`; of the triangles without `j` those that are `dropped` after the move vanish.
    fn merge(&mut self, i: u32, j: u32, dropped: impl Fn(&Self, [u32; 3]) -> bool) {
        let corner = |corners: [u32; 3], v: u32| corners.iter().position(|c| *c == v).map(|k| k as u8);
        for t in std::mem::take(&mut self.fans[i as usize]) {
            let corners = self.triangles[t as usize];
            let moved = corners.map(|v| if v == i { j } else { v });
            if let (Some(from), Some(to)) = (corner(corners, i), corner(corners, j))
                && self.collapses.last().is_none_or(|c| c.gone != i)
            {
                self.collapses.push(Collapse { gone: i, kept: j, triangle: t, corners: [from, to] });
            }
            if corners.contains(&j) || dropped(self, moved) {
                for v in corners.into_iter().filter(|v| *v != i) {
                    self.fans[v as usize].retain(|u| *u != t);
                }
                self.triangles[t as usize] = [NONE; 3];
            } else {
                self.triangles[t as usize] = moved;
                self.fans[j as usize].push(t);
            }
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
