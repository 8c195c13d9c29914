//! Relaxation of a map over the sphere by its own distortion.
//!
//! Both embeddings are bijective, but where one crowds what the other spreads, triangles of the first surface are slivers on the second and
//! cut across it. Vertices of the first therefore move on the sphere, without inversions there, to reduce
//!
//! ```text
//! E = Σ_t A_t (|J_t|² + det² J_t + 1) / χ(det J_t),        χ(d) = (d + √(ε² + d²)) / 2,
//! ```
//!
//! with the Jacobian `J` of the map of a triangle of the first surface, of area `A`, to the triangle of its corners on the second, scaled
//! so that the total areas are equal. `det J` is negative where the mapped triangle opposes the normals of the second surface at its
//! corners; `χ` is positive there too, so that the energy is finite and lowers the number of such triangles.
//!
//! # Reference
//! J. Schreiner, A. Asirvatham, E. Praun, H. Hoppe, *Inter-surface mapping*, SIGGRAPH 2004; V. Garanzha, I. Kaporin, L. Kudryavtseva,
//! F. Protais, N. Ray, D. Sokolov, *Foldover-free maps in 50 lines of code*, SIGGRAPH 2021, for `χ`.

use nalgebra::{Matrix2, Matrix3x2, Point3, Vector2, Vector3};

use super::SphereEmbedding;
use crate::mesh::{HalfEdges, MeshError, TriMesh};
use crate::morph::bvh::SurfacePoint;
use plumbline_num::run::{Run, Stopped};

/// `ε`: a collapsed triangle costs about ten times as much as one that keeps its shape. Smaller values make steps of vertices near
/// collapsed triangles short; larger ones allow more collapsed triangles.
const EPSILON: f64 = 0.1;
/// Minimum area of a triangle in its squared edges, so that slivers of the first surface are no barriers.
const MIN_AREA: f64 = 1e-3;
/// Maximum sweeps, while each decreases the energy by the fraction [`MIN_DECREASE`].
const MAX_SWEEPS: usize = 200;
const MIN_DECREASE: f64 = 1e-3;
/// Minimum fraction of a step in the line search.
const MIN_STEP: f64 = 1.0 / 64.0;
/// Step of the finite differences of the gradient, in lengths of the shortest edge around.
const DIFFERENCE_STEP: f64 = 1e-4;
/// Maximum triangles that a step crosses.
const MAX_CROSSED: usize = 300;

/// The second surface and its embedding.
pub(super) struct Ground<'m> {
    mesh: &'m TriMesh,
    at: &'m [Vector3<f64>],
    edges: HalfEdges,
    normals: Vec<Vector3<f64>>,
}

/// A point of the second surface, and the surface's normal there.
#[derive(Clone, Copy)]
struct Foot {
    triangle: u32,
    weights: [f64; 3],
    point: Vector3<f64>,
    normal: Vector3<f64>,
}

impl<'m> Ground<'m> {
    /// A closed surface and its embedding.
    pub(super) fn new(mesh: &'m TriMesh, at: &'m [Vector3<f64>]) -> Result<Self, MeshError> {
        Ok(Self { mesh, at, edges: HalfEdges::new(mesh)?, normals: mesh.vertex_normals() })
    }

    fn foot(&self, triangle: u32, weights: [f64; 3]) -> Foot {
        let corners = self.mesh.triangles()[triangle as usize].iter().zip(weights);
        let zero = (Vector3::zeros(), Vector3::zeros());
        let (point, normal) = corners.fold(zero, |(point, normal), (&v, w)| {
            (point + self.mesh.positions()[v as usize].coords * w, normal + self.normals[v as usize] * w)
        });
        Foot { triangle, weights, point, normal }
    }

