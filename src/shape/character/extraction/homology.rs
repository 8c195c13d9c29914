//! Homology classes of surface loops in the enclosed volume.
//!
//! A surface of genus `g` has `2g` independent loops; `g` of them bound inside the shape (around a branch), the others encircle its holes. A
//! curve skeleton must keep the latter and none of the former. The distinction is integer linear algebra:
//!
//! 1. A spanning tree of the vertices and one of the triangles that crosses none of its edges leave `2g` edges `e_k`. With the tree, `e_k`
//!    closes a loop `c_k`; with the cotree it closes a chain of triangles, and `ω_k` counts the signed crossings of an edge with it.
//!    `ω_k(c_j) = δ_kj`, and `ω_k` of the boundary of a triangle is 0: a loop `γ` is homologous to `Σ ω_k(γ) c_k`.
//! 2. `M_kj` is the linking number of `c_k` with `c_j` offset outward. By Alexander duality `γ` bounds inside the shape if and only if
//!    `Σ_k ω_k(γ) M_kj = 0` for all `j`; `M` has rank `g`.
//!
//! The class of an edge is the integer vector `(Σ_k ω_k M_kj)_j` over `g` independent columns `j`; that of a loop is the sum over its edges.
//! Classes of edges between merged vertices follow from the sequence of collapses. For self-intersecting surfaces `M` may not exist: then
//! no loop is protected.
//!
//! # Reference
//! T. K. Dey, K. Li, J. Sun, D. Cohen-Steiner, *Computing geometry-aware handle and tunnel loops in 3D models*, SIGGRAPH 2008; D. Eppstein,
//! *Dynamic generators of topologically embedded graphs*, SODA 2003 (tree and cotree); K. Klenin, J. Langowski, *Computation of
//! writhe in modeling of supercoiled DNA*, Biopolymers 54 (2000) (linking numbers of polygons).

use std::collections::{HashMap, VecDeque};
use std::f64::consts::PI;

use nalgebra::{DMatrix, Point3, Vector3};

use super::complex::{Collapse, Complex, NONE};
use plumbline_num::run::Run;

/// `ω` of a half-edge: pairs of `k` and multiplicity.
type Form = Vec<(u32, i32)>;

/// Largest genus: beyond it linking numbers would dominate the cost, and no character has as many handles.
const MAX_HANDLES: usize = 24;
/// Outward offset of the loops, as a fraction of the mean edge length: small enough to cross nothing, large beside rounding.
const LOOP_OFFSET: f64 = 1e-3;

/// The zero class: of paths that, closed, bound inside the shape.
pub(super) const ZERO: u32 = 0;

/// Homology classes of edges, stored by index; by default those of the trivial homology, in which every loop bounds.
#[derive(Default)]
pub(super) struct Classes {
    rank: usize,
    vectors: Vec<Vec<i32>>,
    numbers: HashMap<Vec<i32>, u32>,
    /// Class of each half-edge of each triangle, on the original surface.
    of_half_edge: Vec<[u32; 3]>,
    /// Corners of the original surface.
    corners: Vec<[u32; 3]>,
    /// For each vertex the one it merged into, and the class of the path there.
    to_merged: Vec<(u32, u32)>,
}

