//! Pose of a calibrated camera from three points (P3P).
//!
//! With unit rays `yᵢ`, points `xᵢ` and depths `Λ = (λ₁, λ₂, λ₃)` along the rays, the distances of the points give
//!
//! ```text
//! λᵢ² + λⱼ² − 2 λᵢ λⱼ yᵢ·yⱼ = aᵢⱼ = ‖xᵢ − xⱼ‖²,      as forms   Λᵀ Mᵢⱼ Λ = aᵢⱼ.
//! ```
//!
//! `D₁ = a₂₃ M₁₂ − a₁₂ M₂₃` and `D₂ = a₂₃ M₁₃ − a₁₃ M₂₃` vanish at Λ. For a root `γ` of the cubic `det(D₁ + γ D₂) = 0`
//! the form `D₁ + γ D₂` degenerates to a pair of planes; on each plane the remaining form is a quadratic in the ratio
//! of two depths, and `a` gives the scale. The depths are refined by Newton's method on the three equations.
//!
//! # Reference
//! M. Persson, K. Nordberg, *Lambda Twist: An accurate fast robust perspective three point solver*, ECCV 2018.

use nalgebra::{Matrix2, Matrix3, Rotation3, SymmetricEigen, UnitQuaternion, Vector2, Vector3};

use super::polynomial::real_roots;
use plumbline_camera::{CameraPose, Point3, Vec3};
use plumbline_num::math::Vec2;

/// Newton steps on the depths: they start with at least four correct digits, and each step doubles them.
const POLISH_STEPS: usize = 5;

/// Relative distance of the points from a common line, or of two rays from each other, below which the sample is
/// degenerate.
const DEGENERATE: f64 = 1e-9;

/// Maximum residual of the squared distances, relative to the largest, of an accepted solution.
const ACCEPTED: f64 = 1e-10;

/// A 2D–3D correspondence of a calibrated camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointRay {
    /// In the world.
    pub point: Point3,
    /// Normalized image coordinates.
    pub ray: Vec2,
}

/// All poses `cam_from_world` with the three points in front, pushed to `poses`: at most four, none for collinear
/// points.
pub fn three_point(sample: &[PointRay; 3], poses: &mut Vec<CameraPose>) {
    let x = sample.map(|s| s.point.coords);
    let y = sample.map(|s| s.ray.push(1.0).normalize());
    let sides = Vec3::new((x[0] - x[1]).norm_squared(), (x[0] - x[2]).norm_squared(), (x[1] - x[2]).norm_squared());
    let largest = sides.max();
    let area = (x[1] - x[0]).cross(&(x[2] - x[0])).norm();
    if !(area > DEGENERATE * largest) {
        return;
    }
    let triangle =
        Triangle { sides: sides / largest, cosines: Vec3::new(y[0].dot(&y[1]), y[0].dot(&y[2]), y[1].dot(&y[2])) };
    let scale = largest.sqrt();
    let mut depths: Vec<Vec3> = Vec::with_capacity(4);
    triangle.push_depths(&mut depths);
    poses.extend(
        depths.iter().filter_map(|l| pose_of(&x, &[y[0] * l.x * scale, y[1] * l.y * scale, y[2] * l.z * scale])),
    );
}

/// Squared sides `a₁₂, a₁₃, a₂₃`, the largest 1, and cosines between the rays in the same order.
struct Triangle {
    sides: Vec3,
    cosines: Vec3,
}

/// The two rays of each side of the triangle.
const SIDES: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

impl Triangle {
    /// `Mᵢⱼ` of side `k`.
    fn form(&self, k: usize) -> Matrix3<f64> {
        let (i, j) = SIDES[k];
        let mut m = Matrix3::zeros();
        (m[(i, i)], m[(j, j)]) = (1.0, 1.0);
        (m[(i, j)], m[(j, i)]) = (-self.cosines[k], -self.cosines[k]);
        m
    }