    /// The point at a direction, found by a walk from a triangle nearby.
    fn find(&self, from: u32, x: &Vector3<f64>) -> Option<Foot> {
        let mut triangle = from;
        for _ in 0..MAX_CROSSED {
            let [a, b, c] = self.mesh.triangles()[triangle as usize].map(|v| self.at[v as usize]);
            let weights = [x.dot(&b.cross(&c)), x.dot(&c.cross(&a)), x.dot(&a.cross(&b))];
            let lowest = (0..3).min_by(|i, j| weights[*i].total_cmp(&weights[*j])).unwrap_or(0);
            if weights[lowest] >= 0.0 {
                let sum: f64 = weights.iter().sum();
                return (sum > 0.0).then(|| self.foot(triangle, weights.map(|w| w / sum)));
            }
            let opposite = HalfEdges::next(3 * triangle + lowest as u32);
            triangle = HalfEdges::triangle(self.edges.twin(opposite)?);
        }
        None
    }

    /// The direction at a displacement from a point, in the plane of its triangle.
    fn moved(&self, foot: &Foot, plane: &Matrix3x2<f64>, step: &Vector2<f64>) -> Option<Vector3<f64>> {
        let v = self.mesh.triangles()[foot.triangle as usize];
        let [a, b, c] = v.map(|v| self.mesh.positions()[v as usize]);
        let edges = plane.transpose() * Matrix3x2::from_columns(&[b - a, c - a]);
        let along = edges.try_inverse()? * step;
        let [u, v, w] = foot.weights;
        let weights = [u - along[0] - along[1], v + along[0], w + along[1]];
        let corners = self.mesh.triangles()[foot.triangle as usize].iter().zip(weights);
        corners.map(|(v, w)| self.at[*v as usize] * w).sum::<Vector3<f64>>().try_normalize(1e-12)
    }

    /// An orthonormal basis of the plane of a triangle.
    fn plane(&self, triangle: u32) -> Option<Matrix3x2<f64>> {
        let [a, b, c] = self.mesh.corners(triangle as usize);
        let first = (b - a).try_normalize(0.0)?;
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0)?;
        Some(Matrix3x2::from_columns(&[first, normal.cross(&first)]))
    }
}

/// A triangle of the first surface at a vertex.
struct Side {
    /// The two other corners on the second surface, and their normals.
    feet: [Foot; 2],
    /// `|J|² = Σ weights |edge|²` by the corners opposite; area.
    weights: [f64; 3],
    area: f64,
}

impl Side {
    /// A triangle with these corners, the vertex first; areas of the second surface are `scale` times as large.
    fn new(feet: [Foot; 2], [v, p, q]: [Point3<f64>; 3], scale: f64) -> Self {
        let [a, b, c] = [(q - p).norm_squared(), (v - q).norm_squared(), (p - v).norm_squared()];
        let area = (0.5 * (p - v).cross(&(q - v)).norm()).max(MIN_AREA * (a + b + c));
        let weights = [b + c - a, c + a - b, a + b - c].map(|w| w / (8.0 * area * area * scale));
        Self { feet, weights, area }
    }

    /// The energy and its gradient in the vertex.
    fn energy(&self, x: &Vector3<f64>, normal: &Vector3<f64>, scale: f64) -> (f64, Vector3<f64>) {
        let [p, q] = self.feet.map(|f| f.point);
        let (to_p, to_q) = (p - x, q - x);
        let up = (normal + self.feet[0].normal + self.feet[1].normal).try_normalize(0.0).unwrap_or_default();
        let [a, b, c] = self.weights;
        let squares = a * (q - p).norm_squared() + b * to_q.norm_squared() + c * to_p.norm_squared();
        let det = 0.5 * to_p.cross(&to_q).dot(&up) / (self.area * scale);
        let root = det.hypot(EPSILON);
        let chi = 0.5 * (det + root);
        let chi = if chi > 0.0 { chi } else { f64::MIN_POSITIVE };
        let value = (squares + det * det + 1.0) / chi;
        let of_squares = (to_q * b + to_p * c) * -2.0;
        let of_det = up.cross(&(q - p)) * (0.5 / (self.area * scale));
        let slope_of_chi = chi / root;
        let gradient = (of_squares + of_det * (2.0 * det - value * slope_of_chi)) / chi;
        (self.area * value, gradient * self.area)
    }
}

