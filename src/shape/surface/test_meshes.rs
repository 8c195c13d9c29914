//! Surfaces that tests deform.

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;

/// An open sheet of `n × n` vertices with waves and skewed triangles.
pub(super) fn sheet(n: usize) -> TriMesh {
    let positions = (0..n * n).map(|v| {
        let (x, y) = ((v % n) as f64 / n as f64, (v / n) as f64 / n as f64);
        Point3::new(x + 0.6 * y, y, 0.15 * (7.0 * x).sin() * (5.0 * y).cos())
    });
    TriMesh::new(positions.collect(), grid_triangles(n, n, false)).unwrap()
}

/// An open tube along x: `rings` rings of `around` vertices, radius 0.2, length 2.
pub(super) fn tube(rings: usize, around: usize) -> TriMesh {
    let positions = (0..rings * around).map(|v| {
        let (ring, k) = (v / around, v % around);
        let angle = std::f64::consts::TAU * (k as f64 + 0.5 * (ring % 2) as f64) / around as f64;
        Point3::new(2.0 * ring as f64 / (rings - 1) as f64, 0.2 * angle.cos(), 0.2 * angle.sin())
    });
    TriMesh::new(positions.collect(), grid_triangles(around, rings, true)).unwrap()
}

fn grid_triangles(wide: usize, high: usize, closed: bool) -> Vec<[u32; 3]> {
    let columns = if closed { wide } else { wide - 1 };
    let cells = (0..high - 1).flat_map(|y| (0..columns).map(move |x| (x, y)));
    cells
        .flat_map(|(x, y)| {
            let at = |x: usize, y: usize| (y * wide + x % wide) as u32;
            let (a, b, c, d) = (at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1));
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// The same surface elsewhere and in other units.
pub(super) fn placed(mesh: &TriMesh, scale: f64, offset: Vector3<f64>) -> TriMesh {
    mesh.with_positions(mesh.positions().iter().map(|p| p * scale + offset).collect()).unwrap()
}
