//! The middle of a body under a picked pixel.

use nalgebra::Point3;

use crate::mesh::TriMesh;
use plumbline_num::spatial::{Ray, ray_crosses_triangle};

/// Halfway between the first place where a ray enters a surface and the next where it leaves it: where the ray meets triangles
/// from their outer side, and from their inner side. Where it begins inside, or the surface has no inner side there, halfway
/// between the first two places that it meets. None where it meets fewer than two.
pub fn volume_center(mesh: &TriMesh, ray: &Ray) -> Option<Point3<f64>> {
    let mut met: Vec<(f64, bool)> = (0..mesh.triangle_count()).filter_map(|t| meeting(mesh.corners(t), ray)).collect();
    met.sort_by(|a, b| a.0.total_cmp(&b.0));
    let entry = met.iter().position(|&(_, outer)| outer);
    let exit = entry.and_then(|e| met[e..].iter().find(|&&(_, outer)| !outer));
    let (near, far) = if let (Some(entry), Some(exit)) = (entry, exit) {
        (met[entry].0, exit.0)
    } else {
        let first = met.first()?.0;
        (first, met.iter().find(|(t, _)| *t > first)?.0)
    };
    Some(ray.origin + ray.direction * (0.5 * (near + far)))
}

/// Where along the ray a triangle is met, and whether on its outer side (its corners run counterclockwise there); edges belong to
/// the triangle, so that nothing slips between two.
fn meeting([a, b, c]: [Point3<f64>; 3], ray: &Ray) -> Option<(f64, bool)> {
    let met = ray_crosses_triangle(ray, &a, &(b - a), &(c - a))?;
    (met.is_inside(0.0) && met.t >= 0.0).then_some((met.t, !met.leaves))
}
