//! Half-edge collapses: validity and cost.
//!
//! A collapse `u → v` moves a vertex `u` to a fixed neighbor `v`: the triangles at the edge are removed, the others at `u` get `v`
//! instead. The cost is the quadric error of both at `v` plus a multiple of `area(u) ‖v − u‖²`, which keeps the spacing uniform
//! on flat parts, since the coarse mesh is used for solving.

use nalgebra::{Point3, Vector3};

use super::quadric::Quadric;
use crate::mesh::TriMesh;

/// Weight of `area ‖v − u‖²` in the cost: the quadric error dominates where the surface bends by over 20° along the edge. Much
/// smaller values give slivers on flat parts, much larger ones remove spikes.
const SPACING_WEIGHT: f64 = 0.1;
/// Weight of the planes along the boundary, over squared edges: a corner of a sheet then costs more than any spacing term.
const BOUNDARY_WEIGHT: f64 = 100.0;
/// Minimum cosine of the rotation of a triangle normal in one collapse: beyond about 70° folds accumulate over collapses.
const MIN_ROTATION_COSINE: f64 = 0.3;
/// Minimum quality of a triangle: twice the area over the sum of squared edges (√3/6 ≈ 0.29 for equilateral triangles). Collapses
/// that create a worse triangle are rejected, unless it was as bad before.
const MIN_QUALITY: f64 = 0.03;
/// Maximum valence after a collapse: dense rows fill in the factors.
const MAX_NEIGHBORS: usize = 14;
/// End of a list of corners.
const NONE: u32 = u32::MAX;

/// A neighbor, and the number of triangles at the edge to it.
pub(super) type Neighbor = (u32, u32);

/// A mesh under simplification.
pub(super) struct Collapser<'a> {
    positions: &'a [Point3<f64>],
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Corners `3 t + k` of the triangles at each vertex, as linked lists; corners of removed triangles are skipped.
    first: Vec<u32>,
    last: Vec<u32>,
    next: Vec<u32>,
    triangle_count: Vec<u32>,
    quadrics: Vec<Quadric>,
    /// Not removable.
    pinned: Vec<bool>,
    mark: Vec<u32>,
    stamp: u32,
    ring: Vec<Neighbor>,
}

impl<'a> Collapser<'a> {
    pub(super) fn new(mesh: &'a TriMesh, keep: &[u32]) -> Self {
        let n = mesh.vertex_count();
        let triangles = mesh.triangles().to_vec();
        let alive = triangles.iter().map(|&[a, b, c]| a != b && b != c && c != a).collect();
        let mut made = Self {
            positions: mesh.positions(),
            alive,
            first: vec![NONE; n],
            last: vec![NONE; n],
            next: vec![NONE; 3 * triangles.len()],
            triangle_count: vec![0; n],
            quadrics: vec![Quadric::default(); n],
            pinned: pinned(mesh, keep),
            mark: vec![0; n],
            stamp: 0,
            ring: Vec::new(),
            triangles,
        };
        made.chain();
        made.measure(mesh);
        made
    }

    fn chain(&mut self) {
        for t in (0..self.triangles.len()).filter(|&t| self.alive[t]) {
            for k in 0..3 {
                let (v, corner) = (self.triangles[t][k] as usize, (3 * t + k) as u32);
                match self.last[v] {
                    NONE => self.first[v] = corner,
                    before => self.next[before as usize] = corner,
                }
                self.last[v] = corner;
                self.triangle_count[v] += 1;
            }
        }
    }

    /// Quadrics of the planes of the triangles, and of perpendicular planes through boundary edges.
    fn measure(&mut self, mesh: &TriMesh) {
        for t in (0..self.triangles.len()).filter(|&t| self.alive[t]) {
            let doubled = mesh.area_normal(t);
            let Some(n) = doubled.try_normalize(0.0) else { continue };
            let area = 0.5 * doubled.norm() / 3.0;
            for v in self.triangles[t].map(|v| v as usize) {
                self.quadrics[v].add_plane(&n, 0.0, area);
                self.quadrics[v].area += area;
            }
        }
        for u in 0..self.positions.len() {
            self.gather(u);
            for i in 0..self.ring.len() {
                let (w, count) = self.ring[i];
                if count == 1 && u < w as usize {
                    self.add_boundary_plane(mesh, u, w as usize);
                }
            }
        }
    }

    /// Adds the plane through a boundary edge, perpendicular to its triangle.
    fn add_boundary_plane(&mut self, mesh: &TriMesh, u: usize, w: usize) {
        let triangle = self.corners_of(u).find(|&c| self.triangles[c as usize / 3].contains(&(w as u32)));
        let edge = self.positions[w] - self.positions[u];
        let normal = triangle.map(|c| mesh.area_normal(c as usize / 3).cross(&edge));
        let Some(n) = normal.and_then(|n| n.try_normalize(0.0)) else { return };
        for v in [u, w] {
            self.quadrics[v].add_plane(&n, 0.0, BOUNDARY_WEIGHT * edge.norm_squared());
        }
    }

