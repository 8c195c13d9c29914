//! Sphere models: the unified camera, its extension, and the double sphere.
//!
//! ```text
//! d₁ = |ray|,   z₁ = z + ξ d₁,   d₂ = √(β (x² + y²) + z₁²),   m = (1 + ξ) (x, y) / (α d₂ + (1 − α) z₁)
//! ```
//!
//! `ξ = 0, β = 1` is the unified camera, `ξ = 0` the extended one, `β = 1` the double sphere. The factor `1 + ξ` makes the slope on
//! the axis 1: focal lengths of the papers are divided by it. The field ends where the denominator vanishes (`α ≤ ½`, the
//! image is unbounded) or the image turns back (`α > ½`): with `w = α/(1 − α)` or `(1 − α)/α`,
//!
//! ```text
//! z₁ > −w d₂:     cos θ > −ξ (1 − w²) − w √(1 − ξ² (1 − w²))        (β = 1)
//!                 z > −w √(β (x² + y²) + z²)                        (ξ = 0)
//! ```
//!
//! The paper on the double sphere gives another bound for `cos θ`, which is this one only for `ξ = 0`.
//!
//! # Reference
//! V. Usenko, N. Demmel, D. Cremers, *The double sphere camera model*, 3DV 2018, sections 2–3. B. Khomutenko, G. Garcia,
//! P. Martinet, *An enhanced unified camera model*, RA-L 1(1), 2016. C. Mei, P. Rives, ICRA 2007.

use nalgebra::{Matrix2x3, RowVector3};

use super::{LensError, PlaneModel};
use crate::Vec3;
use plumbline_num::math::Vec2;

/// `m = (1 + ξ) (x, y) / (α d₂ + (1 − α) z₁)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unified {
    xi: f64,
    alpha: f64,
    beta: f64,
    limit: f64,
    /// Its cosine.
    lowest: f64,
}

impl Unified {
    /// The unified camera; `0 ≤ α ≤ 1`. In the notation with one sphere, `α = ξ/(1 + ξ)`.
    ///
    /// # Errors
    /// [`LensError::Parameter`] outside the range.
    pub fn camera(alpha: f64) -> Result<Self, LensError> {
        Self::extended(alpha, 1.0)
    }

    /// The extended unified camera; `0 ≤ α ≤ 1`, `β > 0`.
    ///
    /// # Errors
    /// [`LensError::Parameter`] outside the range.
    pub fn extended(alpha: f64, beta: f64) -> Result<Self, LensError> {
        share("alpha", alpha)?;
        if !(beta > 0.0 && beta.is_finite()) {
            return Err(LensError::Parameter { name: "beta", value: beta, expected: "a number above 0" });
        }
        let w = weight(alpha);
        let limit = (1.0 - w * w).max(0.0).sqrt().atan2(-w * beta.sqrt());
        Ok(Self { xi: 0.0, alpha, beta, limit, lowest: limit.cos() })
    }

    /// The double sphere; `−1 < ξ ≤ 1`, `0 ≤ α ≤ 1`.
    ///
    /// # Errors
    /// [`LensError::Parameter`] outside the range.
    pub fn double_sphere(xi: f64, alpha: f64) -> Result<Self, LensError> {
        share("alpha", alpha)?;
        if !(xi > -1.0 && xi <= 1.0) {
            return Err(LensError::Parameter { name: "xi", value: xi, expected: "above -1 and at most 1" });
        }
        let w = weight(alpha);
        let rest = 1.0 - w * w;
        let cos = -xi * rest - w * (1.0 - xi * xi * rest).sqrt();
        let lowest = cos.clamp(-1.0, 1.0);
        Ok(Self { xi, alpha, beta: 1.0, limit: lowest.acos(), lowest })
    }

    /// `ξ, α, β`.
    pub fn parameters(&self) -> (f64, f64, f64) {
        (self.xi, self.alpha, self.beta)
    }

    /// `d₁, d₂, z₁` of a direction inside the field.
    fn spheres(&self, ray: &Vec3) -> Option<(f64, f64, f64)> {
        let s = ray.xy().norm_squared();
        let d1 = (s + ray.z * ray.z).sqrt();
        if !(ray.z > self.lowest * d1) {
            return None;
        }
        let z1 = ray.z + self.xi * d1;
        Some((d1, (self.beta * s + z1 * z1).sqrt(), z1))
    }
}

