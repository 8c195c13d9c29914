//! Lumped mass matrix: the area associated with each vertex. Both variants sum to the surface area.

use nalgebra::Vector3;

use super::cotangents::unit_normal;
use super::{CotangentRule, Cotangents};
use crate::mesh::TriMesh;

/// Barycentric areas: a third of each triangle to each of its corners; squared units of the positions.
pub fn barycentric_areas(mesh: &TriMesh) -> Vec<f64> {
    let mut areas = vec![0.0; mesh.vertex_count()];
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let third = mesh.area_normal(t).norm() / 6.0;
        for &v in corners {
            areas[v as usize] += third;
        }
    }
    areas
}

/// Mixed Voronoi areas: the Voronoi region of each corner within each triangle; in an obtuse triangle half of the area for the
/// obtuse corner and a quarter for each other corner. Positive, and more uniform than the barycentric areas; squared units of
/// the positions.
///
/// # Reference
/// M. Meyer, M. Desbrun, P. Schröder, A. H. Barr, *Discrete differential-geometry operators for triangulated
/// 2-manifolds*, VisMath 2002, section 3.3.
pub fn mixed_voronoi_areas(mesh: &TriMesh) -> Vec<f64> {
    let cotangents = Cotangents::new(mesh, CotangentRule::Raw);
    let mut areas = vec![0.0; mesh.vertex_count()];
    for (t, (corners, half)) in mesh.triangles().iter().zip(cotangents.half()).enumerate() {
        let area = 0.5 * mesh.area_normal(t).norm();
        let p = mesh.corners(t);
        // ⅛ |e|² cot of the edge opposite each corner.
        let eighth = |k: usize| 0.25 * half[k] * (p[(k + 2) % 3] - p[(k + 1) % 3]).norm_squared();
        let obtuse = (0..3).find(|&k| half[k] < 0.0);
        let degenerate = unit_normal(&p, &mesh.area_normal(t)) == Vector3::zeros();
        for k in 0..3 {
            areas[corners[k] as usize] += match obtuse {
                _ if degenerate => area / 3.0,
                None => eighth((k + 1) % 3) + eighth((k + 2) % 3),
                Some(wide) if wide == k => 0.5 * area,
                Some(_) => 0.25 * area,
            };
        }
    }
    areas
}