    /// Corners at `v`, as `3 t + k`.
    fn corners_of(&self, v: usize) -> impl Iterator<Item = u32> + '_ {
        let from = |c: u32| (c != NONE).then_some(c);
        std::iter::successors(from(self.first[v]), move |&c| from(self.next[c as usize]))
            .filter(|&c| self.alive[c as usize / 3])
    }

    /// The two other vertices of the triangles at `v`, in the triangle's order.
    pub(super) fn opposite(&self, v: usize) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.corners_of(v).map(|c| {
            let (t, k) = (c as usize / 3, c as usize % 3);
            [self.triangles[t][(k + 1) % 3], self.triangles[t][(k + 2) % 3]]
        })
    }

    /// Fills `self.ring` with the neighbors of `u`, and unlinks the corners of removed triangles from the list of `u`.
    fn gather(&mut self, u: usize) {
        self.ring.clear();
        let (mut corner, mut before) = (self.first[u], NONE);
        while corner != NONE {
            let (t, k) = (corner as usize / 3, corner as usize % 3);
            let next = self.next[corner as usize];
            if self.alive[t] {
                let [a, b, c] = self.triangles[t];
                for w in [[b, c], [c, a], [a, b]][k] {
                    match self.ring.iter_mut().find(|(v, _)| *v == w) {
                        Some((_, count)) => *count += 1,
                        None => self.ring.push((w, 1)),
                    }
                }
                before = corner;
            } else if before == NONE {
                self.first[u] = next;
            } else {
                self.next[before as usize] = next;
            }
            corner = next;
        }
        self.last[u] = before;
    }

    /// Neighbors of `u`.
    pub(super) fn ring(&mut self, u: usize) -> &[Neighbor] {
        self.gather(u);
        &self.ring
    }

    /// The neighbors of the last query.
    pub(super) fn last_ring(&self) -> &[Neighbor] {
        &self.ring
    }

    /// The neighbor of least collapse cost for `u`, and the cost; `None` if `u` must stay.
    ///
    /// Pinned vertices and ends of non-manifold edges stay; boundary vertices collapse along the boundary.
    pub(super) fn best(&mut self, u: usize) -> Option<(u32, f64)> {
        self.gather(u);
        let boundary = self.ring.iter().any(|&(_, count)| count == 1);
        if self.pinned[u] || self.ring.iter().any(|&(_, count)| count > 2) {
            return None;
        }
        let quadric = &self.quadrics[u];
        let cost = |w: u32| {
            let step = self.positions[w as usize] - self.positions[u];
            let spacing = SPACING_WEIGHT * quadric.area * step.norm_squared();
            quadric.at(&step) + self.quadrics[w as usize].here() + spacing
        };
        let along = self.ring.iter().filter(|&&(_, count)| !boundary || count == 1);
        along.map(|&(w, _)| (w, cost(w))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// True if the collapse `u → v` preserves the topology (link condition) and inverts or degenerates no triangle.
    pub(super) fn allowed(&mut self, u: usize, v: usize) -> bool {
        self.stamp += 1;
        let stamp = self.stamp;
        self.gather(v);
        let at_v = self.ring.len();
        for i in 0..at_v {
            self.mark[self.ring[i].0 as usize] = stamp;
        }
        self.gather(u);
        let Some(&(_, shared)) = self.ring.iter().find(|&&(w, _)| w as usize == v) else { return false };
        let common = self.ring.iter().filter(|&&(w, _)| self.mark[w as usize] == stamp).count();
        let left = self.triangle_count[u] + self.triangle_count[v] - 2 * shared;
        let neighbors = at_v + self.ring.len() - 2 - common;
        common == shared as usize
            && left > 0
            && neighbors <= MAX_NEIGHBORS
            && self.opposite(u).all(|pair| self.stays_valid(u, v, pair, stamp))
    }

    /// Whether a triangle at `u` is valid after the collapse `u → v`; the neighbors of `v` are marked.
    fn stays_valid(&self, u: usize, v: usize, pair: [u32; 2], stamp: u32) -> bool {
        if let Some(k) = pair.iter().position(|&w| w as usize == v) {
            // It is removed; its third vertex must have another triangle.
            return self.triangle_count[pair[1 - k] as usize] > 1;
        }
        let twin = || self.opposite(v).any(|other| pair.iter().all(|w| other.contains(w)));
        if pair.iter().all(|&w| self.mark[w as usize] == stamp) && twin() {
            return false;
        }
        let [a, b] = pair.map(|w| self.positions[w as usize]);
        let (before, old) = shape(&self.positions[u], &a, &b);
        let (after, new) = shape(&self.positions[v], &a, &b);
        let rotation = after.dot(&before) - MIN_ROTATION_COSINE * after.norm() * before.norm();
        (rotation > 0.0 || old == 0.0) && new >= MIN_QUALITY.min(old)
    }

    /// Collapses `u` to `v`.
    pub(super) fn collapse(&mut self, u: usize, v: usize) {
        let mut corner = self.first[u];
        while corner != NONE {
            let (t, k) = (corner as usize / 3, corner as usize % 3);
            if self.alive[t] && self.triangles[t].contains(&(v as u32)) {
                self.alive[t] = false;
                for w in self.triangles[t] {
                    self.triangle_count[w as usize] -= 1;
                }
            } else if self.alive[t] {
                self.triangles[t][k] = v as u32;
                self.triangle_count[v] += 1;
            }
            corner = self.next[corner as usize];
        }
        // The list of `v` is not empty: the triangle at the edge to `u` is removed, but still linked.
        self.next[self.last[v] as usize] = self.first[u];
        self.last[v] = self.last[u];
        self.first[u] = NONE;
        self.triangle_count[u] = 0;
        let removed = self.quadrics[u];
        self.quadrics[v].add(&removed, &(self.positions[v] - self.positions[u]));
    }

    /// True for a vertex of no triangle.
    pub(super) fn is_loose(&self, v: usize) -> bool {
        self.triangle_count[v] == 0
    }

    /// True for a vertex that must stay.
    pub(super) fn is_pinned(&self, v: usize) -> bool {
        self.pinned[v]
    }

    /// The remaining triangles.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.triangles.iter().zip(&self.alive).filter(|&(_, &alive)| alive).map(|(t, _)| *t)
    }
}

