//! Distance of the samples of a line from a great circle, in pixels.
//!
//! What is straight in space is seen in directions `u` of one plane through the camera, `n·u = 0`: a great circle. A sample
//! at pixel `p` looks in direction `u(p)`; its distance from the image of the circle is, to first order,
//!
//! ```text
//! d = n·u(p) / ‖Gᵀ n‖  px,      G = ∂u/∂p      (3×2),
//! ```
//!
//! positive on the side that `n` points to. Measured in pixels rather than angles, every sample has the accuracy of its
//! mark, whatever the local scale of the lens. The best circle minimizes `Σ d²`; as `‖Gᵀ n‖` hardly changes with `n`, a
//! few iterations of the smallest eigenvector of `Σ u uᵀ / ‖Gᵀ n‖²` suffice.
//!
//! # Reference
//! P. D. Sampson, *Fitting conic sections to "very scattered" data*, CGIP 18, 1982 (the first-order distance).

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix3x2, SymmetricEigen};

use plumbline_camera::Lens;
use plumbline_camera::Vec3;
use plumbline_num::math::Point2;

/// Iterations of the reweighting: the distances change by less than a thousandth after the second.
const REWEIGHTINGS: usize = 3;
/// Lower bound on the slope of `n·u`, 1/px: avoids a division by zero where a sample looks along `n`, far off the
/// circle.
const MIN_SLOPE: f64 = 1e-12;

/// The viewing ray of a pixel and its derivative.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Unit direction.
    pub ray: Vec3,
    /// `∂u/∂p`, rad/px.
    pub ray_per_px: Matrix3x2<f64>,
}

impl Sight {
    /// The ray of `lens` at `p`; `None` outside its field.
    pub fn new(lens: &Lens, p: Point2) -> Option<Self> {
        let ray = lens.unproject(p)?;
        let (_, jacobian) = lens.project_with_jacobian(&ray)?;
        Some(Self { ray, ray_per_px: inverse_on_tangent(&jacobian, &ray)? })
    }

    /// Signed distance from the great circle with unit normal `n`, px.
    pub fn distance(&self, n: &Vec3) -> f64 {
        n.dot(&self.ray) / self.slope(n)
    }

    fn slope(&self, n: &Vec3) -> f64 {
        self.ray_per_px.tr_mul(n).norm().max(MIN_SLOPE)
    }
}

/// `∂u/∂p` from `∂p/∂u`, on the tangent plane of the unit sphere at `ray`.
fn inverse_on_tangent(jacobian: &Matrix2x3<f64>, ray: &Vec3) -> Option<Matrix3x2<f64>> {
    let aside = Vec3::ith(ray.iamin(), 1.0);
    let first = ray.cross(&aside).normalize();
    let tangent = Matrix3x2::from_columns(&[first, ray.cross(&first)]);
    let flat: Matrix2<f64> = jacobian * tangent;
    Some(tangent * flat.try_inverse()?)
}

/// Unit normal of the best great circle through `sights`; `None` for fewer than two, or where they do not determine
/// one.
pub fn best_circle(sights: &[Sight]) -> Option<Vec3> {
    if sights.len() < 2 {
        return None;
    }
    let mut weights: Vec<f64> = sights.iter().map(|s| s.ray_per_px.norm_squared().recip()).collect();
    let mut normal = None;
    for _ in 0..REWEIGHTINGS {
        let moment: Matrix3<f64> = sights.iter().zip(&weights).map(|(s, w)| s.ray * s.ray.transpose() * *w).sum();
        let trace = moment.trace();
        if !(trace > 0.0 && trace.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::new(moment / trace);
        let n: Vec3 = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
        for (w, s) in weights.iter_mut().zip(sights) {
            *w = s.slope(&n).powi(-2);
        }
        normal = Some(n);
    }
    normal
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_camera::{FieldAxis, FieldOfView, Projection};

    fn lens() -> Lens {
        let fov = FieldOfView::degrees(150.0, FieldAxis::Horizontal);
        Lens::from_field_of_view(Projection::Equidistant, fov, (1000.0, 800.0)).expect("below 360°")
    }

    #[test]
    fn shifted_samples_have_their_shift_as_distance_from_the_circle() {
        let (lens, n) = (lens(), Vec3::new(0.3, 0.9, -0.2).normalize());
        let along = n.cross(&Vec3::x()).normalize();
        for (angle, off) in [(-0.9, 0.5), (-0.2, -2.0), (0.4, 1.0), (1.0, 3.0)] {
            let on = |a: f64| lens.project(&(along * a.sin() + along.cross(&n) * -a.cos())).expect("inside the field");
            let (p, tangent) = (on(angle), (on(angle + 1e-5) - on(angle - 1e-5)).normalize());
            let moved = p + off * nalgebra::Vector2::new(-tangent.y, tangent.x);
            let distance = Sight::new(&lens, moved).expect("inside the field").distance(&n);
            assert!((distance.abs() - f64::abs(off)).abs() < 0.01 * f64::abs(off), "{distance} for {off}");
        }
    }

    #[test]
    fn ray_per_px_is_the_derivative_of_the_ray() {
        let lens = lens();
        for p in [Point2::new(500.0, 400.0), Point2::new(100.0, 700.0), Point2::new(990.0, 15.0)] {
            let sight = Sight::new(&lens, p).expect("inside the field");
            for axis in 0..2 {
                let step = 1e-4 * nalgebra::Vector2::ith(axis, 1.0);
                let ray = |q| lens.unproject(q).expect("inside the field");
                let slope = (ray(p + step) - ray(p - step)) / 2e-4;
                assert!((slope - sight.ray_per_px.column(axis)).norm() < 1e-9, "{p} {axis}");
            }
        }
    }

    #[test]
    fn a_circle_is_found_from_its_samples_and_needs_two() {
        let (lens, n) = (lens(), Vec3::new(0.1, -0.8, 0.5).normalize());
        let along = n.cross(&Vec3::x()).normalize();
        let ahead = n.cross(&along) * n.cross(&along).z.signum();
        let sights: Vec<_> = (-5..=5)
            .filter_map(|i| lens.project(&(along * (0.2 * f64::from(i)).sin() + ahead * (0.2 * f64::from(i)).cos())))
            .filter_map(|p| Sight::new(&lens, p))
            .collect();
        assert!(sights.len() > 6);
        assert!(best_circle(&sights).expect("a circle").dot(&n).abs() > 1.0 - 1e-12);
        assert!(best_circle(&sights[..1]).is_none() && best_circle(&[]).is_none());
    }
}
