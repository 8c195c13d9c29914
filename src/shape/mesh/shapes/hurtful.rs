//! Small degenerate and non-manifold test meshes.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};

use super::super::TriMesh;
use super::{halves, made};

/// The triangle `(0,0,0) (1,0,0) (0,1,0)`.
pub fn one_triangle() -> TriMesh {
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    made(positions.map(Point3::from).to_vec(), vec![[0, 1, 2]])
}

/// A Möbius strip of `segments` cells around and `rows` across: non-orientable.
pub fn moebius(segments: usize, rows: usize) -> TriMesh {
    let (segments, rows) = (segments.max(3), rows.max(1));
    let vertex = |k: usize| {
        let (i, j) = (k / (rows + 1), k % (rows + 1));
        let (angle, across) = (TAU * i as f64 / segments as f64, j as f64 / rows as f64 - 0.5);
        let radius = 1.0 + across * (angle / 2.0).cos();
        Point3::new(radius * angle.cos(), radius * angle.sin(), across * (angle / 2.0).sin())
    };
    let at = |i: usize, j: usize| {
        let (i, j) = if i == segments { (0, rows - j) } else { (i, j) };
        (i * (rows + 1) + j) as u32
    };
    let cell = |k: usize| {
        let (i, j) = (k / rows, k % rows);
        halves([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], false)
    };
    made((0..segments * (rows + 1)).map(vertex).collect(), (0..segments * rows).flat_map(cell).collect())
}

/// Two tetrahedra with one common vertex, the first: a non-manifold vertex.
pub fn hourglass() -> TriMesh {
    let ring = |z: f64| (0..3).map(move |k| (TAU * k as f64 / 3.0, z)).map(|(a, z)| Point3::new(a.cos(), a.sin(), z));
    let positions = std::iter::once(Point3::origin()).chain(ring(1.0)).chain(ring(-1.0)).collect();
    let upper = [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]];
    let lower = upper.map(|t: [u32; 3]| t.map(|v| if v == 0 { 0 } else { v + 3 })).map(|[a, b, c]| [a, c, b]);
    made(positions, upper.into_iter().chain(lower).collect())
}

/// `pages` triangles incident to one edge, all oriented from its first vertex to its second: a non-manifold edge for three
/// pages or more.
pub fn book(pages: usize) -> TriMesh {
    let spine = [Point3::origin(), Point3::new(0.0, 0.0, 1.0)];
    let page = |k: usize| {
        let angle = TAU * k as f64 / pages as f64;
        Point3::new(angle.cos(), angle.sin(), 0.5)
    };
    let positions = spine.into_iter().chain((0..pages).map(page)).collect();
    made(positions, (0..pages as u32).map(|k| [0, 1, k + 2]).collect())
}

/// Disjoint union of the meshes, translated along x so that their bounding boxes do not overlap.
pub fn disjoint(parts: &[TriMesh]) -> TriMesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut right = None;
    for part in parts {
        let first = positions.len() as u32;
        let Some((low, high)) = part.bounding_box() else { continue };
        let shift = right.map_or(0.0, |right: f64| right + 0.5 * (high - low).norm() - low.x);
        right = Some(high.x + shift);
        positions.extend(part.positions().iter().map(|p| p + Vector3::x() * shift));
        triangles.extend(part.triangles().iter().map(|t| t.map(|v| v + first)));
    }
    made(positions, triangles)
}

/// Triangle soup: the same triangles, each with three separate vertices.
pub fn soup(mesh: &TriMesh) -> TriMesh {
    let positions = (0..mesh.triangle_count()).flat_map(|t| mesh.corners(t)).collect();
    made(positions, (0..mesh.triangle_count() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect())
}