/// Vertices of `keep` with a neighbor outside of `keep`, or of no triangle.
fn pinned(mesh: &TriMesh, keep: &[u32]) -> Vec<bool> {
    let n = mesh.vertex_count();
    let (mut kept, mut inside) = (vec![false; n], vec![false; n]);
    for &v in keep {
        kept[v as usize] = true;
    }
    for &v in mesh.triangles().iter().flatten() {
        inside[v as usize] = true;
    }
    for &v in mesh.triangles().iter().filter(|t| t.iter().any(|&v| !kept[v as usize])).flatten() {
        inside[v as usize] = false;
    }
    kept.iter().zip(inside).map(|(&kept, inside)| kept && !inside).collect()
}

/// Doubled area normal of a triangle, and its length over the sum of squared edges (0 for a point).
fn shape(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> (Vector3<f64>, f64) {
    let normal = (b - a).cross(&(c - a));
    let edges = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    (normal, if edges > 0.0 { normal.norm() / edges } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> TriMesh {
        TriMesh::new(positions.into_iter().map(Point3::from).collect(), triangles).expect("a sound case")
    }

    #[test]
    fn a_waist_of_three_edges_is_not_collapsed() {
        let corners = [[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]];
        let positions = (0..15).map(|i| [i as f64 / 3.0 * 0.5, corners[i % 3][0], corners[i % 3][1]]).collect();
        let at = |ring: u32, k: u32| 3 * ring + k % 3;
        let quads = (0..12).map(|i| (i / 3, i % 3));
        let triangles = quads.flat_map(|(r, k)| {
            [[at(r, k), at(r, k + 1), at(r + 1, k)], [at(r, k + 1), at(r + 1, k + 1), at(r + 1, k)]]
        });
        let mesh = mesh(positions, triangles.collect());
        let mut collapser = Collapser::new(&mesh, &[]);
        assert!(
            !collapser.allowed(6, 7) && !collapser.allowed(7, 8),
            "the third vertex is a neighbor of both, without a triangle"
        );
        assert!(collapser.allowed(6, 3), "along the tube");
    }

    #[test]
    fn no_triangle_is_inverted() {
        // A star with a notch at its second tip: a collapse to the first tip inverts the triangle behind the notch.
        let tips = [[2.0, 0.0], [0.2, 0.2], [0.0, 2.0], [-2.0, 0.0], [0.0, -2.0]];
        let positions = std::iter::once([0.0; 3]).chain(tips.map(|[x, y]| [x, y, 0.0])).collect();
        let mesh = mesh(positions, (0..5).map(|k| [0, 1 + k, 1 + (k + 1) % 5]).collect());
        let mut collapser = Collapser::new(&mesh, &[]);
        assert!(!collapser.allowed(0, 1) && !collapser.allowed(0, 3), "beside the notch");
        assert!(collapser.allowed(0, 4), "across from it");
    }
}
