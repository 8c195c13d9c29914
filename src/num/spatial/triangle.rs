//! Triangles against points and rays.

use nalgebra::{Point3, Vector3};

use super::Ray;

/// The point of a triangle nearest to another point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosestPoint {
    /// Where it is; a corner exactly where a corner is nearest.
    pub point: Point3<f64>,
    /// Its barycentric coordinates, which sum to 1.
    pub weights: [f64; 3],
}

/// Where the line of a ray meets the plane of a triangle `a + u (b − a) + v (c − a)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Parameter along the ray.
    pub t: f64,
    /// Barycentric coordinate of `b`.
    pub u: f64,
    /// Barycentric coordinate of `c`.
    pub v: f64,
    /// Whether the ray goes along the normal `(b − a) × (c − a)`.
    pub leaves: bool,
}

impl Crossing {
    /// In the triangle or up to `edge` (in barycentric coordinates) beside it.
    #[inline]
    pub fn is_inside(&self, edge: f64) -> bool {
        self.u >= -edge && self.v >= -edge && self.u + self.v <= 1.0 + edge
    }
}

/// The point of a triangle nearest to `p`, by the part of the plane (corner, edge, inside) that contains `p`.
///
/// # Reference
/// C. Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
// Half of the callers need no weights, half no point: where it is inlined these cost nothing.
#[inline(always)]
#[allow(clippy::inline_always)]
pub fn closest_point_on_triangle(p: &Point3<f64>, [a, b, c]: &[Point3<f64>; 3]) -> ClosestPoint {
    let at = |point, weights| ClosestPoint { point, weights };
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return at(*a, [1.0, 0.0, 0.0]);
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return at(*b, [0.0, 1.0, 0.0]);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = d1 / (d1 - d3);
        return at(a + ab * v, [1.0 - v, v, 0.0]);
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return at(*c, [0.0, 0.0, 1.0]);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = d2 / (d2 - d6);
        return at(a + ac * w, [1.0 - w, 0.0, w]);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return at(b + (c - b) * w, [0.0, 1.0 - w, w]);
    }
    let sum = va + vb + vc;
    at(a + ab * (vb / sum) + ac * (vc / sum), [va / sum, vb / sum, vc / sum])
}

/// Where a ray meets the plane of the triangle with the corner `a` and the edges `ab` and `ac` from it; `None` along the plane.
///
/// # Reference
/// T. Möller, B. Trumbore, *Fast, minimum storage ray/triangle intersection*, Journal of Graphics Tools 2 (1997).
// As above: the parameter costs a division that most callers need for few triangles.
#[inline(always)]
#[allow(clippy::inline_always)]
pub fn ray_crosses_triangle(ray: &Ray, a: &Point3<f64>, ab: &Vector3<f64>, ac: &Vector3<f64>) -> Option<Crossing> {
    let p = ray.direction.cross(ac);
    let det = ab.dot(&p);
    if det == 0.0 {
        return None;
    }
    let s = ray.origin - a;
    let u = s.dot(&p) / det;
    let q = s.cross(ab);
    let v = ray.direction.dot(&q) / det;
    Some(Crossing { t: ac.dot(&q) / det, u, v, leaves: det < 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(rng: &mut fastrand::Rng) -> Point3<f64> {
        Point3::from([0; 3].map(|_| 2.0 * rng.f64() - 1.0))
    }

    #[test]
    fn no_point_of_a_triangle_is_nearer_than_the_nearest() {
        let mut rng = fastrand::Rng::with_seed(4);
        for _ in 0..300 {
            let t @ [a, b, c] = [0; 3].map(|_| random(&mut rng));
            let p = random(&mut rng) * 2.0;
            let found = closest_point_on_triangle(&p, &t);
            let [u, v, w] = found.weights;
            assert!(((a.coords * u + b.coords * v + c.coords * w) - found.point.coords).norm() < 1e-14);
            assert!(found.weights.iter().all(|w| *w >= -1e-15) && (u + v + w - 1.0).abs() < 1e-14);
            let least = (found.point - p).norm();
            for (i, j) in (0..=8).flat_map(|i| (0..=8 - i).map(move |j| (f64::from(i) / 8.0, f64::from(j) / 8.0))) {
                assert!((a + (b - a) * i + (c - a) * j - p).norm() >= least - 1e-14);
            }
        }
    }

    #[test]
    fn a_ray_aimed_at_a_place_of_a_triangle_meets_it_there() {
        let mut rng = fastrand::Rng::with_seed(6);
        for _ in 0..300 {
            let [a, b, c, o] = [0; 4].map(|_| random(&mut rng));
            let (u, v) = (rng.f64() * 0.5, rng.f64() * 0.5);
            let (ab, ac) = (b - a, c - a);
            let ray = Ray::new(&o, &((a + ab * u + ac * v - o) * 0.5));
            let found = ray_crosses_triangle(&ray, &a, &ab, &ac).expect("not along the plane");
            assert!((found.t - 2.0).abs() + (found.u - u).abs() + (found.v - v).abs() < 1e-8, "{found:?}");
            assert!(found.is_inside(0.0) && found.leaves == (ray.direction.dot(&ab.cross(&ac)) > 0.0));
            let behind = ray_crosses_triangle(&Ray::new(&o, &-ray.direction), &a, &ab, &ac).expect("met");
            assert!(behind.is_inside(0.0) && behind.t < 0.0);
        }
    }
}
