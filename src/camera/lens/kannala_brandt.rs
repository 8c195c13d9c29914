//! Fisheye lenses with a polynomial of the angle.
//!
//! ```text
//! Kannala–Brandt   r = θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸)
//! all powers       r = θ (1 + a₁ θ + a₂ θ² + a₃ θ³)               (WoodScape, divided by its first coefficient)
//! ```
//!
//! Such a polynomial is a fit: beyond the angles that were measured it may turn back. What is seen ends where `dr/dθ` first
//! is no longer positive, and at 180° at the latest.
//!
//! # Reference
//! J. Kannala, S. S. Brandt, *A generic camera model and calibration method for conventional, wide-angle, and fish-eye
//! lenses*, IEEE TPAMI 28(8), 2006, eq. 6. S. Yogamani et al., *WoodScape*, ICCV 2019, section 3.

use std::f64::consts::PI;

use super::radial::RadialModel;
use super::{invert, polynomial};

/// `r = θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸)`: OpenCV's `fisheye`, Kalibr's `equidistant`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KannalaBrandt {
    k: [f64; 4],
    limit: f64,
}

impl KannalaBrandt {
    /// The lens with coefficients `k₁ … k₄`, dimensionless.
    pub fn new(k: [f64; 4]) -> Self {
        // dr/dθ as a polynomial of s = θ².
        let slope = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]];
        Self { k, limit: polynomial::positive_up_to(&slope, PI * PI).sqrt().min(PI) }
    }

    /// `k₁ … k₄`.
    pub fn coefficients(&self) -> [f64; 4] {
        self.k
    }
}

impl RadialModel for KannalaBrandt {
    #[inline]
    fn radius(&self, theta: f64) -> (f64, f64) {
        let [a, b, c, d] = self.k;
        let s = theta * theta;
        let r = 1.0 + s * (a + s * (b + s * (c + s * d)));
        let slope = 1.0 + s * (3.0 * a + s * (5.0 * b + s * (7.0 * c + s * 9.0 * d)));
        (theta * r, slope)
    }

    fn angle(&self, r: f64) -> Option<f64> {
        invert::increasing(r, self.limit, r, |theta| self.radius(theta)).filter(|theta| *theta < self.limit)
    }

    fn limit(&self) -> f64 {
        self.limit
    }
}

/// `r = θ (1 + a₁ θ + a₂ θ² + a₃ θ³)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnglePolynomial {
    /// `1, a₁, a₂, a₃`.
    c: [f64; 4],
    limit: f64,
}

impl AnglePolynomial {
    /// The lens with coefficients `a₁ a₂ a₃`, dimensionless.
    pub fn new(a: [f64; 3]) -> Self {
        let slope = [1.0, 2.0 * a[0], 3.0 * a[1], 4.0 * a[2]];
        Self { c: [1.0, a[0], a[1], a[2]], limit: polynomial::positive_up_to(&slope, PI) }
    }

    /// `a₁ a₂ a₃`.
    pub fn coefficients(&self) -> [f64; 3] {
        [self.c[1], self.c[2], self.c[3]]
    }
}

impl RadialModel for AnglePolynomial {
    #[inline]
    fn radius(&self, theta: f64) -> (f64, f64) {
        let (value, slope) = polynomial::value_and_slope(&self.c, theta);
        (theta * value, value + theta * slope)
    }

    fn angle(&self, r: f64) -> Option<f64> {
        invert::increasing(r, self.limit, r, |theta| self.radius(theta)).filter(|theta| *theta < self.limit)
    }

    fn limit(&self) -> f64 {
        self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_field_ends_where_the_radius_stops_growing() {
        for k in [[-0.1, 0.0, 0.0, 0.0], [0.0, -0.02, 0.0, 0.0], [0.01, 0.02, -0.03, 0.0], [0.02, 0.01, 0.01, -0.006]] {
            let lens = KannalaBrandt::new(k);
            assert!(lens.limit() < PI && lens.radius(lens.limit()).1.abs() < 1e-9, "{k:?} {}", lens.limit());
        }
        for a in [[-0.2, 0.0, 0.0], [0.1, -0.15, 0.0], [0.1, 0.05, -0.04]] {
            let lens = AnglePolynomial::new(a);
            assert!(lens.limit() < PI && lens.radius(lens.limit()).1.abs() < 1e-9, "{a:?} {}", lens.limit());
        }
    }
}
