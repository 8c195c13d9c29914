//! The prisms over a mesh: one body per triangle, joints where triangles share an edge.

use nalgebra::Vector3;

use super::Fabric;
use super::shell::{Joint, Shell};
use crate::mesh::TriMesh;

/// Most that a joint's weight `‖e‖² / (A_i + A_j)` may be; 1.15 between equilateral triangles, without bound between needles.
/// Beyond it they would cost the solve its digits, well below it long triangles would come apart.
const STIFFEST: f64 = 1e3;

/// A shell over a mesh, of prisms `±h/2` along the vertex normals, and nothing fixed.
///
/// `thickness` is `h` in units of the mesh. Of an edge in more than two triangles, each is joined to the next one.
pub(super) fn prisms(mesh: &TriMesh, thickness: f64, fabric: &Fabric<'_>) -> Shell {
    let place = |v: u32| mesh.positions()[v as usize].coords;
    let centers: Vec<_> = mesh.triangles().iter().map(|t| t.map(place).iter().sum::<Vector3<f64>>() / 3.0).collect();
    let normals = mesh.vertex_normals();
    let area = |t: u32| 0.5 * mesh.area_normal(t as usize).norm();
    let firmness = |t: u32| fabric.stiffness.map_or(1.0, |s| s[t as usize]);
    let grain = |t: u32| fabric.grain.map_or(Vector3::zeros(), |g| g[t as usize]);
    let joint = |[a, b]: [u32; 2], i: u32, j: u32| {
        let (p, q) = (place(a), place(b));
        let [up_p, up_q] = [a, b].map(|v| normals[v as usize] * (0.5 * thickness));
        let edge = (q - p).norm_squared();
        let weight = if edge > 0.0 { edge / (area(i) + area(j)).max(edge / STIFFEST) } else { 0.0 };
        let corners = [p - up_p, q - up_q, q + up_q, p + up_p];
        let mut joint = Joint::over([i, j], weight * 0.5 * (firmness(i) + firmness(j)), &corners);
        // Bending at an edge is bending across it: what of the grain is not along the edge counts.
        let along = (q - p).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let across = [i, j].map(|t| (grain(t) - along * along.dot(&grain(t))).norm_squared());
        joint.stiffen(&(up_p + up_q), 0.5 * (across[0] + across[1]));
        joint
    };
    let mut edges = sorted_edges(mesh);
    let joints = edges
        .chunk_by_mut(|a, b| a.0 == b.0)
        .flat_map(|at_edge| at_edge.windows(2).map(|w| joint(w[0].0, w[0].1, w[1].1)).collect::<Vec<_>>())
        .collect();
    Shell { free: vec![true; centers.len()], centers, joints }
}

/// Edges with their triangles, those of one edge together. Edges of a vertex with itself are none.
fn sorted_edges(mesh: &TriMesh) -> Vec<([u32; 2], u32)> {
    let mut edges = Vec::with_capacity(3 * mesh.triangle_count());
    for (t, &[a, b, c]) in mesh.triangles().iter().enumerate() {
        let ends = [(a, b), (b, c), (c, a)].into_iter().filter(|(i, j)| i != j);
        edges.extend(ends.map(|(i, j)| ([i.min(j), i.max(j)], t as u32)));
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// Mean length of the edges of all triangles, inner ones counted twice; 0 without triangles.
pub(super) fn mean_edge(mesh: &TriMesh) -> f64 {
    let around = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    };
    let n = mesh.triangle_count();
    if n == 0 { 0.0 } else { (0..n).map(around).sum::<f64>() / (3 * n) as f64 }
}
