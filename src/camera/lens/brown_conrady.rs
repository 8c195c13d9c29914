//! Radial, decentering and thin-prism distortion of a plane: OpenCV's standard camera and its relatives.
//!
//! ```text
//! s = |u|²,   g = (1 + k₁ s + k₂ s² + k₃ s³ + k₄ s⁴) / (1 + q₁ s + q₂ s² + q₃ s³)
//! m_x = g u_x + 2 p₁ u_x u_y + p₂ (s + 2 u_x²) + s₁ s + s₂ s²
//! m_y = g u_y + p₁ (s + 2 u_y²) + 2 p₂ u_x u_y + s₃ s + s₄ s²
//! ```
//!
//! `u` is the plane of the pinhole, of the equidistant fisheye (COLMAP's thin-prism fisheye), or of the unit sphere seen from `ξ`
//! behind its center (omnidirectional cameras). OpenCV writes `k₄ k₅ k₆` for our `q₁ q₂ q₃`; it has no `k₄` of ours.
//!
//! The field ends at the radius where the image first turns back in any direction. Without decentering and prism that is a
//! root of a polynomial; with them it is searched along rays of the plane, in steps of a 128th of the radial limit's angle.
//!
//! # Reference
//! D. C. Brown, *Close-range camera calibration*, Photogrammetric Engineering 37(8), 1971. J. Weng, P. Cohen, M. Herniou, IEEE
//! TPAMI 14(10), 1992 (thin prism). C. Mei, P. Rives, *Single view point omnidirectional camera calibration*, ICRA 2007.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix2, Matrix2x3};

use super::radial::Radial;
use super::unified::Unified;
use super::{LensError, MAX_PLANE_RADIUS, PlaneModel, invert, polynomial};
use crate::Vec3;
use plumbline_num::math::Vec2;

/// Directions in the plane in which the end of the field is searched, and steps along each.
const SEARCH: (usize, usize) = (24, 128);
/// Maximum number of Newton iterations; three to five are usual.
const NEWTON_STEPS: usize = 40;

/// The plane that is distorted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum DistortedPlane {
    /// `u = (x, y)/z`.
    #[default]
    Tangent,
    /// `|u| = θ`.
    Angle,
    /// `u = (x, y)/(z + ξ |ray|)`, `ξ ≥ 0`. The image is multiplied by `1 + ξ`, which makes its slope on the axis 1: focal
    /// lengths of the paper are divided by it.
    Sphere(f64),
}

/// Coefficients, dimensionless.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DistortionTerms {
    /// `k₁ … k₄`, above the line.
    pub radial: [f64; 4],
    /// `q₁ q₂ q₃`, below it.
    pub rational: [f64; 3],
    /// `p₁ p₂`, decentering.
    pub tangential: [f64; 2],
    /// `s₁ … s₄`.
    pub thin_prism: [f64; 4],
}

impl DistortionTerms {
    fn is_radial(&self) -> bool {
        self.tangential == [0.0; 2] && self.thin_prism == [0.0; 4]
    }

    fn is_finite(&self) -> bool {
        let all = self.radial.iter().chain(&self.rational).chain(&self.tangential).chain(&self.thin_prism);
        all.copied().all(f64::is_finite)
    }

    fn above(&self) -> [f64; 5] {
        let [a, b, c, d] = self.radial;
        [1.0, a, b, c, d]
    }

    fn below(&self) -> [f64; 4] {
        let [a, b, c] = self.rational;
        [1.0, a, b, c]
    }

    /// `g` and `dg/ds`.
    #[inline]
    fn gain(&self, s: f64) -> (f64, f64) {
        let (n, dn) = polynomial::value_and_slope(&self.above(), s);
        let (d, dd) = polynomial::value_and_slope(&self.below(), s);
        let g = n / d;
        (g, (dn - g * dd) / d)
    }

    /// The distorted point.
    fn apply(&self, u: Vec2) -> Vec2 {
        let s = u.norm_squared();
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let xy = 2.0 * u.x * u.y;
        let beside = Vec2::new(
            p1 * xy + p2 * (s + 2.0 * u.x * u.x) + s * (s1 + s2 * s),
            p2 * xy + p1 * (s + 2.0 * u.y * u.y) + s * (s3 + s4 * s),
        );
        self.gain(s).0 * u + beside
    }

    /// `∂m/∂u`.
    fn jacobian(&self, u: Vec2) -> Matrix2<f64> {
        let s = u.norm_squared();
        let ([p1, p2], [s1, s2, s3, s4]) = (self.tangential, self.thin_prism);
        let (g, dg) = self.gain(s);
        let (x, y) = (2.0 * u.x, 2.0 * u.y);
        let prism = Vec2::new(s1 + 2.0 * s2 * s, s3 + 2.0 * s4 * s) * Vec2::new(x, y).transpose();
        let decentering = Matrix2::new(p1 * y + 3.0 * p2 * x, p1 * x + p2 * y, p1 * x + p2 * y, p2 * x + 3.0 * p1 * y);
        g * Matrix2::identity() + 2.0 * dg * u * u.transpose() + decentering + prism
    }

