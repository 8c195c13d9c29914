//! Two one-parameter fisheye lenses with closed forms both ways.
//!
//! ```text
//! division         ray ∝ (m, 1 + λ |m|²),           r = 2ρ / (z + √(z² − 4 λ ρ²))
//! field of view    tan(t r) = t tan θ,   t = 2 tan(ω/2)
//! ```
//!
//! For `λ < 0` the division model sees all directions but the one straight behind (`λ = −1/4` is the stereographic projection);
//! for `λ > 0` it turns back at `tan θ = 1/(2 √λ)`. The field-of-view model is written with slope 1 on the axis: the focal
//! length of the papers is multiplied by `t/ω`.
//!
//! # Reference
//! A. Fitzgibbon, *Simultaneous linear estimation of multiple view geometry and lens distortion*, CVPR 2001, eq. 4.
//! F. Devernay, O. Faugeras, *Straight lines have to be straight*, Machine Vision and Applications 13, 2001, section 2.2.

use std::f64::consts::PI;

use super::radial::RadialModel;

/// `ray ∝ (m, 1 + λ |m|²)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Division(pub(super) f64);

impl RadialModel for Division {
    fn radius(&self, theta: f64) -> (f64, f64) {
        let (sin, cos) = theta.sin_cos();
        let r = self.stretch(sin, cos).unwrap_or(0.0) * sin;
        let z = 1.0 + self.0 * r * r;
        (r, (r * r + z * z) / (1.0 - self.0 * r * r))
    }

    fn angle(&self, r: f64) -> Option<f64> {
        let theta = r.atan2(1.0 + self.0 * r * r);
        // The turn back lies at r = 1/√λ.
        (theta < self.limit() && self.0 * r * r < 1.0).then_some(theta)
    }

    fn limit(&self) -> f64 {
        match self.0 {
            l if l > 0.0 => (0.5 / l.sqrt()).atan(),
            0.0 => 0.5 * PI,
            l if l.is_finite() => PI,
            _ => 0.0,
        }
    }

    fn stretch(&self, rho: f64, z: f64) -> Option<f64> {
        if !(rho.atan2(z) < self.limit()) {
            return None;
        }
        let root = (z * z - 4.0 * self.0 * rho * rho).max(0.0).sqrt();
        let stretch = if z > 0.0 { 2.0 / (z + root) } else { (root - z) / (-2.0 * self.0 * rho * rho) };
        (stretch.is_finite() && stretch > 0.0).then_some(stretch)
    }
}

/// `tan(t r) = t tan θ`, given `t = 2 tan(ω/2)` for `0 < ω < π`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FovModel(pub(super) f64);

impl FovModel {
    fn valid(self) -> bool {
        self.0 > 0.0 && self.0.is_finite()
    }
}

impl RadialModel for FovModel {
    fn radius(&self, theta: f64) -> (f64, f64) {
        let (t, (sin, cos)) = (self.0, theta.sin_cos());
        ((t * sin).atan2(cos) / t, 1.0 / (cos * cos + t * t * sin * sin))
    }

    fn angle(&self, r: f64) -> Option<f64> {
        let (sin, cos) = (self.0 * r).sin_cos();
        (self.valid() && self.0 * r < PI).then(|| sin.atan2(self.0 * cos))
    }

    fn limit(&self) -> f64 {
        if self.valid() { PI } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::radial::Radial;

    #[test]
    fn a_quarter_divides_stereographically() {
        for theta in [0.1, 1.0, 1.6, 3.0] {
            let (a, b) = (Division(-0.25).radius(theta), Radial::Stereographic.radius(theta));
            assert!((a.0 - b.0).abs() < 1e-12 * b.0 && (a.1 - b.1).abs() < 1e-11 * b.1, "{theta}: {a:?} {b:?}");
        }
    }

    #[test]
    fn a_positive_division_has_its_fold_where_the_formula_says() {
        let model = Division(0.25);
        assert!((model.limit() - 1.0_f64.atan()).abs() < 1e-15);
        assert!(model.angle(1.999).is_some() && model.angle(2.001).is_none());
        assert_eq!(Division(f64::NAN).limit(), 0.0);
    }

    #[test]
    fn the_field_of_view_model_is_that_of_the_paper() {
        let (omega, theta) = (0.93_f64, 0.6_f64);
        let t = 2.0 * (omega / 2.0).tan();
        let paper = (t * theta.tan()).atan() / omega;
        assert!((FovModel(t).radius(theta).0 * t / omega - paper).abs() < 1e-15);
        assert_eq!(FovModel(-1.0).limit(), 0.0);
    }
}