impl Classes {
    /// The classes of a surface before further collapses. `None` if it is not closed, oriented and connected, or if linking numbers are
    /// undefined, or once the run has ended.
    pub(super) fn new(complex: &Complex, run: &Run) -> Option<Self> {
        let surface = Surface::new(complex)?;
        if surface.genus == 0 {
            return Some(Self::default());
        }
        if surface.genus > MAX_HANDLES {
            return None;
        }
        let (forms, loops) = surface.forms_and_loops();
        let linking = surface.linking(&loops, run)?;
        let columns = independent_columns(&linking);
        if columns.len() != surface.genus {
            return None;
        }
        let mut this = Self { rank: surface.genus, ..Self::default() };
        this.number(vec![0; columns.len()]);
        let of = |(t, corners): (usize, &[u32; 3])| {
            [0, 1, 2].map(|k| {
                if corners[0] == NONE {
                    return vec![0; columns.len()];
                }
                let omega = &forms[3 * t + k];
                columns.iter().map(|j| omega.iter().map(|(k, w)| w * linking[(*k as usize, *j)] as i32).sum()).collect()
            })
        };
        let vectors: Vec<[Vec<i32>; 3]> = complex.triangles.iter().enumerate().map(of).collect();
        this.of_half_edge = vectors.into_iter().map(|v| v.map(|v| this.number(v))).collect();
        this.corners.clone_from(&complex.triangles);
        this.to_merged = (0..complex.positions.len() as u32).map(|v| (v, ZERO)).collect();
        Some(this)
    }

    fn number(&mut self, vector: Vec<i32>) -> u32 {
        if let Some(number) = self.numbers.get(&vector) {
            return *number;
        }
        let number = self.vectors.len() as u32;
        self.numbers.insert(vector.clone(), number);
        self.vectors.push(vector);
        number
    }

    /// Whether all loops bound.
    pub(super) fn is_trivial(&self) -> bool {
        self.rank == 0
    }

    /// Number of independent loops that the skeleton keeps.
    pub(super) fn rank(&self) -> usize {
        self.rank
    }

    /// Class of a concatenation of paths.
    pub(super) fn sum(&mut self, a: u32, b: u32) -> u32 {
        match (a, b) {
            (ZERO, other) | (other, ZERO) => other,
            _ => {
                let sum = self.vectors[a as usize].iter().zip(&self.vectors[b as usize]).map(|(a, b)| a + b).collect();
                self.number(sum)
            }
        }
    }

    /// Class of the reversed path.
    pub(super) fn negative(&mut self, a: u32) -> u32 {
        if a == ZERO {
            return ZERO;
        }
        let negative = self.vectors[a as usize].iter().map(|v| -v).collect();
        self.number(negative)
    }

    /// Updates the merged vertices after collapses.
    pub(super) fn follow(&mut self, collapses: &[Collapse]) {
        if self.is_trivial() {
            return;
        }
        for c in collapses {
            let class = self.between(c.triangle as usize, usize::from(c.corners[0]), usize::from(c.corners[1]));
            self.to_merged[c.gone as usize] = (c.kept, class);
        }
    }

    /// Class of the edge between two corners of a triangle as merged now.
    pub(super) fn between(&mut self, triangle: usize, from: usize, to: usize) -> u32 {
        if self.is_trivial() {
            return ZERO;
        }
        let first = if (from + 1) % 3 == to {
            self.of_half_edge[triangle][from]
        } else {
            let forth = self.of_half_edge[triangle][to];
            self.negative(forth)
        };
        let corners = self.corners[triangle];
        let start = self.path_from(corners[from]);
        let start = self.negative(start);
        let end = self.path_from(corners[to]);
        let sum = self.sum(start, first);
        self.sum(sum, end)
    }

    /// Class of the path from a vertex to the one it merged into.
    fn path_from(&mut self, mut v: u32) -> u32 {
        let mut class = ZERO;
        while self.to_merged[v as usize].0 != v {
            let (next, step) = self.to_merged[v as usize];
            class = self.sum(class, step);
            v = next;
        }
        class
    }
}

/// A closed, oriented, connected surface.
struct Surface<'c> {
    complex: &'c Complex,
    genus: usize,
    /// Opposite half-edge of each half-edge `3t + k`.
    twin: Vec<u32>,
    alive: Vec<u32>,
}