    /// Radius at which the radial part turns back or has a pole.
    fn radial_end(&self, farthest: f64) -> f64 {
        let (n, d) = (self.above(), self.below());
        let twice_s = |c: &[f64]| -> Vec<f64> { std::iter::once(0.0).chain(c.iter().map(|c| 2.0 * c)).collect() };
        // d(r g)/dr = ((n + 2 s n′) d − 2 s n d′)/d².
        let mut rising = polynomial::product(&n, &d);
        let bend = polynomial::product(&twice_s(&polynomial::derivative(&n)), &d);
        let pole = polynomial::product(&twice_s(&polynomial::derivative(&d)), &n);
        for (i, r) in rising.iter_mut().enumerate() {
            *r += bend.get(i).unwrap_or(&0.0) - pole.get(i).unwrap_or(&0.0);
        }
        let s = farthest * farthest;
        polynomial::positive_up_to(&rising, s).min(polynomial::positive_up_to(&d, s)).sqrt()
    }
}

/// A plane with distortion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrownConrady {
    plane: Base,
    terms: DistortionTerms,
    /// Radius of `u` at which the field ends.
    end: f64,
    limit: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Base {
    Radial(Radial),
    Sphere { xi: f64, model: Unified },
}

impl Base {
    #[inline]
    fn with<T>(&self, with: impl FnOnce(&dyn PlaneModel) -> T) -> T {
        match self {
            Self::Radial(model) => with(model),
            Self::Sphere { model, .. } => with(model),
        }
    }

    /// The factor from `u` to a plane with slope 1 on the axis.
    fn scale(&self) -> f64 {
        if let Self::Sphere { xi, .. } = self { 1.0 + xi } else { 1.0 }
    }

    fn farthest(&self) -> f64 {
        match self {
            Self::Radial(Radial::Equidistant) => PI,
            Self::Sphere { xi, .. } if *xi > 1.0 => (xi * xi - 1.0).sqrt().recip().min(MAX_PLANE_RADIUS),
            _ => MAX_PLANE_RADIUS,
        }
    }

    /// Angle off the axis at radius `r` of `u`.
    fn angle(&self, r: f64) -> Option<f64> {
        self.with(|m| m.ray(Vec2::new(self.scale() * r, 0.0))).map(|ray| ray.x.atan2(ray.z))
    }
}

impl BrownConrady {
    /// The lens that distorts a plane by `terms`.
    ///
    /// # Errors
    /// [`LensError::Parameter`] for terms that are not finite and a `ξ` that is negative.
    pub fn new(plane: DistortedPlane, terms: DistortionTerms) -> Result<Self, LensError> {
        if !terms.is_finite() {
            let expected = "finite coefficients";
            return Err(LensError::Parameter { name: "a distortion coefficient", value: f64::NAN, expected });
        }
        let plane = match plane {
            DistortedPlane::Tangent => Base::Radial(Radial::Rectilinear),
            DistortedPlane::Angle => Base::Radial(Radial::Equidistant),
            DistortedPlane::Sphere(xi) if xi >= 0.0 && xi.is_finite() => {
                Base::Sphere { xi, model: Unified::camera(xi / (1.0 + xi))? }
            }
            DistortedPlane::Sphere(xi) => {
                return Err(LensError::Parameter { name: "xi", value: xi, expected: "0 or more" });
            }
        };
        let mut end = terms.radial_end(plane.farthest());
        if !terms.is_radial() {
            end = beside_end(&terms, end);
        }
        let whole = plane.with(|m| m.max_angle());
        let limit = plane.angle(end).unwrap_or(whole);
        Ok(Self { plane, terms, end, limit })
    }

    /// The plane and its terms.
    pub fn parameters(&self) -> (DistortedPlane, DistortionTerms) {
        let plane = match self.plane {
            Base::Radial(Radial::Equidistant) => DistortedPlane::Angle,
            Base::Radial(_) => DistortedPlane::Tangent,
            Base::Sphere { xi, .. } => DistortedPlane::Sphere(xi),
        };
        (plane, self.terms)
    }

    /// `u` at which the image is `m`.
    fn undistorted(&self, m: Vec2) -> Option<Vec2> {
        let radius = |r: f64| {
            let (g, dg) = self.terms.gain(r * r);
            (r * g, g + 2.0 * r * r * dg)
        };
        let wanted = m.norm();
        let r = invert::increasing(wanted, self.end, wanted, radius);
        if self.terms.is_radial() {
            return Some(if wanted > 0.0 { r? / wanted * m } else { m });
        }
        let start = r.unwrap_or(0.99 * self.end).min(0.99 * self.end);
        self.newton(m, if wanted > 0.0 { start / wanted * m } else { m })
    }

