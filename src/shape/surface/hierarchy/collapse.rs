//! Half-edge collapses: which vertices may go, where to, at what price.
//!
//! A vertex `u` goes into a neighbor `v`, which stays where it is: the triangles at the edge vanish, the others at `u` take `v`
//! for it. The price is the quadric error of both at `v`, plus a share of `area(u) ‖v − u‖²`, which spreads vertices evenly
//! where the surface is flat: what the coarse mesh is for is to be solved on.

use nalgebra::{Point3, Vector3};

use super::quadric::Quadric;
use crate::mesh::TriMesh;

/// Share of `area ‖v − u‖²` in the price: distances to planes weigh more where the surface bends by over 20° along the edge.
/// Much less lets flat parts fall into slivers, much more cuts off spikes.
const EVENNESS: f64 = 0.1;
/// Weight of the planes along the boundary, over squared edges: a corner of a sheet costs more than evenness ever gains.
const FENCE: f64 = 100.0;
/// Cosine that normals may turn by at most in one collapse.
const MIN_ROTATION_COSINE: f64 = 0.3;
/// Twice the area over the sum of squared edges (√3/6 ≈ 0.29 for equal sides) under which a triangle is a sliver. Slivers are
/// refused unless one as thin was there before.
const SLIVER: f64 = 0.03;
/// Most neighbors of a vertex that has taken others in: dense rows cost in every factor.
const MAX_NEIGHBORS: usize = 14;
/// End of a list of corners.
const NONE: u32 = u32::MAX;

/// A neighbor, and in how many triangles the edge to it lies.
pub(super) type Neighbor = (u32, u32);

/// A mesh that loses vertices.
pub(super) struct Collapser<'a> {
    positions: &'a [Point3<f64>],
    triangles: Vec<[u32; 3]>,
    alive: Vec<bool>,
    /// Corners `3 t + k` of the triangles at each vertex, chained; dead ones are passed over.
    first: Vec<u32>,
    last: Vec<u32>,
    next: Vec<u32>,
    triangle_count: Vec<u32>,
    quadrics: Vec<Quadric>,
    /// To be kept whatever it costs.
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

    /// Quadrics: the planes of the triangles, and upright ones through the edges of the boundary.
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
                    self.fence(mesh, u, w as usize);
                }
            }
        }
    }

    /// The plane through a boundary edge that stands upright on its triangle.
    fn fence(&mut self, mesh: &TriMesh, u: usize, w: usize) {
        let triangle = self.corners_of(u).find(|&c| self.triangles[c as usize / 3].contains(&(w as u32)));
        let edge = self.positions[w] - self.positions[u];
        let upright = triangle.map(|c| mesh.area_normal(c as usize / 3).cross(&edge));
        let Some(n) = upright.and_then(|n| n.try_normalize(0.0)) else { return };
        for v in [u, w] {
            self.quadrics[v].add_plane(&n, 0.0, FENCE * edge.norm_squared());
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

    /// Fills `self.ring` with the neighbors of `u`. Corners of dead triangles leave the chain on the way, so that each is met
    /// once.
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

    /// The neighbors last asked for.
    pub(super) fn last_ring(&self) -> &[Neighbor] {
        &self.ring
    }

    /// The cheapest neighbor for `u` to go into, and the price; `None` where `u` has to stay.
    ///
    /// Pinned vertices and ends of edges in three or more triangles stay; a vertex of the boundary goes along the boundary.
    pub(super) fn best(&mut self, u: usize) -> Option<(u32, f64)> {
        self.gather(u);
        let boundary = self.ring.iter().any(|&(_, count)| count == 1);
        if self.pinned[u] || self.ring.iter().any(|&(_, count)| count > 2) {
            return None;
        }
        let quadric = &self.quadrics[u];
        let price = |w: u32| {
            let step = self.positions[w as usize] - self.positions[u];
            let spread = EVENNESS * quadric.area * step.norm_squared();
            quadric.at(&step) + self.quadrics[w as usize].here() + spread
        };
        let along = self.ring.iter().filter(|&&(_, count)| !boundary || count == 1);
        along.map(|&(w, _)| (w, price(w))).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// True where `u` may go into `v`: nothing is glued, nothing vanishes, no triangle turns over or becomes a sliver.
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
            && self.opposite(u).all(|pair| self.sound(u, v, pair, stamp))
    }

    /// One triangle at `u` after `u` has gone into `v`; marked are the neighbors of `v`.
    fn sound(&self, u: usize, v: usize, pair: [u32; 2], stamp: u32) -> bool {
        if let Some(k) = pair.iter().position(|&w| w as usize == v) {
            // It vanishes; its third vertex must have another.
            return self.triangle_count[pair[1 - k] as usize] > 1;
        }
        let twin = || self.opposite(v).any(|other| pair.iter().all(|w| other.contains(w)));
        if pair.iter().all(|&w| self.mark[w as usize] == stamp) && twin() {
            return false;
        }
        let [a, b] = pair.map(|w| self.positions[w as usize]);
        let (before, old) = shape(&self.positions[u], &a, &b);
        let (after, new) = shape(&self.positions[v], &a, &b);
        let turn = after.dot(&before) - MIN_ROTATION_COSINE * after.norm() * before.norm();
        (turn > 0.0 || old == 0.0) && new >= SLIVER.min(old)
    }

    /// Takes `u` into `v`.
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
        // The chain of `v` is not empty: the edge to `u` lies in a triangle, dead by now but still a link.
        self.next[self.last[v] as usize] = self.first[u];
        self.last[v] = self.last[u];
        self.first[u] = NONE;
        self.triangle_count[u] = 0;
        let gone = self.quadrics[u];
        self.quadrics[v].add(&gone, &(self.positions[v] - self.positions[u]));
    }

    /// True for a vertex that no triangle names.
    pub(super) fn is_loose(&self, v: usize) -> bool {
        self.triangle_count[v] == 0
    }

    /// True for a vertex that no one may take.
    pub(super) fn is_pinned(&self, v: usize) -> bool {
        self.pinned[v]
    }

    /// Triangles that are left.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        self.triangles.iter().zip(&self.alive).filter(|&(_, &alive)| alive).map(|(t, _)| *t)
    }
}

/// Of the vertices to be kept, those that are not in the midst of others: loose ones, and those beside one that may go.
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
    fn a_waist_of_three_edges_is_not_pinched() {
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
            "their third is a neighbor of both, without a triangle"
        );
        assert!(collapser.allowed(6, 3), "along the tube");
    }

    #[test]
    fn no_triangle_turns_over() {
        // A star with a notch at its second tip: seen from the first, the triangle behind the notch lies upside down.
        let tips = [[2.0, 0.0], [0.2, 0.2], [0.0, 2.0], [-2.0, 0.0], [0.0, -2.0]];
        let positions = std::iter::once([0.0; 3]).chain(tips.map(|[x, y]| [x, y, 0.0])).collect();
        let mesh = mesh(positions, (0..5).map(|k| [0, 1 + k, 1 + (k + 1) % 5]).collect());
        let mut collapser = Collapser::new(&mesh, &[]);
        assert!(!collapser.allowed(0, 1) && !collapser.allowed(0, 3), "beside the notch");
        assert!(collapser.allowed(0, 4), "across from it");
    }
}
