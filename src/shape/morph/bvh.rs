//! Closest points on a surface and overlapping pairs of triangles, by a bounding volume hierarchy.

use nalgebra::{Point3, Vector3};

use crate::mesh::TriMesh;
use plumbline_num::run::{Interrupt, Run, Stopped};
use plumbline_num::spatial::{Aabb, BoxTree, closest_point_on_triangle};

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// The triangle.
    pub triangle: u32,
    /// Its barycentric coordinates, which sum to 1.
    pub weights: [f64; 3],
    /// Its position.
    pub point: Point3<f64>,
    /// Squared distance from the query point.
    pub squared: f64,
}

/// Barycentric coordinates of the corners of a triangle.
pub(super) const CORNERS: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl SurfacePoint {
    /// The point of a triangle with these barycentric coordinates.
    pub(super) fn on(mesh: &TriMesh, triangle: u32, weights: [f64; 3]) -> Self {
        let corners = mesh.corners(triangle as usize);
        let point: Vector3<f64> = corners.iter().zip(weights).map(|(c, w)| c.coords * w).sum();
        Self { triangle, weights, point: Point3::from(point), squared: 0.0 }
    }
}

/// A bounding volume hierarchy over the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct Bvh {
    tree: BoxTree,
    /// Corners of the triangles in the order of the tree.
    corners: Vec<[Point3<f64>; 3]>,
}

impl Bvh {
    /// The hierarchy of a mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let tree = BoxTree::of_triangles((0..mesh.triangle_count()).map(|t| mesh.corners(t)));
        let corners = tree.order().iter().map(|t| mesh.corners(*t as usize)).collect();
        Self { tree, corners }
    }

    /// The closest point among the accepted triangles; of equally near ones that of the lowest triangle. `None` if no triangle is
    /// accepted.
    pub fn nearest(&self, point: &Point3<f64>, accept: impl Fn(u32) -> bool) -> Option<SurfacePoint> {
        self.nearest_counted(point, accept).0
    }

    /// As [`Self::nearest`], with the number of triangles whose closest points were computed: a few dozens on a surface, most of
    /// them where triangles overlap everywhere.
    pub(super) fn nearest_counted(
        &self,
        point: &Point3<f64>,
        accept: impl Fn(u32) -> bool,
    ) -> (Option<SurfacePoint>, usize) {
        let mut best: Option<SurfacePoint> = None;
        let mut tests = 0;
        self.tree.near(point, f64::INFINITY, |items| {
            tests += items.len();
            for (corners, &t) in self.corners[items.clone()].iter().zip(&self.tree.order()[items]) {
                let weights = closest_point_on_triangle(point, corners).weights;
                let [a, b, c] = corners;
                let closest = a + (b - a) * weights[1] + (c - a) * weights[2];
                let squared = (closest - point).norm_squared();
                let better = |b: SurfacePoint| (squared, t) < (b.squared, b.triangle);
                if best.is_none_or(better) && accept(t) {
                    best = Some(SurfacePoint { triangle: t, weights, point: closest, squared });
                }
            }
            best.map_or(f64::INFINITY, |b| b.squared)
        });
        (best, tests)
    }

    /// Visits each pair of triangles `t < u` with overlapping boxes; whether `most` tests of two boxes of triangles were enough.
    pub(super) fn pairs(&self, most: usize, mut visit: impl FnMut(u32, u32), run: &Run) -> Result<bool, Stopped> {
        // The traversal ends with the run, or after so many tests.
        let traversal = Run::with_interrupt(&Interrupt::new());
        let mut tests = 0;
        let overlapping = |i: usize, j: usize| {
            tests += 1;
            if tests > most || run.check().is_err() {
                traversal.interrupt.stop();
            } else if Aabb::around(&self.corners[i]).overlaps(&Aabb::around(&self.corners[j])) {
                let [t, u] = [i, j].map(|k| self.tree.order()[k]);
                visit(t.min(u), t.max(u));
            }
        };
        let whole = self.tree.pairs(overlapping, &traversal).is_ok();
        run.complete(whole)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn the_closest_point_is_that_of_an_exhaustive_search() {
        let mesh = shapes::cactus(8);
        let bvh = Bvh::new(&mesh);
        let mut rng = fastrand::Rng::with_seed(4);
        let (low, high) = mesh.bounding_box().unwrap();
        for _ in 0..200 {
            let p = low + (high - low).component_mul(&Vector3::from_fn(|_, _| 1.4 * rng.f64() - 0.2));
            let odd = rng.bool();
            let wanted = |t: u32| !odd || t % 2 == 1;
            let found = bvh.nearest(&p, wanted).unwrap();
            let everywhere = (0..mesh.triangle_count() as u32).filter(|&t| wanted(t)).map(|t| {
                // Sampled: never nearer.
                let [a, b, c] = mesh.corners(t as usize);
                (0..=8)
                    .flat_map(move |i| (0..=8 - i).map(move |j| (f64::from(i) / 8.0, f64::from(j) / 8.0)))
                    .map(|(u, v)| (a + (b - a) * u + (c - a) * v - p).norm_squared())
                    .fold(f64::MAX, f64::min)
            });
            let sampled = everywhere.fold(f64::MAX, f64::min);
            assert!(wanted(found.triangle) && found.squared <= sampled + 1e-12, "{} {sampled}", found.squared);
            let corners = mesh.corners(found.triangle as usize);
            let point: Vector3<f64> = corners.iter().zip(found.weights).map(|(p, w)| p.coords * w).sum();
            assert!((point - found.point.coords).norm() < 1e-12 && found.weights.iter().all(|w| *w >= -1e-15));
            assert!(((found.point - p).norm_squared() - found.squared).abs() < 1e-15);
        }
        assert!(bvh.nearest(&low, |_| false).is_none());
    }
}
