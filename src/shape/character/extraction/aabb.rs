//! Nearest points, ray intersections and inside tests on a surface, with a bounding volume hierarchy.
//!
//! A point is inside if the winding number is not zero: intersecting limbs have a common inside. If triangles at an edge are inconsistently
//! oriented, the winding number is undefined; the parity of intersections decides then.
//!
//! A query visits many triangles where they overlap, and there are many queries: once the run has ended, queries find nothing, and what
//! is made of them is discarded at the next check. The tree counts the triangles that its queries visit; what only improves the curve
//! ends when there have been too many.

use std::cell::Cell;
use std::ops::Range;

use nalgebra::{Point3, Vector3};

use super::caps;
use plumbline_num::run::Run;
use plumbline_num::spatial::{BoxTree, Ray, closest_point_on_triangle, ray_crosses_triangle};

/// Number of visited triangles from which the tree is exhausted: the time of some ten seconds. Queries of a figure visit some ten
/// triangles each, those of a soup of triangles that all overlap visit thousands.
const MAX_VISITS: u64 = 300_000_000;

/// Triangles in a bounding volume hierarchy.
pub(super) struct AabbTree {
    tree: BoxTree,
    /// Corners of the triangles in tree order.
    corners: Vec<[Point3<f64>; 3]>,
    /// Unit normal of each triangle, zero for degenerate ones.
    normals: Vec<Vector3<f64>>,
    /// Whether every half-edge has an opposite one.
    oriented: bool,
    run: Run,
    visits: Cell<u64>,
}

impl AabbTree {
    pub(super) fn new(positions: &[Point3<f64>], triangles: &[[u32; 3]], run: &Run) -> Self {
        let corners_of = |t: &[u32; 3]| t.map(|v| positions[v as usize]);
        let tree = BoxTree::of_triangles(triangles.iter().map(corners_of));
        let corners: Vec<_> = tree.order().iter().map(|t| corners_of(&triangles[*t as usize])).collect();
        let normal = |[a, b, c]: &[Point3<f64>; 3]| (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        Self {
            normals: corners.iter().map(normal).collect(),
            tree,
            corners,
            oriented: caps::boundary(triangles).is_empty(),
            run: run.silent(),
            visits: Cell::new(0),
        }
    }

    /// Whether queries have visited so many triangles that refinements should end.
    pub(super) fn is_exhausted(&self) -> bool {
        self.visits.get() >= MAX_VISITS
    }

    fn count(&self, items: &Range<usize>) {
        self.visits.set(self.visits.get() + items.len() as u64);
    }

    /// The point of the surface nearest to `p`.
    pub(super) fn nearest(&self, p: &Point3<f64>) -> Option<Point3<f64>> {
        let best = self.near(p, (Point3::origin(), f64::INFINITY));
        (best.1 < f64::INFINITY).then_some(best.0)
    }

    /// The point of the surface nearest to `p`; faster the nearer `guess`, a point of the surface, is to `p`.
    pub(super) fn nearest_from(&self, p: &Point3<f64>, guess: &Point3<f64>) -> Point3<f64> {
        self.near(p, (*guess, nalgebra::distance_squared(p, guess))).0
    }

    fn near(&self, p: &Point3<f64>, mut best: (Point3<f64>, f64)) -> (Point3<f64>, f64) {
        if self.run.check().is_err() {
            return best;
        }
        // Points as far as the best are not improvements.
        self.tree.near(p, best.1.next_down(), |items| {
            self.count(&items);
            for (corners, normal) in self.corners[items.clone()].iter().zip(&self.normals[items]) {
                // The distance to the plane bounds that to the triangle from below.
                if normal.dot(&(p - corners[0])).powi(2) >= best.1 {
                    continue;
                }
                let q = closest_point_on_triangle(p, corners).point;
                let d = nalgebra::distance_squared(p, &q);
                if d < best.1 {
                    best = (q, d);
                }
            }
            best.1.next_down()
        });
        best
    }

    /// Parameter `t > 0` of the first intersection of `origin + t direction`.
    pub(super) fn first_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let mut first = f64::INFINITY;
        self.along(&Ray::new(origin, direction), first, &mut |t, _| {
            first = t;
            t
        });
        (first < f64::INFINITY).then_some(first)
    }

