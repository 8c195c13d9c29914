//! Panoramas: projections onto cylinders about the vertical axis, and the plate carrée.
//!
//! ```text
//! λ = atan2(x, z),   t = y / √(x² + z²) = tan φ          (φ grows downwards, as y does)
//!
//! equirectangular   m = (λ, φ)
//! cylindrical       m = (λ, t)
//! Mercator          m = (λ, asinh t)
//! Panini d          m = S (sin λ, t),   S = (d + 1)/(d + cos λ)
//! ```
//!
//! Panini with `d = 0` is rectilinear, with `d = 1` the classical one, with `d → ∞` the cylindrical orthographic. It turns
//! back at `cos λ = −1/d` for `d > 1`, and is unbounded towards `cos λ = −d` for `d ≤ 1`.
//!
//! # Reference
//! J. P. Snyder, *Map projections – a working manual*, USGS 1395, 1987. T. K. Sharpless, B. Postle, D. M. German, *Pannini:
//! a new projection for rendering wide angle perspective images*, CAe 2010, section 3.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix2x3, RowVector3};

use super::PlaneModel;
use crate::Vec3;
use plumbline_num::math::Vec2;

/// A projection by longitude and latitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Panoramic {
    Equirectangular,
    Cylindrical,
    Mercator,
    Panini(f64),
}

/// The longitude at and beyond which Panini's projection shows nothing; 0 for a `d` that is no distance.
pub(super) fn panini_limit(d: f64) -> f64 {
    if !(d >= 0.0 && d.is_finite()) {
        return 0.0;
    }
    if d > 1.0 { (-1.0 / d).acos() } else { (-d).acos() }
}

impl Panoramic {
    /// Largest longitude; itself shown only by the panoramas proper.
    pub(super) fn longitude_limit(self) -> f64 {
        match self {
            Self::Panini(d) => panini_limit(d),
            _ => PI,
        }
    }

    /// `λ` seen at `m.x`.
    fn longitude(self, x: f64) -> Option<f64> {
        let Self::Panini(d) = self else { return (x.abs() <= PI).then_some(x) };
        // sin λ = (x/(d+1)) (d + cos λ), squared: a quadratic of cos λ whose larger root is on the branch.
        let k = (x / (d + 1.0)).powi(2);
        let under = 1.0 + k * (1.0 - d * d);
        if !(under >= 0.0) {
            return None;
        }
        let cos = (under.sqrt() - k * d) / (k + 1.0);
        let longitude = (x / (d + 1.0) * (d + cos)).atan2(cos);
        (longitude.abs() < panini_limit(d)).then_some(longitude)
    }
}

impl PlaneModel for Panoramic {
    fn plane(&self, ray: &Vec3) -> Option<Vec2> {
        let h = ray.x.hypot(ray.z);
        let longitude = ray.x.atan2(ray.z);
        let t = ray.y / h;
        let m = match self {
            Self::Equirectangular => Vec2::new(longitude, ray.y.atan2(h)),
            Self::Cylindrical => Vec2::new(longitude, t),
            Self::Mercator => Vec2::new(longitude, t.asinh()),
            Self::Panini(d) => {
                if !(longitude.abs() < panini_limit(*d)) {
                    return None;
                }
                let (sin, cos) = (ray.x / h, ray.z / h);
                (d + 1.0) / (d + cos) * Vec2::new(sin, t)
            }
        };
        (m.x.is_finite() && m.y.is_finite()).then_some(m)
    }

    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)> {
        let m = self.plane(ray)?;
        let h = ray.x.hypot(ray.z);
        if !(h > 0.0) {
            return None; // the poles
        }
        let (sin, cos, t) = (ray.x / h, ray.z / h, ray.y / h);
        let longitude = RowVector3::new(cos, 0.0, -sin) / h;
        let tangent = RowVector3::new(-t * sin, 1.0, -t * cos) / h;
        let rows = match self {
            Self::Equirectangular => [longitude, tangent / (1.0 + t * t)],
            Self::Cylindrical => [longitude, tangent],
            Self::Mercator => [longitude, tangent / (1.0 + t * t).sqrt()],
            Self::Panini(d) => {
                let (s, w) = ((d + 1.0) / (d + cos), d + cos);
                // dS/dλ = S sin λ / (d + cos λ).
                [(s * (cos + sin * sin / w)) * longitude, (s * sin / w * t) * longitude + s * tangent]
            }
        };
        Some((m, Matrix2x3::from_rows(&rows)))
    }

    fn ray(&self, m: Vec2) -> Option<Vec3> {
        let longitude = self.longitude(m.x)?;
        let (sin, cos) = longitude.sin_cos();
        let t = match self {
            Self::Equirectangular => {
                let (up, level) = m.y.sin_cos();
                return (m.y.abs() <= FRAC_PI_2).then(|| Vec3::new(level * sin, up, level * cos));
            }
            Self::Cylindrical => m.y,
            Self::Mercator => m.y.sinh(),
            Self::Panini(d) => m.y * (d + cos) / (d + 1.0),
        };
        let ray = Vec3::new(sin, t, cos) / t.hypot(1.0);
        ray.iter().all(|v| v.is_finite()).then_some(ray)
    }

    fn max_angle(&self) -> f64 {
        match self {
            Self::Equirectangular => PI,
            Self::Cylindrical | Self::Mercator => FRAC_PI_2,
            Self::Panini(d) => panini_limit(*d).min(FRAC_PI_2),
        }
    }
}