/// Relaxes the vertices of `embedding` that are not fixed; `points` are theirs on the second surface.
pub(super) fn relax(
    embedding: &mut SphereEmbedding<'_>,
    ground: &Ground<'_>,
    points: &mut [SurfacePoint],
    fixed: &[bool],
    run: &Run,
) -> Result<(), Stopped> {
    let scale = ground.mesh.area() / embedding.mesh.area();
    let mut feet: Vec<Foot> = points.iter().map(|p| ground.foot(p.triangle, p.weights)).collect();
    let mut last = f64::INFINITY;
    for _ in 0..MAX_SWEEPS {
        let mut energy = 0.0;
        for v in (0..feet.len()).filter(|v| !fixed[*v]) {
            run.check()?;
            energy += relax_vertex(embedding, ground, &mut feet, v, scale);
        }
        if !(energy < (1.0 - MIN_DECREASE) * last) {
            break;
        }
        last = energy;
    }
    for (point, foot) in points.iter_mut().zip(&feet) {
        *point = SurfacePoint::on(ground.mesh, foot.triangle, foot.weights);
    }
    Ok(())
}

/// A descent step of a vertex; returns the previous energy around it.
fn relax_vertex(
    embedding: &mut SphereEmbedding<'_>,
    ground: &Ground<'_>,
    feet: &mut [Foot],
    v: usize,
    scale: f64,
) -> f64 {
    let ring = &embedding.rings[v];
    let rest = |v: u32| embedding.mesh.positions()[v as usize];
    let side = |k: usize| {
        let (p, q) = (ring[k], ring[(k + 1) % ring.len()]);
        Side::new([feet[p as usize], feet[q as usize]], [rest(v as u32), rest(p), rest(q)], scale)
    };
    let sides: Vec<Side> = (0..ring.len()).map(side).collect();
    let energy = |x: &Vector3<f64>, normal: &Vector3<f64>| {
        sides.iter().fold((0.0, Vector3::zeros()), |(sum, slope), side| {
            let (energy, gradient) = side.energy(x, normal, scale);
            (sum + energy, slope + gradient)
        })
    };
    let foot = feet[v];
    let before = energy(&foot.point, &foot.normal).0;
    let lengths = ring.iter().map(|w| (feet[*w as usize].point - foot.point).norm());
    let (shortest, longest) = lengths.fold((f64::INFINITY, 0.0_f64), |(a, b), l| (a.min(l), b.max(l)));
    let Some(plane) = ground.plane(foot.triangle) else { return before };
    let slope = |d: Vector2<f64>| plane.transpose() * energy(&(foot.point + plane * d), &foot.normal).1;
    let difference = shortest.max(1e-6 * longest) * DIFFERENCE_STEP;
    let here = slope(Vector2::zeros());
    let [first, second] = [Vector2::x(), Vector2::y()].map(|d| (slope(d * difference) - here) / difference);
    let curvature = Matrix2::from_columns(&[first, second]);
    let newton = (0.5 * (curvature + curvature.transpose())).cholesky().map(|c| -c.solve(&here));
    let step = newton.unwrap_or_else(|| -here * (longest / here.norm().max(f64::MIN_POSITIVE)));
    let length = step.norm();
    if !(length > 0.0) || !length.is_finite() {
        return before;
    }
    let step = step * (longest / length).min(1.0);
    let mut fraction = 1.0;
    while fraction >= MIN_STEP {
        if let Some(x) = ground.moved(&foot, &plane, &(step * fraction))
            && let Some(there) = ground.find(foot.triangle, &x)
            && energy(&there.point, &there.normal).0 < before
            && embedding.is_valid(v as u32, &x)
        {
            embedding.at[v] = x;
            feet[v] = there;
            return before;
        }
        fraction *= 0.5;
    }
    before
}
