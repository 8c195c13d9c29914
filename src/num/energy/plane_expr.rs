//! Points of the plane whose coordinates are scalar unknowns, for terms that mix x with y.

use std::ops::{Add, Mul, Neg, Sub};

use super::Expr;
use crate::math::Vec2;

/// A pair of scalar expressions; see [`super::LeastSquares::point`].
#[derive(Clone, Debug, PartialEq)]
pub struct PlaneExpr {
    /// First coordinate.
    pub x: Expr<1>,
    /// Second coordinate.
    pub y: Expr<1>,
}

impl PlaneExpr {
    /// `R₉₀ p` with `R₉₀ = [0 1; −1 0]`: a quarter turn from +y towards +x.
    #[must_use]
    pub fn r90(self) -> Self {
        Self { x: self.y, y: -self.x }
    }

    /// `p · n`.
    pub fn dot(self, n: Vec2) -> Expr<1> {
        self.x * n.x + self.y * n.y
    }
}

impl From<Vec2> for PlaneExpr {
    fn from(k: Vec2) -> Self {
        Self { x: k.x.into(), y: k.y.into() }
    }
}

impl<R: Into<Self>> Add<R> for PlaneExpr {
    type Output = Self;

    fn add(self, other: R) -> Self {
        let other = other.into();
        Self { x: self.x + other.x, y: self.y + other.y }
    }
}

impl<R: Into<Self>> Sub<R> for PlaneExpr {
    type Output = Self;

    fn sub(self, other: R) -> Self {
        let other = other.into();
        Self { x: self.x - other.x, y: self.y - other.y }
    }
}

impl Neg for PlaneExpr {
    type Output = Self;

    fn neg(self) -> Self {
        self * -1.0
    }
}

impl Mul<f64> for PlaneExpr {
    type Output = Self;

    fn mul(self, s: f64) -> Self {
        Self { x: self.x * s, y: self.y * s }
    }
}

impl Mul<PlaneExpr> for f64 {
    type Output = PlaneExpr;

    fn mul(self, e: PlaneExpr) -> PlaneExpr {
        e * self
    }
}
