//! Vertices that are not part of the shape: errors of a scan or of a conversion, far from everything else.
//!
//! One vertex a million diameters away makes every length that is measured on the whole surface useless: bounding box, area, centroid.
//! With `c` the coordinatewise median of the referenced vertices, `dᵢ` their distances from it in ascending order and `q` the
//! distance that nine tenths of them do not exceed, the outliers are the vertices from the first `k` on with
//!
//! `d_k > 100 q`,   `d_k > 10 d_(k−1)`,   `k ≥ 0.99 n`.
//!
//! A long thin part is no outlier: its vertices leave no gap of a factor of ten, or are more than one in a hundred. The definition is
//! invariant under similarity transforms along the axes.

use nalgebra::Point3;

use super::TriMesh;

/// Distance of outliers, in distances that nine tenths of the vertices do not exceed. At 10 the tip of an antenna that is modeled by a
/// few vertices would be one; at 1000 an outlier takes nine tenths of the area of a figure of some thousand vertices.
const MIN_DISTANCE_RATIO: f64 = 100.0;
/// Ratio of the distances of the nearest outlier and of the farthest other vertex.
const MIN_GAP_RATIO: f64 = 10.0;
/// Outliers are at most one in this many vertices: more are a part of the shape.
const VERTICES_PER_OUTLIER: usize = 100;

impl TriMesh {
    /// Vertices far from all others, ascending; see the definition in `src/shape/mesh/outliers.rs`. Unreferenced vertices do not count.
    pub fn outliers(&self) -> Vec<u32> {
        let (referenced, _) = self.referenced_and_isolated();
        let n = referenced.len();
        if n < VERTICES_PER_OUTLIER {
            return Vec::new();
        }
        let at = |v: &u32| &self.positions()[*v as usize];
        let median = |axis: usize| {
            let mut values: Vec<f64> = referenced.iter().map(|v| at(v)[axis]).collect();
            *values.select_nth_unstable_by(n / 2, f64::total_cmp).1
        };
        let center = Point3::new(median(0), median(1), median(2));
        let distance = |v: &u32| nalgebra::distance(at(v), &center);
        let mut sorted: Vec<(f64, u32)> = referenced.iter().map(|v| (distance(v), *v)).collect();
        sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let usual = sorted[n * 9 / 10].0;
        let is_first = |k: &usize| {
            let (before, own) = (sorted[*k - 1].0, sorted[*k].0);
            usual > 0.0 && own > MIN_DISTANCE_RATIO * usual && own > MIN_GAP_RATIO * before
        };
        let first = (n - n / VERTICES_PER_OUTLIER..n).find(is_first).unwrap_or(n);
        let mut found: Vec<u32> = sorted[first..].iter().map(|(_, v)| *v).collect();
        found.sort_unstable();
        found
    }

    /// The mesh without the triangles that have one of these vertices, which are ascending. Vertices keep their indices.
    #[must_use]
    pub fn without_triangles_at(&self, vertices: &[u32]) -> Self {
        let apart = |t: &&[u32; 3]| t.iter().all(|v| vertices.binary_search(v).is_err());
        let all: Vec<u32> = (0..self.vertex_count() as u32).collect();
        self.restricted(&all, self.triangles().iter().filter(apart).copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::Vector3;

    fn with_moved(mesh: &TriMesh, moved: &[(usize, Point3<f64>)]) -> TriMesh {
        let mut positions = mesh.positions().to_vec();
        for (v, p) in moved {
            positions[*v] = *p;
        }
        mesh.with_positions(positions).unwrap()
    }

    #[test]
    fn far_vertices_are_outliers_wherever_the_mesh_is_and_however_large() {
        let ball = shapes::icosphere(3);
        assert!(ball.outliers().is_empty());
        let far = with_moved(&ball, &[(7, Point3::new(1e6, 0.0, 3.0)), (9, Point3::new(0.0, -2e3, 0.0))]);
        assert_eq!(far.outliers(), [7, 9]);
        let placed = |p: &Point3<f64>| Point3::from(p.coords * 1e-9 + Vector3::new(5.0, -70.0, 0.25));
        let elsewhere = far.with_positions(far.positions().iter().map(placed).collect()).unwrap();
        assert_eq!(elsewhere.outliers(), [7, 9]);
        let around = ball.triangles().iter().filter(|t| t.contains(&7)).count();
        assert_eq!(far.without_triangles_at(&[7]).triangle_count(), ball.triangle_count() - around);
    }

    #[test]
    fn parts_of_the_shape_are_no_outliers() {
        // An antenna whose vertices lead to its end, a second body far away, and a shape of few vertices.
        let ball = shapes::icosphere(4);
        let step = |k: usize| (k, Point3::new(3.0_f64.powi(k as i32), 0.0, 0.0));
        let antenna: Vec<_> = (0..10).map(step).collect();
        assert!(with_moved(&ball, &antenna).outliers().is_empty());
        let body: Vec<_> = (0..ball.vertex_count() / 50).map(|k| (k, Point3::new(1e6, k as f64, 0.0))).collect();
        assert!(with_moved(&ball, &body).outliers().is_empty());
        assert!(with_moved(&shapes::icosphere(1), &[(0, Point3::new(1e6, 0.0, 0.0))]).outliers().is_empty());
    }
}