impl PlaneModel for Unified {
    fn plane(&self, ray: &Vec3) -> Option<Vec2> {
        let (_, d2, z1) = self.spheres(ray)?;
        let below = self.alpha * d2 + (1.0 - self.alpha) * z1;
        (below > 0.0).then(|| (1.0 + self.xi) / below * ray.xy())
    }

    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)> {
        let (d1, d2, z1) = self.spheres(ray)?;
        let below = self.alpha * d2 + (1.0 - self.alpha) * z1;
        if !(below > 0.0) {
            return None;
        }
        let dz1 = RowVector3::new(0.0, 0.0, 1.0) + self.xi / d1 * ray.transpose();
        let dd2 = (self.beta * RowVector3::new(ray.x, ray.y, 0.0) + z1 * dz1) / d2;
        let slope = self.alpha * dd2 + (1.0 - self.alpha) * dz1;
        let m = (1.0 + self.xi) / below * ray.xy();
        Some((m, ((1.0 + self.xi) * Matrix2x3::identity() - m * slope) / below))
    }

    fn ray(&self, m: Vec2) -> Option<Vec3> {
        let (xi, alpha, beta) = (self.xi, self.alpha, self.beta);
        let m = m / (1.0 + xi);
        let s = m.norm_squared();
        let under = 1.0 - (2.0 * alpha - 1.0) * beta * s;
        if !(under >= 0.0) {
            return None;
        }
        let z = (1.0 - beta * alpha * alpha * s) / (alpha * under.sqrt() + 1.0 - alpha);
        let scale = if xi == 0.0 {
            1.0 / s.sqrt().hypot(z)
        } else {
            (z * xi + (z * z + (1.0 - xi * xi) * s).max(0.0).sqrt()) / (z * z + s)
        };
        let ray = Vec3::new(scale * m.x, scale * m.y, scale * z - xi);
        let length = ray.norm();
        (ray.z > self.lowest * length && length.is_finite()).then(|| ray / length)
    }

    fn max_angle(&self) -> f64 {
        self.limit
    }
}

fn weight(alpha: f64) -> f64 {
    if alpha <= 0.5 { alpha / (1.0 - alpha) } else { (1.0 - alpha) / alpha }
}

fn share(name: &'static str, value: f64) -> Result<(), LensError> {
    if (0.0..=1.0).contains(&value) {
        return Ok(());
    }
    Err(LensError::Parameter { name, value, expected: "0 to 1" })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_models_contain_the_classical_projections() {
        let ray = Vec3::new(0.5, -0.3, 0.7);
        let close = |a: Unified, b: Vec2| assert!((a.plane(&ray).expect("in front") - b).norm() < 1e-14, "{a:?}");
        close(Unified::camera(0.0).expect("valid"), ray.xy() / ray.z);
        close(Unified::camera(1.0).expect("valid"), ray.xy() / ray.norm());
        close(Unified::camera(0.5).expect("valid"), 2.0 / (ray.norm() + ray.z) * ray.xy());
        close(Unified::double_sphere(1.0, 0.0).expect("valid"), 2.0 / (ray.norm() + ray.z) * ray.xy());
    }

    #[test]
    fn the_double_sphere_without_offset_is_the_unified_camera() {
        let (a, b) = (Unified::double_sphere(0.0, 0.6).expect("valid"), Unified::camera(0.6).expect("valid"));
        assert!((a.max_angle() - b.max_angle()).abs() < 1e-12);
        let ray = Vec3::new(0.5, -0.3, -0.1);
        assert_eq!(a.plane(&ray), b.plane(&ray));
    }

    #[test]
    fn the_radius_grows_up_to_the_limit_and_not_beyond() {
        let models = [
            Unified::camera(0.3),
            Unified::camera(0.8),
            Unified::extended(0.58, 1.14),
            Unified::extended(0.7, 0.6),
            Unified::double_sphere(-0.24, 0.57),
            Unified::double_sphere(0.5, 0.3),
            Unified::double_sphere(0.3, 0.9),
        ];
        for model in models.map(|m| m.expect("valid")) {
            let at = |t: f64| Vec3::new(t.sin(), 0.0, t.cos());
            let steps = 2000;
            let mut before = -1.0;
            for i in 0..steps {
                let r = model.plane(&at(model.limit * f64::from(i) / f64::from(steps))).expect("inside").x;
                assert!(r > before, "{model:?} at {i}");
                before = r;
            }
            // The formula itself, beyond the limit, is negative, infinite or smaller.
            let last = model.plane(&at(model.limit * (1.0 - 1e-12))).expect("inside").x;
            let wide = Unified { lowest: -1.0, ..model };
            assert!(wide.plane(&at(model.limit + 1e-3)).is_none_or(|m| m.x < last), "{model:?} goes on");
        }
    }

    #[test]
    fn parameters_outside_their_range_are_refused_by_name() {
        for (refused, name) in [
            (Unified::camera(1.5), "alpha"),
            (Unified::camera(f64::NAN), "alpha"),
            (Unified::extended(0.5, 0.0), "beta"),
            (Unified::double_sphere(-1.0, 0.5), "xi"),
        ] {
            assert!(refused.expect_err(name).to_string().starts_with(name));
        }
    }
}
