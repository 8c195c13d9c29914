//! Points that walk on a surface.

use std::collections::HashMap;

use nalgebra::{Matrix3x2, Point3, Vector2, Vector3};

use super::super::bvh::SurfacePoint;
use crate::mesh::TriMesh;

/// Maximum triangles that one step crosses.
const MAX_CROSSED: usize = 1000;

/// A surface that points walk on. It need not be a manifold: edges that do not have exactly one triangle on each side are borders.
pub(super) struct Ground<'m> {
    mesh: &'m TriMesh,
    /// The half-edge `3t + k`, from corner `k` to `k + 1` of triangle `t`, on the other side.
    twins: Vec<Option<u32>>,
    normals: Vec<Vector3<f64>>,
}

/// A point of the surface, and the surface's normal there, interpolated.
#[derive(Clone, Copy)]
pub(super) struct Foot {
    triangle: u32,
    weights: [f64; 3],
    pub(super) point: Vector3<f64>,
    pub(super) normal: Vector3<f64>,
}

impl Foot {
    /// The point as a surface point.
    pub(super) fn surface_point(&self, ground: &Ground<'_>) -> SurfacePoint {
        SurfacePoint::on(ground.mesh, self.triangle, self.weights)
    }
}

impl<'m> Ground<'m> {
    pub(super) fn new(mesh: &'m TriMesh) -> Self {
        // `None` where several half-edges run the same way.
        let mut from_to: HashMap<(u32, u32), Option<u32>> = HashMap::new();
        let half_edges = || (0..).zip(mesh.triangles().iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]));
        for (h, edge) in half_edges() {
            from_to.entry(edge).and_modify(|known| *known = None).or_insert(Some(h));
        }
        let of = |edge: &(u32, u32)| from_to.get(edge).copied().flatten();
        let twins = half_edges().map(|(_, (a, b))| of(&(a, b)).and(of(&(b, a)))).collect();
        Self { mesh, twins, normals: mesh.vertex_normals() }
    }

    /// Which vertices are at a border.
    pub(super) fn border(&self) -> Vec<bool> {
        let mut at_border = vec![false; self.mesh.vertex_count()];
        for (h, _) in self.twins.iter().enumerate().filter(|(_, twin)| twin.is_none()) {
            let corners = self.mesh.triangles()[h / 3];
            for k in [h % 3, (h + 1) % 3] {
                at_border[corners[k] as usize] = true;
            }
        }
        at_border
    }

    pub(super) fn area(&self) -> f64 {
        self.mesh.area()
    }

    /// The foot at a surface point.
    pub(super) fn foot(&self, at: &SurfacePoint) -> Foot {
        self.stand(at.triangle, at.weights)
    }

    fn stand(&self, triangle: u32, weights: [f64; 3]) -> Foot {
        let corners = self.mesh.triangles()[triangle as usize].iter().zip(weights);
        let zero = (Vector3::zeros(), Vector3::zeros());
        let (point, normal) = corners.fold(zero, |(point, normal), (&v, w)| {
            (point + self.mesh.positions()[v as usize].coords * w, normal + self.normals[v as usize] * w)
        });
        Foot { triangle, weights, point, normal }
    }

    /// An orthonormal basis of the plane of a foot's triangle; `None` if that is degenerate.
    pub(super) fn plane(&self, foot: &Foot) -> Option<Matrix3x2<f64>> {
        let [a, b, c] = self.mesh.corners(foot.triangle as usize);
        let first = (b - a).try_normalize(0.0)?;
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        Some(Matrix3x2::from_columns(&[first, normal.cross(&first)]))
    }

    /// The end of the straight path along `step`, a vector in the plane of the foot's triangle: it keeps its angle to the edges that it
    /// crosses, and follows a border.
    pub(super) fn walk(&self, foot: &Foot, step: &Vector3<f64>) -> Foot {
        let (mut triangle, mut weights, mut left) = (foot.triangle, foot.weights, *step);
        for _ in 0..MAX_CROSSED {
            let p = self.mesh.corners(triangle as usize);
            let Some(rates) = barycentric_rates(&p, &left) else { break };
            // The part of the step up to the edge that is met first, opposite a corner.
            let mut part = 1.0;
            let mut met = None;
            for k in (0..3).filter(|&k| rates[k] < 0.0) {
                let until = (weights[k] / -rates[k]).max(0.0);
                if until < part {
                    (part, met) = (until, Some(k));
                }
            }
            for (w, rate) in weights.iter_mut().zip(rates) {
                *w = (*w + part * rate).max(0.0);
            }
            let Some(k) = met else { break };
            weights[k] = 0.0;
            let sum: f64 = weights.iter().sum();
            weights = weights.map(|w| w / sum);
            left *= 1.0 - part;
            let [a, b] = [1, 2].map(|next| (k + next) % 3);
            let Some(edge) = (p[b] - p[a]).try_normalize(0.0) else { break };
            let along = edge * left.dot(&edge);
            let Some(twin) = self.twins[3 * triangle as usize + a] else {
                if part == 0.0 {
                    break;
                }
                left = along;
                continue;
            };
            // There, corner `j` is `b`, and the next one `a`.
            let (other, j) = (twin / 3, twin as usize % 3);
            let beyond = self.mesh.corners(other as usize)[(j + 2) % 3] - p[a];
            let Some(inward) = (beyond - edge * beyond.dot(&edge)).try_normalize(0.0) else { break };
            left = along + inward * (left - along).norm();
            let mut there = [0.0; 3];
            (there[j], there[(j + 1) % 3]) = (weights[b], weights[a]);
            (triangle, weights) = (other, there);
        }
        self.stand(triangle, weights)
    }
}