impl<'c> Surface<'c> {
    fn new(complex: &'c Complex) -> Option<Self> {
        let mut halves: HashMap<(u32, u32), u32> = HashMap::new();
        let mut faces = 0;
        for (t, corners) in complex.triangles.iter().enumerate().filter(|(_, c)| c[0] != NONE) {
            faces += 1;
            for k in 0..3 {
                if halves.insert((corners[k], corners[(k + 1) % 3]), (3 * t + k) as u32).is_some() {
                    return None;
                }
            }
        }
        let mut twin = vec![NONE; 3 * complex.triangles.len()];
        for ((a, b), h) in &halves {
            twin[*h as usize] = *halves.get(&(*b, *a))?;
        }
        let alive: Vec<u32> = complex.vertices().collect();
        let euler = alive.len() as i64 - halves.len() as i64 / 2 + faces;
        let genus = usize::try_from(2 - euler).ok().filter(|twice| twice % 2 == 0)? / 2;
        Some(Self { complex, genus, twin, alive })
    }

    fn origin(&self, h: u32) -> u32 {
        self.complex.triangles[h as usize / 3][h as usize % 3]
    }

    fn destination(&self, h: u32) -> u32 {
        self.complex.triangles[h as usize / 3][(h as usize % 3 + 1) % 3]
    }

    /// `ω` of every half-edge, and the loops `c_k`.
    fn forms_and_loops(&self) -> (Vec<Form>, Vec<Vec<u32>>) {
        let halves = self.twin.len();
        let mut tree = vec![false; halves];
        // Half-edge by which the tree reaches each vertex.
        let mut reached = vec![NONE; self.complex.positions.len()];
        let mut outgoing: Vec<Vec<u32>> = vec![Vec::new(); self.complex.positions.len()];
        for h in (0..halves as u32).filter(|h| self.twin[*h as usize] != NONE) {
            outgoing[self.origin(h) as usize].push(h);
        }
        let root = self.alive[0];
        let mut queue = VecDeque::from([root]);
        while let Some(v) = queue.pop_front() {
            for &h in &outgoing[v as usize] {
                let to = self.destination(h);
                if to != root && reached[to as usize] == NONE {
                    reached[to as usize] = h;
                    tree[h as usize] = true;
                    tree[self.twin[h as usize] as usize] = true;
                    queue.push_back(to);
                }
            }
        }
        // Half-edge through which the cotree enters each triangle from its parent.
        let first = self.complex.triangles.iter().position(|t| t[0] != NONE).expect("a surface has triangles");
        let mut entered = vec![NONE; self.complex.triangles.len()];
        let mut queue = VecDeque::from([first]);
        let mut cotree = vec![false; halves];
        while let Some(t) = queue.pop_front() {
            for h in (3 * t as u32)..(3 * t as u32 + 3) {
                let other = self.twin[h as usize] as usize / 3;
                if !tree[h as usize] && other != first && entered[other] == NONE {
                    entered[other] = h;
                    cotree[h as usize] = true;
                    cotree[self.twin[h as usize] as usize] = true;
                    queue.push_back(other);
                }
            }
        }
        let left: Vec<u32> = (0..halves as u32)
            .filter(|h| {
                let i = *h as usize;
                self.twin[i] != NONE && *h < self.twin[i] && !tree[i] && !cotree[i]
            })
            .collect();
        let mut forms: Vec<Vec<(u32, i32)>> = vec![Vec::new(); halves];
        let mut loops = Vec::new();
        for (k, &h) in left.iter().enumerate() {
            let mut cross = |h: u32, w: i32| {
                forms[h as usize].push((k as u32, w));
                forms[self.twin[h as usize] as usize].push((k as u32, -w));
            };
            // Out of the left triangle, from the right one back to the root, and from the root to the left one.
            cross(h, 1);
            for (mut t, w) in [(self.twin[h as usize] as usize / 3, -1), (h as usize / 3, 1)] {
                while entered[t] != NONE {
                    cross(entered[t], w);
                    t = entered[t] as usize / 3;
                }
            }
            loops.push(self.closed_by(h, &reached));
        }
        (forms, loops)
    }

