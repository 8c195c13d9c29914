//! Lumped mass matrix: the area associated with each vertex.

use crate::mesh::TriMesh;

/// Barycentric areas: a third of each triangle to each of its corners; they sum to the area of the surface, in squared units of the
/// positions.
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
