//! The stretch energy of a spherical map, and its descent steps.
//!
//! ```text
//! E = Σ_t A_t (σ₁² + σ₂²) = Σ_t A_t Σ_k |b_k|² (|s_i|² + |s_j|² − |s_k|²) / (2 d_t²),        d_t = v · (p × q),
//! ```
//!
//! with the singular values `σ` of the map from the sphere to the surface, the area `A` and the edges `s` of a triangle on the surface,
//! and its edges `b` on the sphere. The energy is unbounded for crowded triangles and small for enlarged ones, so that limbs, which
//! conformal maps shrink to nothing, keep their area. Instead of twice the area on the sphere it uses the volume `d` spanned by the
//! corners and the center: nearly the same for small triangles, and 0 exactly at inversion, so that `E` prevents inversions.
//!
//! # Reference
//! P. Sander, J. Snyder, S. Gortler, H. Hoppe, *Texture mapping progressive meshes*, SIGGRAPH 2001, section 3; E. Praun, H. Hoppe, *Spherical
//! parametrization and remeshing*, SIGGRAPH 2003, section 3.2.

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// Area added to every triangle, as a fraction of its squared edges, so that slivers are not crowded either.
const MIN_AREA: f64 = 0.01;

/// A triangle at a vertex: the two other corners on the sphere, and `|s_i|² + |s_j|² − |s_k|²` of its edges opposite the vertex and those two.
pub(super) struct Side {
    pub(super) corners: [Vector3<f64>; 2],
    pub(super) weights: [f64; 3],
}

impl Side {
    /// A triangle with these corners on the surface, the vertex first.
    pub(super) fn new(corners: [Vector3<f64>; 2], [v, p, q]: [Vector3<f64>; 3]) -> Self {
        let [a, b, c] = [(q - p).norm_squared(), (v - q).norm_squared(), (p - v).norm_squared()];
        let area = 0.5 * (p - v).cross(&(q - v)).norm() + MIN_AREA * (a + b + c);
        Self { corners, weights: [b + c - a, c + a - b, a + b - c].map(|w| 0.5 * area * w) }
    }

    /// `E` and its gradient in the vertex; `None` for an inverted triangle.
    fn energy(&self, x: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
        let [p, q] = self.corners;
        let (to_p, to_q) = (p - x, q - x);
        let normal = p.cross(&q);
        let volume = normal.dot(x);
        if !(volume > 0.0) {
            return None;
        }
        let [a, b, c] = self.weights;
        let squares = (q - p).norm_squared() * a + to_q.norm_squared() * b + to_p.norm_squared() * c;
        let energy = squares / volume.powi(2);
        Some((energy, (to_q * b + to_p * c) * (-2.0 / volume.powi(2)) - normal * (2.0 * energy / volume)))
    }
}

/// The target of a vertex: adds `weight |x − position|²`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) position: Vector3<f64>,
    pub(super) weight: f64,
}

/// `E` of the triangles around a vertex at `x`, and its gradient.
pub(super) fn energy(sides: &[Side], target: Option<&Target>, x: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let penalty = target.map_or((0.0, Vector3::zeros()), |w| {
        let off = x - w.position;
        (w.weight * off.norm_squared(), off * (2.0 * w.weight))
    });
    sides.iter().try_fold(penalty, |(sum, slope), side| {
        let (energy, gradient) = side.energy(x)?;
        Some((sum + energy, slope + gradient))
    })
}

/// Step of the finite differences of the gradient, as a fraction of the smallest triangle height.
const DIFFERENCE_STEP: f64 = 1e-4;
/// Length of the gradient step where the Hessian is indefinite, in smallest triangle heights; shortened by the line search.
const GRADIENT_STEP: f64 = 100.0;

/// The Newton step of `E` in the tangent plane of `x`; a gradient step where the Hessian is indefinite.
pub(super) fn step(sides: &[Side], target: Option<&Target>, x: &Vector3<f64>) -> Option<Vector3<f64>> {
    let height = |s: &Side| {
        let [p, q] = s.corners.map(|c| c - x);
        x.dot(&p.cross(&q)).abs() / p.norm().max(q.norm()).max((p - q).norm())
    };
    let nearest = sides.iter().map(height).fold(f64::INFINITY, f64::min);
    let plane = tangents(x);
    let slope = |y: &Vector3<f64>| energy(sides, target, y).map(|e| plane.transpose() * e.1);
    let here = slope(x)?;
    let difference = nearest * DIFFERENCE_STEP;
    let [first, second] =
        [0, 1].map(|k| slope(&(x + plane.column(k) * difference)).map(|there| (there - here) / difference));
    let curvature = Matrix2::from_columns(&[first?, second?]);
    let curvature = 0.5 * (curvature + curvature.transpose());
    let newton = curvature.cholesky().map(|c| -c.solve(&here));
    let step: Vector2<f64> =
        newton.unwrap_or_else(|| -here * (GRADIENT_STEP * nearest / here.norm().max(f64::MIN_POSITIVE)));
    let step = plane * step;
    step.iter().all(|c| c.is_finite()).then_some(step)
}

