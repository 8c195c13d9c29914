//! Closed surfaces as level sets `{x : f(x) = 0}`, `f < 0` inside, by marching tetrahedra.
//!
//! Each cube of a grid is divided into six tetrahedra around its diagonal (Kuhn subdivision); a tetrahedron with corners on
//! both sides of the surface contains one or two triangles between the zero crossings on its edges. The result is closed and
//! manifold for any `f`, because the boundary nodes of the box count as outside. Slivers are removed by a few iterations of
//! Laplacian smoothing, each followed by projection along the gradient onto the surface.
//!
//! # Reference
//! A. Doi, A. Koide, *An efficient method of triangulating equi-valued surfaces by using tetrahedral cells*, IEICE 1991.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::super::TriMesh;
use super::made;

/// Smoothing iterations: after ten the worst triangles are well shaped, and further iterations change little.
const ROUNDS: usize = 12;

/// Kuhn subdivision of a cube: the corners of its six tetrahedra, each positively oriented. Bits 0, 1, 2 of a corner are its
/// x, y, z.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// The zero level set of `f` in a box, on a grid of cubes of side `cell`. Grid nodes on the boundary of the box count as
/// outside.
pub fn level_set(f: impl Fn(&Point3<f64>) -> f64, low: Point3<f64>, high: Point3<f64>, cell: f64) -> TriMesh {
    let nodes = (high - low).map(|side| (side / cell).ceil().max(1.0) as usize + 1);
    let mut march = March::new(&f, low, cell, [nodes.x, nodes.y, nodes.z]);
    march.triangles();
    let March { mut positions, triangles, .. } = march;
    relax(&f, &mut positions, &triangles, cell);
    made(positions, triangles)
}

/// A saguaro cactus: a trunk along z and two bent arms, about one unit high; `resolution` cells over that height.
pub fn cactus(resolution: usize) -> TriMesh {
    let p = Point3::new;
    let limbs = [
        (p(0.0, 0.0, 0.0), p(0.0, 0.0, 1.0), 0.13),
        (p(0.0, 0.0, 0.45), p(0.33, 0.0, 0.48), 0.07),
        (p(0.33, 0.0, 0.48), p(0.35, 0.0, 0.8), 0.07),
        (p(0.0, 0.0, 0.3), p(-0.3, 0.05, 0.33), 0.07),
        (p(-0.3, 0.05, 0.33), p(-0.32, 0.05, 0.6), 0.07),
    ];
    let f =
        move |x: &Point3<f64>| limbs.iter().map(|(a, b, r)| capsule(x, a, b) - r).reduce(joined(0.05)).unwrap_or(1.0);
    level_set(f, p(-0.5, -0.25, -0.25), p(0.55, 0.25, 1.25), 1.0 / resolution.max(8) as f64)
}

/// Tori of radii 1 and 0.35 with axes along z, in a row along x, smoothly joined: a closed surface of genus `holes`;
/// `resolution` cells per unit of two.
pub fn holed_torus(holes: usize, resolution: usize) -> TriMesh {
    let holes = holes.max(1);
    let torus = |x: &Point3<f64>, center: f64| ((x.x - center).hypot(x.y) - 1.0).hypot(x.z) - 0.35;
    let f = move |x: &Point3<f64>| (0..holes).map(|k| torus(x, 2.0 * k as f64)).reduce(joined(0.2)).unwrap_or(1.0);
    let end = 2.0 * holes as f64 - 0.4;
    level_set(f, Point3::new(-1.6, -1.6, -0.6), Point3::new(end, 1.6, 0.6), 2.0 / resolution.max(10) as f64)
}