    fn push_depths(&self, depths: &mut Vec<Vec3>) {
        let d1 = self.form(0) * self.sides[2] - self.form(2) * self.sides[0];
        let d2 = self.form(1) * self.sides[2] - self.form(2) * self.sides[1];
        let Some((gamma, planes)) = plane_pair(&d1, &d2) else { return };
        // On the planes D₁ = −γ D₂; this unit combination is orthogonal to D₁ + γ D₂ in its coefficients.
        let remaining = (d2 - d1 * gamma) / (1.0 + gamma * gamma).sqrt();
        for normal in planes {
            for ratio in on_plane(&normal, &remaining) {
                if let Some(l) = self.scaled(&ratio).and_then(|l| self.polished(l))
                    && !depths.iter().any(|other| (other - l).norm() < 1e-7 * l.norm())
                {
                    depths.push(l);
                }
            }
        }
    }

    /// Depths with these ratios that satisfy the sides; `None` unless all are positive.
    fn scaled(&self, ratio: &Vec3) -> Option<Vec3> {
        let ratio = if ratio.sum() < 0.0 { -ratio } else { *ratio };
        let squared: f64 = (0..3).map(|k| ratio.dot(&(self.form(k) * ratio))).sum();
        let l = ratio * (self.sides.sum() / squared).sqrt();
        (l.iter().all(|v| *v > 0.0 && v.is_finite())).then_some(l)
    }

    fn polished(&self, mut l: Vec3) -> Option<Vec3> {
        let mut residual = Vec3::zeros();
        for step in 0..=POLISH_STEPS {
            let forms = [self.form(0) * l, self.form(1) * l, self.form(2) * l];
            residual = Vec3::from_fn(|k, _| l.dot(&forms[k]) - self.sides[k]);
            if step == POLISH_STEPS || residual.amax() < 1e-16 {
                break;
            }
            let slope = Matrix3::from_rows(&[
                2.0 * forms[0].transpose(),
                2.0 * forms[1].transpose(),
                2.0 * forms[2].transpose(),
            ]);
            l -= slope.lu().solve(&residual)?;
        }
        (residual.amax() < ACCEPTED && l.iter().all(|v| *v > 0.0)).then_some(l)
    }
}

/// The root `γ` for which `D₁ + γ D₂` is most clearly a pair of real planes, and their normals.
fn plane_pair(d1: &Matrix3<f64>, d2: &Matrix3<f64>) -> Option<(f64, [Vec3; 2])> {
    let (c0, c3) = (d1.determinant(), d2.determinant());
    let (plus, minus) = ((d1 + d2).determinant(), (d1 - d2).determinant());
    let c2 = 0.5 * (plus + minus) - c0;
    let c1 = 0.5 * (plus - minus) - c3;
    let split = |&gamma: &f64| {
        let eigen = SymmetricEigen::new((d1 + d2 * gamma) / (1.0 + gamma.abs()));
        let (high, low) = (eigen.eigenvalues.imax(), eigen.eigenvalues.imin());
        let (s, t) = (eigen.eigenvalues[high], -eigen.eigenvalues[low]);
        let (e, f) = (eigen.eigenvectors.column(high).into_owned(), eigen.eigenvectors.column(low).into_owned());
        // s (e·Λ)² = t (f·Λ)²; real planes need both signs.
        (s > 0.0 && t > 0.0)
            .then(|| (s.min(t) / s.max(t), gamma, [e * s.sqrt() - f * t.sqrt(), e * s.sqrt() + f * t.sqrt()]))
    };
    let roots = real_roots(&[c0, c1, c2, c3]);
    let pairs = roots.as_slice().iter().filter_map(split);
    pairs.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, gamma, planes)| (gamma, planes))
}

