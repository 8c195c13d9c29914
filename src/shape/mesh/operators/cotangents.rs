//! Half cotangents of the corner angles of triangles: the weights of all operators and elastic energies of this crate.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::intrinsic_delaunay;
use crate::mesh::TriMesh;

/// Ratio of the doubled area to the squared longest edge below which a triangle is degenerate: its cotangents reach 10¹⁰, and
/// the factorization would lose all digits of the neighboring weights. A larger threshold would include the needles of real
/// scans (1:10⁵); a smaller one meets the limit of positive definiteness in `f64` (10⁻¹³).
const DEGENERATE: f64 = 1e-10;

/// Half the cotangent of 60°, `1 / (2√3)`: the weights of degenerate triangles.
const EQUILATERAL: f64 = 0.288_675_134_594_812_9;

/// Rule for the cotangent weights of edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum CotangentRule {
    /// As they are; obtuse triangles may give negative ones.
    ///
    /// The weight of an edge is negative where its opposite angles sum to more than π.
    #[default]
    Raw,
    /// None below 0.
    ///
    /// Negative half cotangents are set to 0, so that every weight is ≥ 0, at the price of linear precision.
    Clamped,
    /// Those of the intrinsic Delaunay triangulation of the same surface.
    ///
    /// After Bobenko & Springborn 2007: every weight inside the surface is ≥ 0 and the Laplacian is still that of the surface.
    /// The edges of the weights need not be edges of the mesh. Non-manifold edges are not flipped.
    #[serde(rename = "delaunay")]
    IntrinsicDelaunay,
}

/// Triangles with the half cotangents of their angles.
#[derive(Clone, Debug)]
pub struct Cotangents {
    triangles: Vec<[u32; 3]>,
    half: Vec<[f64; 3]>,
    degenerate: usize,
}

impl Cotangents {
    /// Half cotangents of a mesh at rest. A degenerate triangle gets the weights of an equilateral one, so that its vertices
    /// stay connected and nothing divides by its area; the exact weights of the sliver would be infinite, of both signs.
    pub fn new(mesh: &TriMesh, rule: CotangentRule) -> Self {
        let edges: Vec<[f64; 3]> = (0..mesh.triangle_count()).map(|t| squared_edges(&mesh.corners(t))).collect();
        let (triangles, edges) = match rule {
            CotangentRule::IntrinsicDelaunay => intrinsic_delaunay::flipped(mesh.triangles(), edges),
            CotangentRule::Raw | CotangentRule::Clamped => (mesh.triangles().to_vec(), edges),
        };
        let areas: Vec<f64> = match rule {
            // Intrinsic triangles have edge lengths only, no positions.
            CotangentRule::IntrinsicDelaunay => edges.iter().map(doubled_area).collect(),
            CotangentRule::Raw | CotangentRule::Clamped => {
                (0..mesh.triangle_count()).map(|t| mesh.area_normal(t).norm()).collect()
            }
        };
        let mut degenerate = 0;
        let half = edges.iter().zip(areas).map(|(edges, area)| {
            let longest = edges.iter().fold(0.0, |a: f64, &b| a.max(b));
            if !(area > DEGENERATE * longest) {
                degenerate += 1;
                return [EQUILATERAL; 3];
            }
            let half = half_cotangents(edges, area);
            if rule == CotangentRule::Clamped { half.map(|h| h.max(0.0)) } else { half }
        });
        let half = half.collect();
        Self { triangles, half, degenerate }
    }

    /// Clamps the half cotangents to ± `largest`: for systems with squared weights.
    #[must_use]
    pub fn limited(mut self, largest: f64) -> Self {
        self.half.iter_mut().flatten().for_each(|h| *h = h.clamp(-largest, largest));
        self
    }

    /// Vertex indices of the triangles: those of the mesh unless the rule flipped edges.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Half cotangent of the angle at corner `k` of each triangle: its contribution to the weight of the opposite edge, between
    /// corners `k + 1` and `k + 2`. Dimensionless.
    pub fn half(&self) -> &[[f64; 3]] {
        &self.half
    }

