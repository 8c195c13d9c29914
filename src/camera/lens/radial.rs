//! Lenses that are symmetric about their axis, and the five classical ones.
//!
//! ```text
//! θ = ∠(ray, +z),    m = r(θ) (x, y) / √(x² + y²)
//!
//! rectilinear     r = tan θ            θ < 90°
//! equidistant     r = θ                θ < 180°
//! equisolid       r = 2 sin(θ/2)       θ < 180°
//! stereographic   r = 2 tan(θ/2)       θ < 180°
//! orthographic    r = sin θ            θ < 90°
//! ```
//!
//! # Reference
//! K. Miyamoto, *Fish eye lens*, J. Opt. Soc. Am. 54(8), 1964. Kannala and Brandt 2006, eq. 1–5.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix2, Matrix2x3};

use super::PlaneModel;
use crate::Vec3;
use plumbline_num::math::Vec2;

/// A projection defined by the distance `r` from the center at which an angle `θ` off the axis is seen; `r` increases
/// with `θ` up to the limit.
pub(super) trait RadialModel {
    /// `(r, dr/dθ)`, at angles from 0 to the limit.
    fn radius(&self, theta: f64) -> (f64, f64);

    /// The angle below the limit that is seen at distance `r` ≥ 0.
    fn angle(&self, r: f64) -> Option<f64>;

    /// Sine and cosine of that angle.
    fn sine_and_cosine(&self, r: f64) -> Option<(f64, f64)> {
        self.angle(r).map(f64::sin_cos)
    }

    /// The limit, rad: at it and beyond nothing is seen.
    fn limit(&self) -> f64;

    /// `r/ρ` for a direction `ρ` off the axis and `z` along it.
    fn stretch(&self, rho: f64, z: f64) -> Option<f64> {
        let theta = rho.atan2(z);
        if !(theta < self.limit()) {
            return None;
        }
        // At the axis r/ρ = r′(0)/z.
        Some(if rho > 0.0 { self.radius(theta).0 / rho } else { self.radius(0.0).1 / z })
    }
}

impl<T: RadialModel> PlaneModel for T {
    fn plane(&self, ray: &Vec3) -> Option<Vec2> {
        Some(self.stretch(ray.xy().norm(), ray.z)? * ray.xy())
    }

    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)> {
        let (rho, z) = (ray.xy().norm(), ray.z);
        let stretch = self.stretch(rho, z)?;
        let mut jacobian = Matrix2x3::zeros();
        if !(rho > 0.0) {
            jacobian.fixed_view_mut::<2, 2>(0, 0).copy_from(&(stretch * Matrix2::identity()));
            return Some((Vec2::zeros(), jacobian));
        }
        // Along e = (x, y)/ρ: dr = r′ dθ with dθ = (z dρ − ρ dz)/(ρ² + z²); across it the stretch r/ρ.
        let e = ray.xy() / rho;
        let slope = self.radius(rho.atan2(z)).1 / (rho * rho + z * z);
        let along = e * e.transpose();
        let plane = (slope * z) * along + stretch * (Matrix2::identity() - along);
        jacobian.fixed_view_mut::<2, 2>(0, 0).copy_from(&plane);
        jacobian.set_column(2, &(-slope * rho * e));
        Some((stretch * ray.xy(), jacobian))
    }

    fn ray(&self, m: Vec2) -> Option<Vec3> {
        // Infinite from 1e154 on, where no picture is.
        let r = m.norm();
        let (sin, cos) = self.sine_and_cosine(r).filter(|_| r.is_finite())?;
        if r == 0.0 {
            return Some(Vec3::z());
        }
        Some(Vec3::new(m.x / r * sin, m.y / r * sin, cos))
    }

    fn max_angle(&self) -> f64 {
        self.limit()
    }
}

/// The five classical projections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Radial {
    /// `r = tan θ`: straight lines stay straight.
    Rectilinear,
    /// `r = θ`.
    Equidistant,
    /// `r = 2 sin(θ/2)`: equal solid angles get equal areas.
    Equisolid,
    /// `r = 2 tan(θ/2)`: shapes of small things stay.
    Stereographic,
    /// `r = sin θ`.
    Orthographic,
}

impl RadialModel for Radial {
    fn radius(&self, theta: f64) -> (f64, f64) {
        let half = 0.5 * theta;
        match self {
            Self::Rectilinear => (theta.tan(), theta.cos().powi(-2)),
            Self::Equidistant => (theta, 1.0),
            Self::Equisolid => (2.0 * half.sin(), half.cos()),
            Self::Stereographic => (2.0 * half.tan(), half.cos().powi(-2)),
            Self::Orthographic => theta.sin_cos(),
        }
    }

    fn angle(&self, r: f64) -> Option<f64> {
        let theta = match self {
            Self::Rectilinear => r.atan(),
            Self::Equidistant => r,
            Self::Equisolid => 2.0 * (0.5 * r).asin(),
            Self::Stereographic => 2.0 * (0.5 * r).atan(),
            Self::Orthographic => r.asin(),
        };
        (theta < self.limit()).then_some(theta)
    }

    /// Of those that every point of a map goes through, in closed form: four times as fast as the angle and its sine.
    fn sine_and_cosine(&self, r: f64) -> Option<(f64, f64)> {
        match self {
            Self::Rectilinear if r < 1e6 => {
                let cos = (1.0 + r * r).sqrt().recip();
                Some((r * cos, cos))
            }
            Self::Stereographic if r < 1e6 => {
                let (square, scale) = (0.25 * r * r, (1.0 + 0.25 * r * r).recip());
                Some((r * scale, (1.0 - square) * scale))
            }
            _ => self.angle(r).map(f64::sin_cos),
        }
    }

    fn limit(&self) -> f64 {
        match self {
            Self::Rectilinear | Self::Orthographic => FRAC_PI_2,
            Self::Equidistant | Self::Equisolid | Self::Stereographic => PI,
        }
    }

    fn stretch(&self, rho: f64, z: f64) -> Option<f64> {
        let d = (rho * rho + z * z).sqrt();
        // d + z without cancellation behind the camera; 0 straight behind.
        let sum = || if z > 0.0 { d + z } else { rho * rho / (d - z) };
        let stretch = match self {
            Self::Rectilinear if z > 0.0 => 1.0 / z,
            Self::Orthographic if z > 0.0 => 1.0 / d,
            Self::Rectilinear | Self::Orthographic => return None,
            Self::Equidistant if rho > 0.0 => rho.atan2(z) / rho,
            Self::Equidistant => 1.0 / z,
            Self::Equisolid => (2.0 / (d * sum())).sqrt(),
            Self::Stereographic => 2.0 / sum(),
        };
        (stretch.is_finite() && stretch > 0.0).then_some(stretch)
    }
}
