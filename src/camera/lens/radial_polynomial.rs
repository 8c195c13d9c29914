//! A classical projection whose radius is bent by a polynomial: ptlens, poly3 and poly5 of panorama programs.
//!
//! ```text
//! ρ = r_base(θ)/u,    r = u ρ (c₀ + c₁ ρ + c₂ ρ² + c₃ ρ³ + c₄ ρ⁴)
//!
//! ptlens a b c    c = (1 − a − b − c, c, b, a, 0)
//! poly3 k₁        c = (1 − k₁, 0, k₁, 0, 0)
//! poly5 k₁ k₂     c = (1, 0, k₁, 0, k₂)
//! ```
//!
//! The unit `u` is, in focal lengths, half the short side of the picture on which the lens was measured.
//!
//! # Reference
//! H. Dersch, *Panorama tools*, "correct" (`ρ → a ρ⁴ + b ρ³ + c ρ² + (1 − a − b − c) ρ`); lensfun, *The lensfun database and
//! file format*, `<distortion>`.

use super::radial::{Radial, RadialModel};
use super::{LensError, MAX_PLANE_RADIUS, Projection, invert, polynomial};

/// A classical projection with a polynomial of its radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialPolynomial {
    base: Radial,
    unit: f64,
    c: [f64; 5],
    /// Largest `ρ`.
    farthest: f64,
    limit: f64,
}

impl RadialPolynomial {
    /// The lens with coefficients `c₀ … c₄` of `ρ`, which is measured in `unit` focal lengths.
    ///
    /// # Errors
    /// [`LensError::Parameter`] for a base that is not classical (rectilinear, equidistant, equisolid, stereographic or
    /// orthographic), a unit that is not above 0, or a `c₀` that is not.
    pub fn new(base: &Projection, unit: f64, c: [f64; 5]) -> Result<Self, LensError> {
        let refused = |name, value, expected| Err(LensError::Parameter { name, value, expected });
        let Some(base) = base.classical() else {
            return refused("the base projection", f64::NAN, "a classical one, such as rectilinear");
        };
        if !(unit > 0.0 && unit.is_finite()) {
            return refused("the unit of the radius", unit, "a number above 0");
        }
        if !(c[0] > 0.0 && c.iter().all(|c| c.is_finite())) {
            return refused("the linear coefficient", c[0], "above 0, all coefficients finite");
        }
        let slope: [f64; 5] = std::array::from_fn(|i| (i + 1) as f64 * c[i]);
        let edge = match base {
            Radial::Rectilinear | Radial::Stereographic => MAX_PLANE_RADIUS,
            _ => base.radius(base.limit()).0,
        };
        let farthest = polynomial::positive_up_to(&slope, edge / unit);
        let limit = base.angle(farthest * unit).unwrap_or(base.limit());
        Ok(Self { base, unit, c, farthest, limit })
    }

    /// The base projection, the unit and `c₀ … c₄`.
    pub fn parameters(&self) -> (Projection, f64, [f64; 5]) {
        (self.base.into(), self.unit, self.c)
    }
}

impl RadialModel for RadialPolynomial {
    fn radius(&self, theta: f64) -> (f64, f64) {
        let (r, slope) = self.base.radius(theta);
        let rho = r / self.unit;
        let (value, value_slope) = polynomial::value_and_slope(&self.c, rho);
        (r * value, slope * (value + rho * value_slope))
    }

    fn angle(&self, r: f64) -> Option<f64> {
        let bent = |rho: f64| {
            let (value, slope) = polynomial::value_and_slope(&self.c, rho);
            (rho * value, value + rho * slope)
        };
        let wanted = r / self.unit;
        let rho = invert::increasing(wanted, self.farthest, wanted / self.c[0], bent)?;
        self.base.angle(rho * self.unit).filter(|theta| *theta < self.limit)
    }

    fn limit(&self) -> f64 {
        self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ptlens_keeps_the_radius_of_its_unit() {
        let (a, b, c) = (0.01, -0.03, 0.005);
        let unit = 0.6;
        let lens =
            RadialPolynomial::new(&Projection::Rectilinear, unit, [1.0 - a - b - c, c, b, a, 0.0]).expect("valid");
        assert!((lens.radius(unit.atan()).0 - unit).abs() < 1e-15);
    }

    #[test]
    fn the_field_ends_at_the_extremum_of_the_polynomial() {
        // d(ρ − 0.1 ρ³) = 0 at ρ = √(1/0.3).
        let lens = RadialPolynomial::new(&Projection::Rectilinear, 0.5, [1.0, 0.0, -0.1, 0.0, 0.0]).expect("valid");
        assert!((lens.limit() - (0.5 * (1.0_f64 / 0.3).sqrt()).atan()).abs() < 1e-12);
        let whole = RadialPolynomial::new(&Projection::Equisolid, 0.5, [1.0, 0.0, 0.0, 0.0, 0.0]).expect("valid");
        assert!((whole.limit() - std::f64::consts::PI).abs() < 1e-7, "{}", whole.limit());
    }

    #[test]
    fn parameters_without_a_field_are_refused() {
        let new = |p, unit, c0| RadialPolynomial::new(&p, unit, [c0, 0.0, 0.0, 0.0, 0.0]);
        assert!(new(Projection::Mercator, 1.0, 1.0).is_err());
        assert!(new(Projection::Rectilinear, 0.0, 1.0).is_err());
        assert!(new(Projection::Rectilinear, 1.0, -0.1).is_err());
        assert!(new(Projection::Rectilinear, 1.0, f64::NAN).is_err());
    }
}
