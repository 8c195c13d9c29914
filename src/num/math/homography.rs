//! Projective maps of the plane.

use nalgebra::{Matrix2, Matrix3, Vector3};

use super::{Point2, PointMap};

/// `x ↦ H x̃` in homogeneous coordinates, normalised so that `h₃₃ = 1` whenever it is not zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homography {
    m: Matrix3<f64>,
}

impl Homography {
    /// Wraps a 3×3 matrix; its scale is free.
    pub fn new(m: Matrix3<f64>) -> Self {
        let s = m[(2, 2)];
        Self { m: if s != 0.0 && s.is_finite() { m / s } else { m } }
    }

    /// The map that leaves every point where it is.
    pub fn identity() -> Self {
        Self { m: Matrix3::identity() }
    }

    /// The 3×3 matrix, `h₃₃ = 1` unless it vanishes.
    pub fn matrix(&self) -> &Matrix3<f64> {
        &self.m
    }

    /// Image of `p`; `None` on or beyond the line at infinity (denominator not positive).
    pub fn apply(&self, p: Point2) -> Option<Point2> {
        let q = self.m * Vector3::new(p.x, p.y, 1.0);
        (q.z > 0.0).then(|| Point2::new(q.x / q.z, q.y / q.z))
    }

    /// The inverse map; `None` for a singular matrix.
    pub fn inverse(&self) -> Option<Self> {
        self.m.try_inverse().map(Self::new)
    }

    /// True where every entry is finite.
    pub fn is_finite(&self) -> bool {
        self.m.iter().all(|v| v.is_finite())
    }
}

/// `f * g` first applies `g`, then `f`.
impl std::ops::Mul for Homography {
    type Output = Self;

    fn mul(self, g: Self) -> Self {
        Self::new(self.m * g.m)
    }
}

impl PointMap for Homography {
    fn map(&self, p: Point2) -> Option<Point2> {
        self.apply(p)
    }

    fn jacobian(&self, p: Point2) -> Option<Matrix2<f64>> {
        let q = self.apply(p)?;
        let m = &self.m;
        let w = m[(2, 0)] * p.x + m[(2, 1)] * p.y + m[(2, 2)];
        #[rustfmt::skip]
        let j = Matrix2::new(
            m[(0, 0)] - q.x * m[(2, 0)], m[(0, 1)] - q.x * m[(2, 1)],
            m[(1, 0)] - q.y * m[(2, 0)], m[(1, 1)] - q.y * m[(2, 1)],
        );
        Some(j / w)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Vec2;

    fn sample() -> Homography {
        Homography::new(Matrix3::new(1.1, 0.02, 5.0, -0.03, 0.95, -8.0, 1e-4, -2e-4, 1.0))
    }

    #[test]
    fn the_inverse_undoes_the_map() {
        let p = Point2::new(250.0, 120.0);
        let q = sample().apply(p).expect("in front");
        let back = sample().inverse().expect("regular").apply(q).expect("in front");
        assert!((back - p).norm() < 1e-9);
    }

    #[test]
    fn the_jacobian_equals_central_differences() {
        let (p, h) = (Point2::new(250.0, 120.0), 1e-4);
        let j = sample().jacobian(p).expect("in front");
        let at = |d: Vec2| sample().apply(p + d).expect("in front");
        for (k, d) in [Vec2::new(h, 0.0), Vec2::new(0.0, h)].into_iter().enumerate() {
            let numeric = (at(d) - at(-d)) / (2.0 * h);
            assert!((j.column(k) - numeric).norm() < 1e-8, "column {k}: {} against {numeric}", j.column(k));
        }
    }

    #[test]
    fn points_beyond_the_horizon_have_no_image() {
        let h = Homography::new(Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.01, 0.0, 1.0));
        assert!(h.apply(Point2::new(99.0, 0.0)).is_some());
        assert!(h.apply(Point2::new(101.0, 0.0)).is_none());
    }
}
