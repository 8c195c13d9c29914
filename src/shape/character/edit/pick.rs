//! Picking of a point inside the surface.

use nalgebra::Point3;

use crate::mesh::TriMesh;
use plumbline_num::spatial::{Ray, ray_crosses_triangle};

/// Midpoint of the first interval in which a ray is inside a surface: from its first entry (front face) to the next exit (back face). If it
/// starts inside, or there is no such pair, the midpoint of the first two intersections. `None` for fewer than two intersections.
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

/// Ray parameter of the intersection with a triangle, and whether it is on the front face (counterclockwise corners). Edges belong to the
/// triangle, so that a ray cannot slip between two.
fn meeting([a, b, c]: [Point3<f64>; 3], ray: &Ray) -> Option<(f64, bool)> {
    let met = ray_crosses_triangle(ray, &a, &(b - a), &(c - a))?;
    (met.is_inside(0.0) && met.t >= 0.0).then_some((met.t, !met.leaves))
}