    /// Number of degenerate triangles.
    pub fn degenerate(&self) -> usize {
        self.degenerate
    }

    /// The three edges `(i, j, half cotangent)` of each triangle.
    pub fn edges(&self) -> impl Iterator<Item = [(u32, u32, f64); 3]> + '_ {
        self.triangles.iter().zip(&self.half).map(|(v, h)| [(v[1], v[2], h[0]), (v[2], v[0], h[1]), (v[0], v[1], h[2])])
    }
}

/// Squared lengths of the edges opposite each corner.
fn squared_edges([a, b, c]: &[Point3<f64>; 3]) -> [f64; 3] {
    let squared = |p: &Point3<f64>, q: &Point3<f64>| -> f64 { (p - q).norm_squared() };
    [squared(b, c), squared(c, a), squared(a, b)]
}

/// Twice the area of a triangle with the given squared edge lengths (Heron's formula in Kahan's stable order); 0 where they
/// violate the triangle inequality.
fn doubled_area(squared: &[f64; 3]) -> f64 {
    let mut e = squared.map(f64::sqrt);
    e.sort_unstable_by(|a, b| b.total_cmp(a));
    let [a, b, c] = e;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    0.5 * product.max(0.0).sqrt()
}

/// `½ cot αₖ = (b² + c² − a²) / (4 · 2A)` with `a` opposite corner `k`.
fn half_cotangents(&[a, b, c]: &[f64; 3], doubled_area: f64) -> [f64; 3] {
    let quarter = 0.25 / doubled_area;
    [(b + c - a) * quarter, (c + a - b) * quarter, (a + b - c) * quarter]
}

/// Unit normal of a triangle; zero where it is degenerate by [`DEGENERATE`].
pub(super) fn unit_normal(corners: &[Point3<f64>; 3], area_normal: &Vector3<f64>) -> Vector3<f64> {
    let longest = squared_edges(corners).into_iter().fold(0.0, f64::max);
    let length = area_normal.norm();
    if length > DEGENERATE * longest { area_normal / length } else { Vector3::zeros() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f64; 3]; 3]) -> TriMesh {
        TriMesh::new(corners.map(Point3::from).to_vec(), vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn half_cotangents_are_those_of_the_angles() {
        let mesh = triangle([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [1.0, 2.0, 1.0]]);
        let angle = |k: usize| {
            let p = mesh.positions();
            (p[(k + 1) % 3] - p[k]).angle(&(p[(k + 2) % 3] - p[k]))
        };
        let cotangents = Cotangents::new(&mesh, CotangentRule::Raw);
        for k in 0..3 {
            assert!((cotangents.half()[0][k] - 0.5 / angle(k).tan()).abs() < 1e-14);
        }
    }

    #[test]
    fn an_obtuse_angle_is_negative_raw_and_zero_clamped() {
        let mesh = triangle([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0]]);
        assert!((Cotangents::new(&mesh, CotangentRule::Raw).half()[0][0] + 0.5).abs() < 1e-15);
        let clamped = Cotangents::new(&mesh, CotangentRule::Clamped);
        assert_eq!(clamped.half()[0][0], 0.0);
        assert!(clamped.half()[0][1] > 0.0);
    }

    #[test]
    fn degenerate_triangles_are_counted_and_weighted_as_equilateral() {
        for corners in
            [[[0.0; 3]; 3], [[0.0; 3], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]], [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0]]]
        {
            for rule in [CotangentRule::Raw, CotangentRule::Clamped, CotangentRule::IntrinsicDelaunay] {
                let cotangents = Cotangents::new(&triangle(corners), rule);
                assert_eq!((cotangents.degenerate(), cotangents.half()[0]), (1, [EQUILATERAL; 3]));
            }
        }
        assert!((EQUILATERAL - 0.5 / (std::f64::consts::PI / 3.0).tan()).abs() < 1e-16);
    }
}
