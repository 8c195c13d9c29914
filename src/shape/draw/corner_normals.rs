//! Normals per triangle corner: smooth, except across creases.
//!
//! The normal at a corner is the area-weighted sum over those triangles around the vertex whose normal differs from that of the
//! corner's triangle by less than the crease angle. Orientation counts: flipped neighbors are excluded.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::mesh::TriMesh;

/// Unit normals at the corners of every triangle; zero for a degenerate triangle.
pub(super) fn corner_normals(mesh: &TriMesh, crease_deg: f64) -> Vec<[Vector3<f32>; 3]> {
    let count = mesh.triangle_count();
    let scale = mesh.diagonal().powi(-2);
    let scale = if scale.is_finite() { scale } else { 1.0 };
    // In units of the diagonal: normals have the length of areas, which may overflow single precision.
    let area: Vec<Vector3<f32>> = (0..count).into_par_iter().map(|t| (mesh.area_normal(t) * scale).cast()).collect();
    let unit: Vec<Vector3<f32>> = area.par_iter().map(normalized).collect();
    let around = mesh.triangles_of_vertices();
    let least = crease_deg.clamp(0.0, 180.0).to_radians().cos() as f32;
    let corner = |t: usize, v: u32| {
        let own = unit[t];
        let near = around.of(v as usize).iter().map(|n| *n as usize).filter(|n| unit[*n].dot(&own) >= least);
        let smooth = normalized(&near.map(|n| area[n]).sum());
        if smooth == Vector3::zeros() { own } else { smooth }
    };
    (0..count).into_par_iter().map(|t| mesh.triangles()[t].map(|v| corner(t, v))).collect()
}

fn normalized(v: &Vector3<f32>) -> Vector3<f32> {
    let wide: Vector3<f64> = v.cast();
    wide.try_normalize(0.0).unwrap_or_else(Vector3::zeros).cast()
}
