//! The omnidirectional camera with a polynomial along the ray.
//!
//! ```text
//! ray ∝ (ρ, P(|ρ|)),   P(r) = 1 + b₁ r + b₂ r² + …,   m = A ρ
//! ```
//!
//! In the toolbox's terms, with rows and columns as x and y and the camera looking along −z: `f = −a₀`, `b_i = −a_i fⁱ⁻¹`, and
//! `A = (1 e; d c)`. The angle `atan2(r, P(r))` is followed to where it first stops growing, `P = r P′`; its inverse is Newton's, not the
//! fitted one of the toolbox's files.
//!
//! # Reference
//! D. Scaramuzza, A. Martinelli, R. Siegwart, *A toolbox for easily calibrating omnidirectional cameras*, IROS 2006, eq. 1–6.

use nalgebra::{Matrix2, Matrix2x3};

use super::radial::RadialModel;
use super::{LensError, PlaneModel, invert, polynomial};
use crate::Vec3;
use plumbline_num::math::Vec2;

/// Radius up to which the polynomial is searched, focal lengths: an equidistant lens reaches 180° at π.
const MAX_RADIUS: f64 = 50.0;

/// Angle along a ray polynomial, symmetric about the axis.
#[derive(Clone, Debug, PartialEq)]
struct RayPolynomial {
    /// `1, b₁, b₂, …`
    b: Vec<f64>,
    /// Radius of the limit.
    farthest: f64,
    limit: f64,
}

impl RayPolynomial {
    /// Angle at a radius and its derivative.
    fn angle_and_slope(&self, r: f64) -> (f64, f64) {
        let (p, slope) = polynomial::value_and_slope(&self.b, r);
        (r.atan2(p), (p - r * slope) / (r * r + p * p))
    }
}

impl RadialModel for RayPolynomial {
    fn radius(&self, theta: f64) -> (f64, f64) {
        let r = invert::increasing(theta, self.farthest, theta, |r| self.angle_and_slope(r)).unwrap_or(f64::NAN);
        (r, 1.0 / self.angle_and_slope(r).1)
    }

    fn angle(&self, r: f64) -> Option<f64> {
        (r < self.farthest).then(|| self.angle_and_slope(r).0)
    }

    fn limit(&self) -> f64 {
        self.limit
    }
}

/// `ray ∝ (A⁻¹ m, P(|A⁻¹ m|))`.
#[derive(Clone, Debug, PartialEq)]
pub struct Ocam {
    polynomial: RayPolynomial,
    affine: Matrix2<f64>,
    inverse: Matrix2<f64>,
}

impl Ocam {
    /// The lens with coefficients `b₁ b₂ …` and the affine map `A` from the plane of the lens to that of the sensor.
    ///
    /// # Errors
    /// [`LensError::Parameter`] for a map that cannot be inverted or a polynomial that is not finite.
    pub fn new(coefficients: &[f64], affine: Matrix2<f64>) -> Result<Self, LensError> {
        let det = affine.determinant();
        let inverse = affine.try_inverse().filter(|i| det > 0.0 && i.iter().all(|v| v.is_finite()));
        let refused = LensError::Parameter { name: "c - d e", value: det, expected: "above 0, near 1" };
        let inverse = inverse.ok_or(refused)?;
        if let Some(bad) = coefficients.iter().find(|c| !c.is_finite()) {
            let expected = "finite coefficients";
            return Err(LensError::Parameter { name: "a polynomial coefficient", value: *bad, expected });
        }
        let b: Vec<f64> = std::iter::once(1.0).chain(coefficients.iter().copied()).collect();
        // P − r P′.
        let slope: Vec<f64> = b.iter().enumerate().map(|(i, b)| (1.0 - i as f64) * b).collect();
        let farthest = polynomial::positive_up_to(&slope, MAX_RADIUS);
        let limit = farthest.atan2(polynomial::value(&b, farthest));
        Ok(Self { polynomial: RayPolynomial { b, farthest, limit }, affine, inverse })
    }

    /// `b₁ b₂ …`
    pub fn coefficients(&self) -> &[f64] {
        &self.polynomial.b[1..]
    }

    /// `A`.
    pub fn affine(&self) -> Matrix2<f64> {
        self.affine
    }
}

impl PlaneModel for Ocam {
    fn plane(&self, ray: &Vec3) -> Option<Vec2> {
        self.polynomial.plane(ray).map(|m| self.affine * m)
    }

    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)> {
        self.polynomial.plane_with_jacobian(ray).map(|(m, jacobian)| (self.affine * m, self.affine * jacobian))
    }

    fn ray(&self, m: Vec2) -> Option<Vec3> {
        self.polynomial.ray(self.inverse * m)
    }

    fn max_angle(&self) -> f64 {
        self.polynomial.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_polynomial_it_is_rectilinear_and_with_a_parabola_stereographic() {
        let ray = Vec3::new(0.4, 0.2, 0.9);
        let plain = Ocam::new(&[], Matrix2::identity()).expect("valid");
        assert!((plain.plane(&ray).expect("in front") - ray.xy() / ray.z).norm() < 1e-14);
        let parabola = Ocam::new(&[0.0, -0.25], Matrix2::identity()).expect("valid");
        let stereographic = 2.0 / (ray.norm() + ray.z) * ray.xy();
        assert!((parabola.plane(&ray).expect("in front") - stereographic).norm() < 1e-14);
    }

    #[test]
    fn singular_maps_are_refused() {
        for affine in [Matrix2::zeros(), Matrix2::new(1.0, 1.0, 1.0, 1.0), Matrix2::new(f64::NAN, 0.0, 0.0, 1.0)] {
            assert!(Ocam::new(&[0.0, -0.2], affine).expect_err("singular").to_string().starts_with("c - d e = "));
        }
        assert!(Ocam::new(&[f64::NAN], Matrix2::identity()).is_err());
    }
}