/// Distance to the segment `ab`.
fn capsule(x: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let (along, from) = (b - a, x - a);
    let t = (from.dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    (from - along * t).norm()
}

/// Smooth minimum of two distances: quadratic blend where they differ by less than `width`.
fn joined(width: f64) -> impl Fn(f64, f64) -> f64 {
    move |a, b| {
        let h = (width - (a - b).abs()).max(0.0) / width;
        a.min(b) - 0.25 * width * h * h
    }
}

/// State of marching tetrahedra: nodal values of `f`, and the vertex of each grid edge that crosses the surface.
struct March {
    low: Point3<f64>,
    cell: f64,
    nodes: [usize; 3],
    values: Vec<f64>,
    crossings: BTreeMap<(usize, usize), u32>,
    positions: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
}

impl March {
    fn new(f: impl Fn(&Point3<f64>) -> f64, low: Point3<f64>, cell: f64, nodes: [usize; 3]) -> Self {
        let (crossings, positions, triangles) = (BTreeMap::new(), Vec::new(), Vec::new());
        let mut march = Self { low, cell, nodes, values: Vec::new(), crossings, positions, triangles };
        let value = |node: usize| {
            let border = (0..3).any(|k| march.along(node)[k] == 0 || march.along(node)[k] == nodes[k] - 1);
            let value = f(&march.position(node));
            if border { value.max(cell) } else { value }
        };
        march.values = (0..nodes.iter().product()).map(value).collect();
        march
    }

    /// Grid coordinates of a node.
    fn along(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes;
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Position of a node.
    fn position(&self, node: usize) -> Point3<f64> {
        self.low + Vector3::from(self.along(node).map(|i| i as f64)) * self.cell
    }

    /// Visits all tetrahedra of the grid.
    fn triangles(&mut self) {
        let [nx, ny, nz] = self.nodes;
        let steps: [usize; 8] = std::array::from_fn(|k| (k & 1) + (k >> 1 & 1) * nx + (k >> 2) * nx * ny);
        for z in 0..nz - 1 {
            for y in 0..ny - 1 {
                for x in 0..nx - 1 {
                    let corners = steps.map(|step| (z * ny + y) * nx + x + step);
                    for tetrahedron in TETRAHEDRA {
                        self.cut(tetrahedron.map(|k| corners[k]));
                    }
                }
            }
        }
    }

    /// Adds the triangles in one positively oriented tetrahedron, oriented outwards.
    fn cut(&mut self, [a, b, c, d]: [usize; 4]) {
        let inside = [a, b, c, d].map(|node| self.values[node] < 0.0);
        // Even permutations, which keep the orientation, move the single corner on its side to the front.
        let even = [[a, b, c, d], [b, a, d, c], [c, d, a, b], [d, c, b, a]];
        match inside.iter().filter(|&&i| i).count() {
            1 => {
                let [p, q, r, s] = even[inside.iter().position(|&i| i).expect("one is inside")];
                let t = [self.crossing(p, q), self.crossing(p, r), self.crossing(p, s)];
                self.triangles.push(t);
            }
            3 => {
                let [p, q, r, s] = even[inside.iter().position(|&i| !i).expect("one is outside")];
                let t = [self.crossing(p, q), self.crossing(p, s), self.crossing(p, r)];
                self.triangles.push(t);
            }
            2 => {
                // Even permutations that move the two inside corners to the front.
                let pairs = [[a, b, c, d], [c, d, a, b], [a, c, d, b], [b, d, c, a], [a, d, b, c], [b, c, a, d]];
                let [p, q, r, s] = *pairs
                    .iter()
                    .find(|[p, q, ..]| self.values[*p] < 0.0 && self.values[*q] < 0.0)
                    .expect("all pairs are listed");
                let quad = [self.crossing(p, r), self.crossing(p, s), self.crossing(q, s), self.crossing(q, r)];
                self.triangles.extend(super::halves(quad, false));
            }
            _ => {}
        }
    }

    /// The vertex at the zero crossing of a grid edge, created once per edge. The interpolation parameter is clamped to
    /// `[0.1, 0.9]`, so that vertices of different edges do not coincide at a node.
    fn crossing(&mut self, p: usize, q: usize) -> u32 {
        let (p, q) = (p.min(q), p.max(q));
        if let Some(&vertex) = self.crossings.get(&(p, q)) {
            return vertex;
        }
        let t = (self.values[p] / (self.values[p] - self.values[q])).clamp(0.1, 0.9);
        self.positions.push(self.position(p) + (self.position(q) - self.position(p)) * t);
        let vertex = self.positions.len() as u32 - 1;
        self.crossings.insert((p, q), vertex);
        vertex
    }
}

/// Laplacian smoothing with uniform weights; after each iteration two Newton steps along the gradient project the vertices onto
/// the surface.
fn relax(f: impl Fn(&Point3<f64>) -> f64, positions: &mut [Point3<f64>], triangles: &[[u32; 3]], cell: f64) {
    let h = 1e-4 * cell;
    for _ in 0..ROUNDS {
        let mut sums = vec![(Vector3::zeros(), 0.0); positions.len()];
        for &[a, b, c] in triangles {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                // In a closed surface each half-edge `p → q` occurs once, so that every neighbor is counted once.
                let sum = &mut sums[p as usize];
                *sum = (sum.0 + positions[q as usize].coords, sum.1 + 1.0);
            }
        }
        for (position, (sum, count)) in positions.iter_mut().zip(sums) {
            let mut x = Point3::from(sum / count);
            for _ in 0..2 {
                let slope = |step: Vector3<f64>| (f(&(x + step)) - f(&(x - step))) / (2.0 * h);
                let gradient = Vector3::new(slope(Vector3::x() * h), slope(Vector3::y() * h), slope(Vector3::z() * h));
                x -= gradient * (f(&x) / gradient.norm_squared().max(1e-3)).clamp(-cell, cell);
            }
            *position = x;
        }
    }
}