/// Up to two directions Λ on the plane `n·Λ = 0` for which the form `d` vanishes.
fn on_plane(n: &Vec3, d: &Matrix3<f64>) -> impl Iterator<Item = Vec3> + use<> {
    // λ_k is determined by the two others; k is the largest component of n.
    let k = n.iamax();
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let vector = move |n: &Vec3, u: f64, v: f64| {
        let mut l = Vector3::zeros();
        (l[i], l[j], l[k]) = (u, v, -(n[i] * u + n[j] * v) / n[k]);
        l
    };
    let (a, b) = (vector(n, 1.0, 0.0), vector(n, 0.0, 1.0));
    let q = Matrix2::new(a.dot(&(d * a)), a.dot(&(d * b)), b.dot(&(d * a)), b.dot(&(d * b)));
    quadratic_directions(&q).into_iter().flatten().map(move |r| a * r.x + b * r.y)
}

/// Directions `(u, v)` with `q₀₀ u² + 2 q₀₁ u v + q₁₁ v² = 0`, without cancellation. A slightly negative discriminant
/// counts as zero, because the solution is refined afterwards.
fn quadratic_directions(q: &Matrix2<f64>) -> [Option<Vector2<f64>>; 2] {
    let (a, h, c) = (q[(0, 0)], q[(0, 1)], q[(1, 1)]);
    let discriminant = h * h - a * c;
    if !(discriminant > -1e-6 * (h * h + (a * c).abs())) {
        return [None, None];
    }
    let stable = h + discriminant.max(0.0).sqrt().copysign(h);
    [Some(Vector2::new(-stable, a)), Some(Vector2::new(-c, stable))]
}

/// The pose that maps three points to their positions in the camera; `None` if the two triangles are not finite.
fn pose_of(x: &[Vec3; 3], in_camera: &[Vec3; 3]) -> Option<CameraPose> {
    let frame = |p: &[Vec3; 3]| {
        let u = (p[1] - p[0]).try_normalize(0.0)?;
        let w = u.cross(&(p[2] - p[0])).try_normalize(0.0)?;
        Some(Matrix3::from_columns(&[u, w.cross(&u), w]))
    };
    let rotation = Rotation3::from_matrix_unchecked(frame(in_camera)? * frame(x)?.transpose());
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    let translation = (0..3).map(|k| in_camera[k] - rotation * x[k]).sum::<Vec3>() / 3.0;
    translation.iter().all(|v| v.is_finite()).then_some(CameraPose { rotation, translation })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::sfm::tests::synthetic_views::{TwoViews, random_pose, rotation_error};

    /// Three points of the first camera, seen by the second.
    fn sample(seed: u64) -> (CameraPose, [PointRay; 3]) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let views = TwoViews::general(random_pose(&mut rng, 1.0, 1.5), 3, &mut rng);
        let observation = |k: usize| PointRay { point: views.points[k], ray: views.correspondences[k].second.xy() };
        (views.second_from_first, std::array::from_fn(observation))
    }

    #[test]
    fn one_solution_is_the_truth_and_all_see_the_points() {
        for seed in 0..3000 {
            let (truth, three) = sample(seed);
            let mut poses = Vec::new();
            three_point(&three, &mut poses);
            assert!((1..=4).contains(&poses.len()), "seed {seed}: {} poses", poses.len());
            let best = poses.iter().map(|p| rotation_error(p, &truth)).fold(f64::INFINITY, f64::min);
            assert!(best < 1e-5, "seed {seed}: {best}");
            for (pose, s) in poses.iter().flat_map(|p| three.iter().map(move |s| (p, s))) {
                let seen = pose.apply(&s.point);
                assert!(seen.z > 0.0 && (seen.coords.xy() / seen.z - s.ray).norm() < 1e-8, "seed {seed}");
            }
        }
    }

    #[test]
    fn points_on_a_line_have_no_pose() {
        let at = |t: f64| PointRay { point: Point3::new(t, 0.5 * t, 5.0), ray: Vec2::new(t / 5.0, t / 10.0) };
        let mut poses = Vec::new();
        three_point(&[at(-1.0), at(0.2), at(1.0)], &mut poses);
        assert!(poses.is_empty());
    }
}
