//! Procedural meshes: the test shapes of the deformation literature, and small degenerate or non-manifold meshes.
//!
//! Bar, cylinder, cactus and spiked plane are the four stress tests of the survey (twist, bend, bend, lift). All are oriented
//! counterclockwise seen from outside. Generation is deterministic: equal arguments give identical bytes.
//!
//! # Reference
//! M. Botsch, O. Sorkine, *On linear variational surface deformation methods*, TVCG 2008, section 5.

mod hurtful;
mod level_set;
mod round;

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use super::TriMesh;

pub use hurtful::{book, disjoint, hourglass, moebius, one_triangle, soup};
pub use level_set::{cactus, holed_torus, level_set};
pub use round::{cylinder, icosphere, tube};

/// A mesh of generated positions and triangles, valid by construction.
fn made(positions: Vec<Point3<f64>>, triangles: Vec<[u32; 3]>) -> TriMesh {
    TriMesh::new(positions, triangles).expect("corners exist and positions are finite by construction")
}

/// The two triangles of a quad, split along the diagonal from its first corner, or along the `other` one.
fn halves([a, b, c, d]: [u32; 4], other: bool) -> [[u32; 3]; 2] {
    if other { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
}

/// The unit square in the plane `z = 0`, of `n × n` cells, `(n + 1)²` vertices row by row from the origin; it faces +z.
pub fn plane(n: usize) -> TriMesh {
    spiked_plane(n, 1, 0.0)
}

/// [`plane`] whose inner vertices in every `step`-th row and column are raised to `height`.
pub fn spiked_plane(n: usize, step: usize, height: f64) -> TriMesh {
    let (n, step) = (n.max(1), step.max(1));
    let inner = |i: usize| i > 0 && i < n && i.is_multiple_of(step);
    let vertex = |k: usize| {
        let (i, j) = (k % (n + 1), k / (n + 1));
        let z = if inner(i) && inner(j) { height } else { 0.0 };
        Point3::new(i as f64 / n as f64, j as f64 / n as f64, z)
    };
    let cell = |k: usize| {
        let (i, j) = (k % n, k / n);
        let first = (j * (n + 1) + i) as u32;
        let above = first + n as u32 + 1;
        halves([first, first + 1, above + 1, above], (i + j) % 2 == 1)
    };
    made((0..(n + 1) * (n + 1)).map(vertex).collect(), (0..n * n).flat_map(cell).collect())
}

/// The surface of a box with one corner at the origin, `cells` along each side of length `size`.
pub fn bar(cells: [usize; 3], size: [f64; 3]) -> TriMesh {
    let cells = cells.map(|n| n.max(1));
    let mut lattice = Lattice { cells, size, numbers: BTreeMap::new(), positions: Vec::new() };
    let mut triangles = Vec::new();
    for axis in 0..3 {
        // The two faces of the box normal to `axis`, each a grid of quads along `u` and `v`.
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for far in [false, true] {
            for j in 0..cells[v] {
                for i in 0..cells[u] {
                    let corner = |di: usize, dj: usize| {
                        let mut at = [0; 3];
                        (at[axis], at[u], at[v]) = (if far { cells[axis] } else { 0 }, i + di, j + dj);
                        at
                    };
                    let around = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let mut quad = around.map(|at| lattice.vertex(at));
                    if !far {
                        quad.reverse();
                    }
                    triangles.extend(halves(quad, (i + j) % 2 == 1));
                }
            }
        }
    }
    made(lattice.positions, triangles)
}

/// Vertices on a grid, numbered in the order of first use.
struct Lattice {
    cells: [usize; 3],
    size: [f64; 3],
    numbers: BTreeMap<[usize; 3], u32>,
    positions: Vec<Point3<f64>>,
}

impl Lattice {
    fn vertex(&mut self, at: [usize; 3]) -> u32 {
        let next = self.positions.len() as u32;
        let number = *self.numbers.entry(at).or_insert(next);
        if number == next {
            let along = |k: usize| self.size[k] * at[k] as f64 / self.cells[k] as f64;
            self.positions.push(Point3::from(Vector3::from_fn(|k, _| along(k))));
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    /// Edges with the number of triangles that run along each forwards and backwards.
    fn edges(mesh: &TriMesh) -> BTreeMap<(u32, u32), (usize, usize)> {
        let mut edges = BTreeMap::new();
        for &[a, b, c] in mesh.triangles() {
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let count: &mut (usize, usize) = edges.entry((p.min(q), p.max(q))).or_default();
                if p < q { count.0 += 1 } else { count.1 += 1 }
            }
        }
        edges
    }

    #[test]
    fn closed_shapes_are_closed_oriented_outward_and_of_their_genus() {
        for (name, mesh, genus) in [
            ("bar", bar([4, 3, 9], [1.0, 0.5, 3.0]), 0),
            ("cylinder", cylinder(12, 5, 0.5, 2.0), 0),
            ("icosphere", icosphere(2), 0),
            ("cactus", cactus(24), 0),
            ("one hole", holed_torus(1, 12), 1),
            ("three holes", holed_torus(3, 12), 3),
        ] {
            let edges = edges(&mesh);
            assert!(edges.values().all(|&count| count == (1, 1)), "{name}: an edge is open or turned");
            let sum = mesh.vertex_count() + mesh.triangle_count();
            assert_eq!(sum + 2 * genus, 2 + edges.len(), "{name}: Euler number");
            assert!(mesh.volume() > 0.0, "{name} is inside out");
        }
    }

    #[test]
    fn sizes_are_those_asked_for() {
        let mesh = bar([4, 3, 9], [1.0, 0.5, 3.0]);
        assert!((mesh.volume() - 1.5).abs() < 1e-12 && (mesh.area() - 10.0).abs() < 1e-12);
        assert_eq!(mesh.vertex_count(), 2 + 2 * (4 * 3 + 3 * 9 + 9 * 4));
        assert!((plane(7).area() - 1.0).abs() < 1e-12 && plane(7).volume().abs() < 1e-15);
        assert_eq!(spiked_plane(20, 4, 0.3).positions().iter().filter(|p| p.z > 0.0).count(), 16);
        let ball = icosphere(4).volume() / (4.0 / 3.0 * std::f64::consts::PI);
        assert!(ball < 1.0 && ball > 0.98, "{ball}");
    }

    #[test]
    fn level_sets_have_no_sliver_worth_the_name() {
        for mesh in [cactus(30), holed_torus(2, 14)] {
            let quality = |t: usize| {
                let [a, b, c] = mesh.corners(t);
                let square = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
                2.0 * 3.0_f64.sqrt() * mesh.area_normal(t).norm() / square
            };
            let mut all: Vec<f64> = (0..mesh.triangle_count()).map(quality).collect();
            all.sort_by(f64::total_cmp);
            assert!(all[0] > 0.05 && all[all.len() / 20] > 0.5, "worst {}, twentieth {}", all[0], all[all.len() / 20]);
        }
    }

    #[test]
    fn hurtful_shapes_hurt_as_they_should() {
        let turned = |mesh: &TriMesh| edges(mesh).values().filter(|&&count| count == (2, 0) || count == (0, 2)).count();
        assert_eq!(turned(&moebius(16, 3)), 3, "one row of edges cannot be oriented");
        assert!(edges(&book(5)).values().any(|&(p, q)| p + q == 5));
        assert_eq!(hourglass().vertex_count(), 7);
        assert_eq!(soup(&icosphere(0)).vertex_count(), 60);
        assert_eq!(disjoint(&[one_triangle(), plane(1)]).triangles()[2], [3, 6, 5]);
    }
}
