//! Relaxation of a map by its distortion.
//!
//! Vertices of the first surface walk on the second and reduce the distortion of the map and of its inverse together:
//!
//! ```text
//! E = Σ_t A_t [ T_t (χ(1)/χ(det J_t))^p + T_t − 4 det J_t ],        T = |J|² + det² J + 1,
//! χ(d) = (d + √(ε² + d²)) / 2,        p = √(1 + ε²),
//! ```
//!
//! with the Jacobian `J` of the map of a triangle of area `A` to the triangle of its corners on the second surface, scaled so that the
//! total areas are equal. For `ε → 0` the distortion `T / det J`, 4 for an isometry, is the same for the inverse of `J`; the first summand
//! integrates it over the first surface, `T` over the second. What `4 det J` takes from that is constant for a map onto the second
//! surface; without it a map would gain by chords that cut corners. `det J` is negative where the mapped triangle opposes the normals of
//! the second surface at its corners: a fold. `χ` is positive there too; the smaller `ε`, the more a fold costs. `ε` decreases from 1, where
//! folds cost little and the map becomes even, to a value that leaves hardly any; by the power `p` an isometry is stationary for each.
//!
//! Vertices take Newton steps one by one. Only those are visited again that moved, or whose neighbors did. At the end folds are recognized
//! by the normals of the triangles around each, too: a chord across a concave part may agree with the surface at its corners and still turn
//! against its neighbors, which is what one sees of a fold. Vertices of such folds go on, a few times, with the normals that the mesh had at the
//! last time. The surface keeps its say, or parts turn over together with their neighbors.
//!
//! # Reference
//! V. Garanzha, I. Kaporin, L. Kudryavtseva, F. Protais, N. Ray, D. Sokolov, *Foldover-free maps in 50 lines of code*, SIGGRAPH 2021;
//! J. Schreiner, A. Asirvatham, E. Praun, H. Hoppe, *Inter-surface mapping*, SIGGRAPH 2004, for the energy of both directions.

use nalgebra::{Matrix2, Matrix3x2, Point3, SymmetricEigen, Vector2, Vector3};

use super::super::MorphError;
use super::super::bvh::SurfacePoint;
use super::super::folds::normals_around;
use super::walk::{Foot, Ground};
use crate::mesh::{TriMesh, neighbors_of_vertices};
use plumbline_num::math::Lists;
use plumbline_num::run::{Run, Stopped};

/// `ε`, one after the other. A map that starts at 0.1 stays uneven (`docs/ABLATIONS.md`, "Maps between unlike meshes").
const EPSILONS: [f64; 5] = [1.0, 0.3, 0.09, 0.03, 0.01];
/// Minimum area of a triangle in its squared edges, so that slivers of the first surface are no barriers.
const MIN_AREA: f64 = 1e-3;
/// Minimum relative decrease of the energy around a vertex; below it the vertex rests until a neighbor moves.
const MIN_DECREASE: f64 = 1e-3;
/// Maximum visits in one descent, on average of all vertices: a bound on time where the energy keeps falling.
const MAX_VISITS: usize = 1000;
/// Maximum descents around folds of the mapped mesh.
const MAX_UNFOLDINGS: usize = 20;
/// Weight of the normal of the triangles around one, beside that of the surface. With 1 and 1.5 fewer pairs of models pass, without the
/// surface's up to 10 % of the triangles oppose it (`docs/ABLATIONS.md`).
const AROUND: f64 = 2.0;
/// Shortening of a step in the line search, and its minimum fraction.
const SHORTER: f64 = 0.4;
const MIN_STEP: f64 = 0.01;
/// Minimum curvature of the energy in a Newton step, relative to that across.
const MIN_CURVATURE: f64 = 1e-9;

/// A triangle of the first surface.
#[derive(Clone, Copy)]
struct Element {
    /// `|J|² = Σ weights |edge|²` by the corners opposite.
    weights: [f64; 3],
    /// `det J` of a mapped triangle, over twice its area.
    density: f64,
    area: f64,
}

/// The energy of an element as a function of `a = |J|²` and `d = det J`, and its derivatives.
struct Distortion {
    value: f64,
    by_a: f64,
    by_d: f64,
    by_ad: f64,
    by_dd: f64,
}

impl Distortion {
    fn new(a: f64, d: f64, epsilon: f64) -> Self {
        let total = a + d * d + 1.0;
        let root = d.hypot(epsilon);
        // χ(1)/χ(d), without cancellation; its power and that one's derivatives.
        let chi = if d > 0.0 { 0.5 * (d + root) } else { 0.5 * epsilon * epsilon / (root - d) };
        let power = 1.0_f64.hypot(epsilon);
        let barrier = (0.5 * (1.0 + power) / chi).powf(power);
        let slope = -power * barrier / root;
        let curvature = power * barrier * (power + d / root) / (root * root);
        Self {
            value: total * (barrier + 1.0) - 4.0 * d,
            by_a: barrier + 1.0,
            by_d: 2.0 * d * (barrier + 1.0) + total * slope - 4.0,
            by_ad: slope,
            by_dd: 2.0 * (barrier + 1.0) + 4.0 * d * slope + total * curvature,
        }
    }
}