    /// The loop that an edge closes with the tree.
    fn closed_by(&self, h: u32, reached: &[u32]) -> Vec<u32> {
        let to_root = |mut v: u32| {
            let mut path = vec![v];
            while reached[v as usize] != NONE {
                v = self.origin(reached[v as usize]);
                path.push(v);
            }
            path
        };
        let (mut a, mut b) = (to_root(self.origin(h)), to_root(self.destination(h)));
        while a.len() > 1 && b.len() > 1 && a[a.len() - 2] == b[b.len() - 2] {
            a.pop();
            b.pop();
        }
        // root … origin, destination … root, the common vertex once.
        a.reverse();
        b.pop();
        a.extend(b);
        a
    }

    /// Linking numbers of each loop with each offset loop, including its own; `None` if they are not integers.
    fn linking(&self, loops: &[Vec<u32>], run: &Run) -> Option<DMatrix<f64>> {
        let mut normals = vec![Vector3::zeros(); self.complex.positions.len()];
        let (mut length, mut count) = (0.0, 0.0);
        for t in self.complex.faces() {
            let [a, b, c] = t.map(|v| self.complex.positions[v as usize]);
            let normal = (b - a).cross(&(c - a));
            for v in &t {
                normals[*v as usize] += normal;
            }
            length += (b - a).norm() + (c - b).norm() + (a - c).norm();
            count += 3.0;
        }
        let push = LOOP_OFFSET * length / count;
        let at = |v: &u32| self.complex.positions[*v as usize];
        let on: Vec<Vec<Point3<f64>>> = loops.iter().map(|l| l.iter().map(at).collect()).collect();
        let lifted = |v: &u32| at(v) + normals[*v as usize].try_normalize(0.0).unwrap_or_default() * push;
        let off: Vec<Vec<Point3<f64>>> = loops.iter().map(|l| l.iter().map(lifted).collect()).collect();
        let mut linking = DMatrix::zeros(loops.len(), loops.len());
        for (k, a) in on.iter().enumerate() {
            for (j, b) in off.iter().enumerate() {
                run.check().ok()?;
                let number = linking_number(a, b);
                if !((number - number.round()).abs() < 0.1) {
                    return None;
                }
                linking[(k, j)] = number.round();
            }
        }
        Some(linking)
    }
}

/// Gauss's linking number of two closed polygons: the solid angle of each pair of segments, over 4π.
fn linking_number(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    let mut sum = 0.0;
    for i in 0..a.len() {
        let (p, q) = (a[i], a[(i + 1) % a.len()]);
        for j in 0..b.len() {
            sum += solid_angle(&p, &q, &b[j], &b[(j + 1) % b.len()]);
        }
    }
    sum / (4.0 * PI)
}

fn solid_angle(p: &Point3<f64>, q: &Point3<f64>, r: &Point3<f64>, s: &Point3<f64>) -> f64 {
    let (pr, ps, qr, qs) = (r - p, s - p, r - q, s - q);
    let sides = [pr.cross(&ps), ps.cross(&qs), qs.cross(&qr), qr.cross(&pr)];
    let n = sides.map(|v| v.try_normalize(0.0).unwrap_or_default());
    let angle: f64 = (0..4).map(|k| n[k].dot(&n[(k + 1) % 4]).clamp(-1.0, 1.0).asin()).sum();
    let side = (s - r).cross(&(q - p)).dot(&pr);
    if side == 0.0 { 0.0 } else { angle * side.signum() }
}

/// Independent columns of an integer matrix, greedily from the left, by Gaussian elimination.
fn independent_columns(m: &DMatrix<f64>) -> Vec<usize> {
    let mut rest = m.clone();
    let mut found = Vec::new();
    for j in 0..m.ncols() {
        let (pivot, size) =
            (0..m.nrows()).map(|i| (i, rest[(i, j)].abs())).fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
        if size < 1e-6 {
            continue;
        }
        found.push(j);
        for c in j + 1..m.ncols() {
            let factor = rest[(pivot, c)] / rest[(pivot, j)];
            for i in 0..m.nrows() {
                let taken = rest[(i, j)] * factor;
                rest[(i, c)] -= taken;
            }
        }
    }
    found
}
