//! The prisms of a mesh: one body per triangle, a joint per shared edge.

use nalgebra::Vector3;

use super::ShellMaterial;
use super::shell::{Joint, Shell};
use crate::mesh::{TriMesh, edge_groups};

/// Maximum weight `‖e‖² / (A_i + A_j)` of a joint; 1.15 between equilateral triangles, unbounded between needles. Larger weights
/// cost digits of the solve, much smaller ones let long triangles separate.
const MAX_WEIGHT: f64 = 1e3;

/// A shell of prisms `±h/2` along the vertex normals of a mesh, without fixed bodies.
///
/// `thickness` is `h` in units of the mesh. At an edge with more than two triangles each is joined to the next one.
pub(super) fn prisms(mesh: &TriMesh, thickness: f64, material: &ShellMaterial<'_>) -> Shell {
    let position = |v: u32| mesh.positions()[v as usize].coords;
    let centers: Vec<_> = mesh.triangles().iter().map(|t| t.map(position).iter().sum::<Vector3<f64>>() / 3.0).collect();
    let normals = mesh.vertex_normals();
    let area = |t: u32| 0.5 * mesh.area_normal(t as usize).norm();
    let stiffness = |t: u32| material.stiffness.map_or(1.0, |s| s[t as usize]);
    let grain = |t: u32| material.grain.map_or(Vector3::zeros(), |g| g[t as usize]);
    let joint = |[a, b]: [u32; 2], i: u32, j: u32| {
        let (p, q) = (position(a), position(b));
        let [up_p, up_q] = [a, b].map(|v| normals[v as usize] * (0.5 * thickness));
        let edge = (q - p).norm_squared();
        let weight = if edge > 0.0 { edge / (area(i) + area(j)).max(edge / MAX_WEIGHT) } else { 0.0 };
        let corners = [p - up_p, q - up_q, q + up_q, p + up_p];
        let mut joint = Joint::over([i, j], weight * 0.5 * (stiffness(i) + stiffness(j)), &corners);
        // Bending at an edge is in the direction across it: take the component of the grain across the edge.
        let along = (q - p).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
        let across = [i, j].map(|t| (grain(t) - along * along.dot(&grain(t))).norm_squared());
        joint.stiffen(&(up_p + up_q), 0.5 * (across[0] + across[1]));
        joint
    };
    let mut joints = Vec::new();
    for edge in edge_groups(mesh.triangles().as_flattened()).iter() {
        let ends = [edge[0].0 >> 32, edge[0].0].map(|v| v as u32);
        if ends[0] != ends[1] {
            let mut triangles: Vec<u32> = edge.iter().map(|(_, h)| h / 3).collect();
            triangles.dedup();
            joints.extend(triangles.windows(2).map(|w| joint(ends, w[0], w[1])));
        }
    }
    Shell { free: vec![true; centers.len()], centers, joints }
}

/// Mean edge length over all triangles (inner edges count twice); 0 without triangles.
pub(super) fn mean_edge(mesh: &TriMesh) -> f64 {
    let around = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (b - a).norm() + (c - b).norm() + (a - c).norm()
    };
    let n = mesh.triangle_count();
    if n == 0 { 0.0 } else { (0..n).map(around).sum::<f64>() / (3 * n) as f64 }
}