impl Element {
    /// A triangle; areas of the second surface are `scale` times as large.
    fn new([v, p, q]: [Point3<f64>; 3], scale: f64) -> Self {
        let [a, b, c] = [(q - p).norm_squared(), (v - q).norm_squared(), (p - v).norm_squared()];
        let area = (0.5 * (p - v).cross(&(q - v)).norm()).max(MIN_AREA * (a + b + c));
        if !(area > 0.0) {
            return Self { weights: [0.0; 3], density: 0.0, area: 0.0 };
        }
        let weights = [b + c - a, c + a - b, a + b - c].map(|w| w / (8.0 * area * area * scale));
        Self { weights, density: 0.5 / (area * scale), area }
    }

    /// `|J|²`, `det J`, and the mean normal at the corners.
    fn jacobian(&self, feet: &[Foot; 3]) -> (f64, f64, Vector3<f64>) {
        let [x, y, z] = feet.map(|f| f.point);
        let up = feet.iter().map(|f| f.normal).sum::<Vector3<f64>>().try_normalize(0.0).unwrap_or_default();
        let [a, b, c] = self.weights;
        let squares = a * (z - y).norm_squared() + b * (x - z).norm_squared() + c * (y - x).norm_squared();
        (squares, self.density * (y - x).cross(&(z - x)).dot(&up), up)
    }

    fn energy(&self, feet: &[Foot; 3], epsilon: f64) -> f64 {
        let (a, d, _) = self.jacobian(feet);
        self.area * Distortion::new(a, d, epsilon).value
    }

    /// The gradient and the Hessian of the energy in a displacement of corner `k` in a plane.
    fn derivatives(
        &self,
        feet: &[Foot; 3],
        k: usize,
        plane: &Matrix3x2<f64>,
        epsilon: f64,
    ) -> (Vector2<f64>, Matrix2<f64>) {
        let (a, d, up) = self.jacobian(feet);
        let at = Distortion::new(a, d, epsilon);
        let [n, p] = [1, 2].map(|next| (k + next) % 3);
        let [x, y, z] = [k, n, p].map(|i| feet[i].point);
        let [to_z, to_y] = [n, p].map(|i| 2.0 * self.weights[i]);
        let of_a = plane.transpose() * ((x - z) * to_z + (x - y) * to_y);
        let of_d = plane.transpose() * (up.cross(&(z - y)) * self.density);
        let mixed = of_a * of_d.transpose();
        let hessian = Matrix2::identity() * ((to_y + to_z) * at.by_a)
            + (mixed + mixed.transpose()) * at.by_ad
            + of_d * of_d.transpose() * at.by_dd;
        ((of_a * at.by_a + of_d * at.by_d) * self.area, hessian * self.area)
    }
}

/// Relaxes the vertices of `first` that are not fixed; `points` are theirs on the second surface.
pub(super) fn relax(
    first: &TriMesh,
    ground: &Ground<'_>,
    points: &mut [SurfacePoint],
    fixed: &[bool],
    run: &Run,
) -> Result<(), MorphError> {
    let scale = ground.area() / first.area();
    if !(scale > 0.0 && scale.is_finite()) {
        return Ok(());
    }
    let mut map = Map {
        triangles: first.triangles(),
        elements: (0..first.triangle_count()).map(|t| Element::new(first.corners(t), scale)).collect(),
        around: first.triangles_of_vertices(),
        neighbors: neighbors_of_vertices(first.vertex_count(), first.triangles()),
        feet: points.iter().map(|p| ground.foot(p)).collect(),
        around_each: None,
        ground,
    };
    let free: Vec<bool> = fixed.iter().map(|f| !f).collect();
    for epsilon in EPSILONS {
        map.descend(&free, free.clone(), epsilon, run)?;
    }
    for _ in 0..MAX_UNFOLDINGS {
        let mapped: Vec<Point3<f64>> = map.feet.iter().map(|f| Point3::from(f.point)).collect();
        map.around_each = Some(normals_around(first.triangles(), &mapped));
        let folded = map.corners_of_folds(&free);
        if !folded.contains(&true) {
            break;
        }
        map.descend(&free, folded, EPSILONS[EPSILONS.len() - 1], run)?;
    }
    for (point, foot) in points.iter_mut().zip(&map.feet) {
        *point = foot.surface_point(ground);
    }
    Ok(())
}