/// An orthonormal basis of the tangent plane of a unit vector.
fn tangents(x: &Vector3<f64>) -> Matrix3x2<f64> {
    let mut along = Vector3::zeros();
    along[x.iamin()] = 1.0;
    let first = x.cross(&along).normalize();
    Matrix3x2::from_columns(&[first, x.cross(&first)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three triangles around a vertex near the pole, as large on the surface as factor `size` makes them.
    fn sides(size: f64) -> Vec<Side> {
        let at = |k: usize| {
            let angle = k as f64 * std::f64::consts::TAU / 3.0;
            Vector3::new(0.01 * angle.cos(), 0.01 * angle.sin(), 1.0).normalize()
        };
        let side = |k: usize| {
            let corners = [at(k), at(k + 1)];
            Side::new(corners, [Vector3::z() * size, corners[0] * size, corners[1] * size])
        };
        (0..3).map(side).collect()
    }

    #[test]
    fn what_is_laid_out_evenly_costs_its_area_times_the_squares_of_its_stretches() {
        for size in [1.0, 3.0] {
            let area: f64 = 3.0 * 0.5 * 0.01 * 0.01 * (std::f64::consts::TAU / 3.0).sin() * size * size;
            let edges: f64 = 3.0 * (2.0 + 3.0) * 0.01 * 0.01 * size * size;
            let (cost, gradient) = energy(&sides(size), None, &Vector3::z()).unwrap();
            let expected = (area + MIN_AREA * edges) * 2.0 * size * size;
            assert!((cost / expected - 1.0).abs() < 1e-3, "{cost:e} {expected:e}");
            assert!(gradient.xy().norm() < 1e-9 * cost / 0.01);
        }
    }

    #[test]
    fn the_gradient_is_how_the_energy_changes_and_the_step_makes_it_least() {
        let around = sides(1.0);
        let target = Target { position: Vector3::new(0.3, -0.2, 0.9), weight: 1e-4 };
        for target in [None, Some(&target)] {
            let x = Vector3::new(0.002, -0.001, 1.0).normalize();
            let at = |y: &Vector3<f64>| energy(&around, target, y).unwrap().0;
            let (before, gradient) = energy(&around, target, &x).unwrap();
            for k in 0..3 {
                let aside = Vector3::ith(k, 1e-7);
                let slope = (at(&(x + aside)) - at(&(x - aside))) / 2e-7;
                assert!((slope - gradient[k]).abs() < 1e-5 * gradient.norm(), "{slope} {}", gradient[k]);
            }
            let mut y = x;
            for _ in 0..6 {
                y = (y + step(&around, target, &y).unwrap()).normalize();
            }
            let across = |y: &Vector3<f64>| {
                let slope = energy(&around, target, y).unwrap().1;
                (slope - y * y.dot(&slope)).norm()
            };
            assert!(at(&y) < before && across(&y) < 1e-3 * across(&x), "{} of {}", across(&y), across(&x));
        }
    }

    #[test]
    fn a_triangle_that_turns_over_has_no_energy_and_one_that_nearly_does_much() {
        let around = sides(1.0);
        let (edge, middle) = (0.5 * (around[0].corners[0] + around[0].corners[1]), Vector3::z());
        let toward = |share: f64| energy(&around, None, &(middle + (edge - middle) * share).normalize()).map(|e| e.0);
        assert!(toward(1.01).is_none());
        let costs: Vec<f64> = [0.0, 0.5, 0.99, 0.999].into_iter().map(|share| toward(share).unwrap()).collect();
        assert!(costs.windows(2).all(|w| w[1] > w[0]), "{costs:?}");
        // By the square of what is left of it.
        assert!((costs[3] / costs[2] / 100.0 - 1.0).abs() < 0.05, "{costs:?}");
    }
}