/// Change of the barycentric coordinates along a vector; `None` for a degenerate triangle.
fn barycentric_rates(corners: &[Point3<f64>; 3], along: &Vector3<f64>) -> Option<[f64; 3]> {
    let edges = Matrix3x2::from_columns(&[corners[1] - corners[0], corners[2] - corners[0]]);
    let rates: Vector2<f64> = (edges.transpose() * edges).try_inverse()? * (edges.transpose() * along);
    let rates = [-rates[0] - rates[1], rates[0], rates[1]];
    rates.iter().all(|r| r.is_finite()).then_some(rates)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn middle(ground: &Ground<'_>, t: u32) -> Foot {
        ground.stand(t, [1.0 / 3.0; 3])
    }

    #[test]
    fn a_path_on_a_plane_is_straight_and_ends_along_the_border() {
        let plane = shapes::plane(8);
        let ground = Ground::new(&plane);
        let foot = middle(&ground, 72);
        for step in [Vector3::new(0.21, -0.13, 0.0), Vector3::new(-0.3, 0.17, 0.0), Vector3::new(0.0, 0.25, 0.0)] {
            let end = ground.walk(&foot, &step);
            assert!((end.point - foot.point - step).norm() < 1e-12, "{} {step}", end.point);
        }
        let (low, high) = plane.bounding_box().unwrap();
        let end = ground.walk(&foot, &Vector3::new(10.0, 0.1, 0.0));
        assert!((end.point.x - high.x).abs() < 1e-12 && end.point.y > foot.point.y && end.point.y <= high.y);
        assert!((ground.walk(&foot, &Vector3::new(-10.0, -10.0, 0.0)).point - low.coords).norm() < 1e-9);
    }

    #[test]
    fn a_path_around_a_ball_comes_back() {
        let ball = shapes::icosphere(5);
        let ground = Ground::new(&ball);
        let foot = middle(&ground, 1234);
        let plane = ground.plane(&foot).unwrap();
        for angle in [0.0_f64, 0.7, 2.0] {
            let around = plane * Vector2::new(angle.cos(), angle.sin()) * std::f64::consts::TAU;
            let end = ground.walk(&foot, &around);
            assert!((end.point - foot.point).norm() < 0.05, "{}", (end.point - foot.point).norm());
        }
    }

    #[test]
    fn edges_of_more_than_two_triangles_are_borders() {
        let plane = shapes::plane(2);
        let inner = Ground::new(&plane).twins.iter().position(Option::is_some).unwrap();
        assert_eq!(Ground::new(&plane).twins.iter().flatten().count(), 2 * 8);
        // A third triangle at an inner edge.
        let ends = [inner % 3, (inner + 1) % 3].map(|k| plane.triangles()[inner / 3][k]);
        let mut positions = plane.positions().to_vec();
        positions.push(Point3::new(0.5, 0.5, 1.0));
        let fin = [ends[0], ends[1], plane.vertex_count() as u32];
        let mesh = TriMesh::new(positions, [plane.triangles(), &[fin]].concat()).unwrap();
        let ground = Ground::new(&mesh);
        assert_eq!(ground.twins[inner], None);
        assert_eq!(ground.twins.iter().flatten().count(), 2 * 7);
        // The eight around, the middle as one end, and the tip.
        assert_eq!(ground.border().iter().filter(|b| **b).count(), 10);
    }
}