/// The map during relaxation.
struct Map<'m> {
    triangles: &'m [[u32; 3]],
    elements: Vec<Element>,
    /// Triangles of each vertex.
    around: Lists<u32>,
    /// Vertices joined to each one by an edge.
    neighbors: Vec<Vec<u32>>,
    feet: Vec<Foot>,
    /// Unit normals of the mapped triangles around each one.
    around_each: Option<Vec<Vector3<f64>>>,
    ground: &'m Ground<'m>,
}

impl Map<'_> {
    /// Moves vertices one by one, the active ones first, until none decreases its energy by more than the minimum.
    fn descend(&mut self, free: &[bool], mut active: Vec<bool>, epsilon: f64, run: &Run) -> Result<(), Stopped> {
        let mut visits = MAX_VISITS * active.len();
        while visits > 0 && active.contains(&true) {
            for v in 0..active.len() {
                if !std::mem::take(&mut active[v]) {
                    continue;
                }
                run.check()?;
                visits = visits.saturating_sub(1);
                if self.relax_vertex(v, epsilon) {
                    active[v] = true;
                    for &w in &self.neighbors[v] {
                        active[w as usize] = free[w as usize];
                    }
                }
            }
        }
        Ok(())
    }

    /// The free vertices of folded triangles.
    fn corners_of_folds(&self, free: &[bool]) -> Vec<bool> {
        let mut folded = vec![false; free.len()];
        for (t, element) in (0..).zip(&self.elements) {
            if element.area > 0.0 && !(element.jacobian(&self.corners(t)).1 > 0.0) {
                for v in self.triangles[t as usize] {
                    folded[v as usize] = free[v as usize];
                }
            }
        }
        folded
    }

    fn corners(&self, t: u32) -> [Foot; 3] {
        let mut feet = self.triangles[t as usize].map(|v| self.feet[v as usize]);
        if let Some(around) = &self.around_each {
            let surface = feet.iter().map(|f| f.normal).sum::<Vector3<f64>>().try_normalize(0.0).unwrap_or_default();
            let normal = surface + around[t as usize] * AROUND;
            for foot in &mut feet {
                foot.normal = normal;
            }
        }
        feet
    }

    /// The energy of the triangles around a vertex.
    fn energy(&self, v: usize, epsilon: f64) -> f64 {
        self.around.of(v).iter().map(|&t| self.elements[t as usize].energy(&self.corners(t), epsilon)).sum()
    }

    /// The Newton step of a vertex, up to the length of its longest edge; curvatures count by their size, so that it descends.
    fn step(&self, v: usize, epsilon: f64) -> Option<Vector3<f64>> {
        let plane = self.ground.plane(&self.feet[v])?;
        let (mut gradient, mut hessian, mut longest) = (Vector2::zeros(), Matrix2::zeros(), 0.0_f64);
        for &t in self.around.of(v) {
            let (corners, ids) = (self.corners(t), self.triangles[t as usize]);
            for k in (0..3).filter(|&k| ids[k] as usize == v) {
                let (slope, curvature) = self.elements[t as usize].derivatives(&corners, k, &plane, epsilon);
                gradient += slope;
                hessian += curvature;
            }
            longest = corners.iter().map(|c| (c.point - self.feet[v].point).norm()).fold(longest, f64::max);
        }
        // Coordinates near the limits of numbers overflow.
        if !hessian.iter().all(|h| h.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::new(hessian);
        let least = MIN_CURVATURE * eigen.eigenvalues.amax();
        let across = eigen.eigenvectors.transpose() * gradient;
        let step = eigen.eigenvectors * -across.component_div(&eigen.eigenvalues.map(|c| c.abs().max(least)));
        let length = step.norm();
        (length > 0.0 && length.is_finite()).then(|| plane * step * (longest / length).min(1.0))
    }

    /// Moves a vertex; whether the energy decreased by more than the minimum.
    fn relax_vertex(&mut self, v: usize, epsilon: f64) -> bool {
        let Some(step) = self.step(v, epsilon) else { return false };
        let (before, from) = (self.energy(v, epsilon), self.feet[v]);
        let mut fraction = 1.0;
        while fraction >= MIN_STEP {
            self.feet[v] = self.ground.walk(&from, &(step * fraction));
            let after = self.energy(v, epsilon);
            if after < before {
                return after < (1.0 - MIN_DECREASE) * before;
            }
            fraction *= SHORTER;
        }
        self.feet[v] = from;
        false
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::bvh::CORNERS;
    use super::*;
    use crate::mesh::shapes;

    /// The feet of a flat triangle.
    fn flat(corners: [[f64; 2]; 3]) -> [Foot; 3] {
        let points = corners.map(|[x, y]| Point3::new(x, y, 0.0));
        let mesh = TriMesh::new(points.to_vec(), vec![[0, 1, 2]]).unwrap();
        let ground = Ground::new(&mesh);
        [0, 1, 2].map(|k| {
            let mut foot = ground.foot(&SurfacePoint::on(&mesh, 0, CORNERS[k]));
            foot.normal = Vector3::z();
            foot
        })
    }

    #[test]
    fn the_energy_is_that_of_the_map_and_its_inverse() {
        // Rest and image with singular values 2 and 0.5 of the map, and of its inverse.
        let rest = [[0.0, 0.0], [1.0, 0.0], [0.3, 1.1]];
        let image = rest.map(|[x, y]| [2.0 * x, 0.5 * y]);
        let element = |p: [[f64; 2]; 3]| Element::new(p.map(|[x, y]| Point3::new(x, y, 0.0)), 1.0);
        let (there, back) = (element(rest).energy(&flat(image), 1e-9), element(image).energy(&flat(rest), 1e-9));
        assert!((there / back - 1.0).abs() < 1e-9);
        // 2 (4 + ¼ + 1 + 1) − 4 per area.
        assert!((there / (0.55 * 8.5) - 1.0).abs() < 1e-9, "{there}");
        for epsilon in EPSILONS {
            let at = Distortion::new(2.0, 1.0, epsilon);
            // Of a change of size, by which `|J|²` changes as `2 det J`.
            assert!((at.value - 4.0).abs() < 1e-12 && (2.0 * at.by_a + at.by_d).abs() < 1e-12);
        }
    }

    #[test]
    fn the_derivatives_are_those_of_the_energy_also_in_a_fold() {
        let plane = Matrix3x2::from_columns(&[Vector3::x(), Vector3::y()]);
        let element = Element::new([[0.0, 0.0], [1.0, 0.1], [0.2, 0.9]].map(|[x, y]| Point3::new(x, y, 0.0)), 1.3);
        for image in [[[0.1, 0.0], [1.2, 0.3], [0.1, 0.7]], [[0.1, 0.0], [1.2, 0.3], [0.4, -0.5]]] {
            for k in 0..3 {
                let moved = |step: [f64; 2]| {
                    let mut image = image;
                    (0..2).for_each(|c| image[k][c] += step[c]);
                    flat(image)
                };
                let (gradient, hessian) = element.derivatives(&moved([0.0; 2]), k, &plane, 0.3);
                for c in 0..2 {
                    let step = |h: f64| moved(if c == 0 { [h, 0.0] } else { [0.0, h] });
                    let slope = (element.energy(&step(1e-6), 0.3) - element.energy(&step(-1e-6), 0.3)) / 2e-6;
                    assert!((slope / gradient[c] - 1.0).abs() < 1e-5, "{slope} {}", gradient[c]);
                    let slopes = [1e-6, -1e-6].map(|h| element.derivatives(&step(h), k, &plane, 0.3).0);
                    let curvature = (slopes[0] - slopes[1]) / 2e-6;
                    assert!((curvature - hessian.column(c)).norm() < 1e-5 * hessian.norm());
                }
            }
        }
    }

    #[test]
    fn a_patch_that_is_turned_over_unfolds_and_fixed_vertices_stay() {
        let ball = shapes::icosphere(4);
        let target = super::super::registration::Target::new(&ball, "second", 0).unwrap();
        let point = |p: &Point3<f64>| {
            let turned = p.z > 0.0 && p.x.hypot(p.y) < 0.5;
            target.closest_facing(&if turned { Point3::new(-p.x, p.y, p.z) } else { *p }, &p.coords).unwrap()
        };
        let mut points: Vec<SurfacePoint> = ball.positions().iter().map(point).collect();
        let fixed: Vec<bool> = ball.positions().iter().map(|p| p.z < 0.3).collect();
        let folds = |points: &[SurfacePoint]| {
            let volume = |t: &&[u32; 3]| {
                let [a, b, c] = t.map(|v| points[v as usize].point.coords);
                a.dot(&b.cross(&c))
            };
            ball.triangles().iter().filter(|t| !(volume(t) > 0.0)).count()
        };
        assert!(folds(&points) > 100);
        relax(&ball, &Ground::new(&ball), &mut points, &fixed, &Run::default()).unwrap();
        assert_eq!(folds(&points), 0);
        let off: Vec<f64> = points.iter().zip(ball.positions()).map(|(q, p)| (q.point - p).norm()).collect();
        assert!(off.iter().zip(&fixed).all(|(off, fixed)| !fixed || *off < 1e-12));
        // Within the length of an edge of the identity: descents end where steps gain little.
        assert!(off.iter().all(|off| *off < 0.08), "{off:?}");
    }
}