    /// Whether `origin + t direction` intersects the surface for `0 < t ≤ until`.
    pub(super) fn is_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>, until: f64) -> bool {
        let mut hit = false;
        self.along(&Ray::new(origin, direction), until, &mut |_, _| {
            hit = true;
            f64::NEG_INFINITY
        });
        hit
    }

    /// Whether `p` is inside, by the majority of three rays.
    pub(super) fn encloses(&self, p: &Point3<f64>) -> bool {
        // Generic directions, unlikely to lie in a plane of a modeled surface.
        const DIRECTIONS: [[f64; 3]; 3] = [[0.751, 0.433, 0.499], [-0.267, 0.802, -0.534], [0.302, -0.503, 0.810]];
        let inside = |d: [f64; 3]| {
            let (mut count, mut winding) = (0, 0);
            self.along(&Ray::new(p, &Vector3::from(d)), f64::INFINITY, &mut |_, leaves| {
                count += 1;
                winding += if leaves { 1 } else { -1 };
                f64::INFINITY
            });
            if self.oriented { winding != 0 } else { count % 2 == 1 }
        };
        let [first, second, third] = DIRECTIONS;
        let said = inside(first);
        if inside(second) == said { said } else { inside(third) }
    }

    /// Calls `meet` for intersections up to the parameter `until`, near boxes first, with whether the ray exits there; it returns the
    /// parameter up to which further intersections matter.
    fn along(&self, ray: &Ray, mut until: f64, meet: &mut impl FnMut(f64, bool) -> f64) {
        if self.run.check().is_err() {
            return;
        }
        self.tree.along(ray, until, |items| {
            self.count(&items);
            for [a, b, c] in &self.corners[items] {
                let met = ray_crosses_triangle(ray, a, &(b - a), &(c - a))
                    .filter(|m| m.is_inside(0.0) && m.t > 0.0 && m.t <= until);
                if let Some(m) = met {
                    until = meet(m.t, m.leaves);
                }
            }
            until
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn queries_agree_with_brute_force() {
        let mesh = shapes::holed_torus(2, 8);
        let tree = AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
        for k in 0..100 {
            let k = f64::from(k);
            let p = Point3::new((k * 0.37).sin() * 2.0, (k * 0.73).cos(), (k * 1.31).sin() * 0.5);
            let d = Vector3::new((k * 0.91).cos(), (k * 0.17).sin(), (k * 0.53).cos());
            let all = || (0..mesh.triangle_count()).map(|t| mesh.corners(t));
            let near = all()
                .map(|t| nalgebra::distance(&p, &closest_point_on_triangle(&p, &t).point))
                .fold(f64::INFINITY, f64::min);
            let hit = all().filter_map(|[a, b, c]| ray_crosses_triangle(&Ray::new(&p, &d), &a, &(b - a), &(c - a)));
            let hit = hit.filter(|m| m.is_inside(0.0) && m.t > 0.0).map(|m| m.t).fold(f64::INFINITY, f64::min);
            assert!((nalgebra::distance(&tree.nearest(&p).unwrap(), &p) - near).abs() < 1e-14);
            let guess = mesh.positions()[k as usize];
            assert!((nalgebra::distance(&tree.nearest_from(&p, &guess), &p) - near).abs() < 1e-14);
            assert_eq!(tree.first_hit(&p, &d).unwrap_or(f64::INFINITY), hit);
            assert_eq!(tree.is_hit(&p, &d, 0.7), hit <= 0.7);
        }
        for nowhere in [Vector3::zeros(), Vector3::repeat(f64::NAN)] {
            assert!(tree.first_hit(&Point3::origin(), &nowhere).is_none());
        }
    }

    #[test]
    fn points_inside_are_inside() {
        let mesh = shapes::icosphere(3);
        let tree = AabbTree::new(mesh.positions(), mesh.triangles(), &Run::default());
        assert!(tree.encloses(&Point3::new(0.1, 0.2, 0.3)) && tree.encloses(&Point3::new(0.0, 0.0, 0.98)));
        assert!(!tree.encloses(&Point3::new(0.0, 1.01, 0.0)) && !tree.encloses(&Point3::new(5.0, 0.0, 0.0)));
    }

    #[test]
    fn the_intersection_of_two_balls_is_inside_and_without_orientation_parity_decides() {
        let ball = shapes::icosphere(3);
        let beside: Vec<_> = ball.positions().iter().map(|p| p + Vector3::x()).collect();
        let positions = [ball.positions(), &beside].concat();
        let n = ball.vertex_count() as u32;
        let other = ball.triangles().iter().map(|t| t.map(|v| v + n));
        let mut triangles: Vec<[u32; 3]> = ball.triangles().iter().copied().chain(other).collect();
        let (shared, own) = (Point3::new(0.5, 0.01, 0.02), Point3::new(-0.5, 0.01, 0.02));
        let tree = AabbTree::new(&positions, &triangles, &Run::default());
        assert!(tree.encloses(&shared) && tree.encloses(&own));
        triangles[0].swap(0, 1);
        let tree = AabbTree::new(&positions, &triangles, &Run::default());
        assert!(!tree.encloses(&shared) && tree.encloses(&own));
    }
}