    /// Newton's method in the plane, kept inside the field and from growing the residual.
    fn newton(&self, m: Vec2, start: Vec2) -> Option<Vec2> {
        let miss = |u: Vec2| self.terms.apply(u) - m;
        let (mut u, mut off) = (start, miss(start));
        for _ in 0..NEWTON_STEPS {
            let step = self.terms.jacobian(u).try_inverse()? * off;
            let shorter = (0..30).map(|k| u - step * 0.5_f64.powi(k)).find_map(|v| {
                let off_there = miss(v);
                (v.norm() < self.end && off_there.norm() < off.norm()).then_some((v, off_there))
            });
            let Some((v, off_there)) = shorter else { break };
            (u, off) = (v, off_there);
            if off.norm() <= 1e-15 * (1.0 + m.norm()) {
                break;
            }
        }
        (off.norm() <= 1e-13 * (1.0 + m.norm())).then_some(u)
    }
}

/// The radius below `end` at which the image turns back in some direction.
fn beside_end(terms: &DistortionTerms, end: f64) -> f64 {
    let steep = |r: f64, azimuth: f64| {
        let (sin, cos) = azimuth.sin_cos();
        terms.jacobian(Vec2::new(r * cos, r * sin)).determinant() > 0.0
    };
    let (rays, steps) = SEARCH;
    let mut first = end;
    for ray in 0..rays {
        let azimuth = TAU * ray as f64 / rays as f64;
        // Even steps of the angle, for planes that reach far.
        let radius = |i: usize| (end.atan() * i as f64 / steps as f64).tan().min(end);
        let Some(fold) = (1..=steps).find(|i| !steep(radius(*i), azimuth)) else { continue };
        let (mut low, mut high) = (radius(fold - 1), radius(fold));
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if steep(middle, azimuth) {
                low = middle;
            } else {
                high = middle;
            }
        }
        first = first.min(low);
    }
    first
}

impl PlaneModel for BrownConrady {
    fn plane(&self, ray: &Vec3) -> Option<Vec2> {
        let scale = self.plane.scale();
        let u = self.plane.with(|m| m.plane(ray))? / scale;
        (u.norm() < self.end).then(|| scale * self.terms.apply(u))
    }

    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)> {
        let scale = self.plane.scale();
        let (m, jacobian) = self.plane.with(|m| m.plane_with_jacobian(ray))?;
        let u = m / scale;
        (u.norm() < self.end).then(|| (scale * self.terms.apply(u), self.terms.jacobian(u) * jacobian))
    }

    fn ray(&self, m: Vec2) -> Option<Vec3> {
        let scale = self.plane.scale();
        let u = self.undistorted(m / scale)?;
        self.plane.with(|model| model.ray(scale * u))
    }

    fn max_angle(&self) -> f64 {
        self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folding() -> BrownConrady {
        // r (1 − 0.1 r²) turns back at r = √(1/0.3).
        let terms = DistortionTerms { radial: [-0.1, 0.0, 0.0, 0.0], ..Default::default() };
        BrownConrady::new(DistortedPlane::Tangent, terms).expect("finite")
    }

    #[test]
    fn the_field_ends_where_the_image_turns_back() {
        let turn = (1.0_f64 / 0.3).sqrt();
        assert!((folding().max_angle() - turn.atan()).abs() < 1e-12);
        let at = |r: f64| folding().plane(&Vec3::new(r, 0.0, 1.0));
        assert!(at(turn - 1e-6).is_some() && at(turn + 1e-6).is_none());
        assert!(folding().ray(Vec2::new(turn * (1.0 - 0.1 * turn * turn) + 1e-9, 0.0)).is_none());
    }

    #[test]
    fn a_pole_below_the_line_ends_the_field_too() {
        let terms = DistortionTerms { rational: [-0.25, 0.0, 0.0], ..Default::default() };
        let lens = BrownConrady::new(DistortedPlane::Tangent, terms).expect("finite");
        assert!((lens.max_angle() - 2.0_f64.atan()).abs() < 1e-9);
    }

    #[test]
    fn decentering_brings_the_end_nearer_on_one_side() {
        let terms = DistortionTerms { tangential: [0.0, 0.02], ..folding().terms };
        let lens = BrownConrady::new(DistortedPlane::Tangent, terms).expect("finite");
        assert!(lens.max_angle() < folding().max_angle() - 0.01 && lens.max_angle() > 0.8 * folding().max_angle());
        // Inside, no two directions are seen at one place: the image keeps its orientation everywhere.
        for i in 0..400 {
            let (azimuth, r) = (f64::from(i) * 0.37, lens.end * f64::from(i % 20) / 20.0);
            assert!(terms.jacobian(Vec2::new(r * azimuth.cos(), r * azimuth.sin())).determinant() > 0.0);
        }
    }

    #[test]
    fn the_sphere_without_offset_and_terms_is_the_pinhole() {
        let lens = BrownConrady::new(DistortedPlane::Sphere(0.0), DistortionTerms::default()).expect("finite");
        let ray = Vec3::new(0.4, 0.2, 0.9);
        assert!((lens.plane(&ray).expect("in front") - ray.xy() / ray.z).norm() < 1e-14);
        assert!(BrownConrady::new(DistortedPlane::Sphere(-0.1), DistortionTerms::default()).is_err());
        let terms = DistortionTerms { tangential: [f64::NAN, 0.0], ..Default::default() };
        assert!(BrownConrady::new(DistortedPlane::Tangent, terms).is_err());
    }
}
