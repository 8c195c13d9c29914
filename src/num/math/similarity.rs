//! Similarities of the plane: rotation, uniform scale and translation.

use super::{Homography, Point2, Vec2};

/// `x ↦ [a −b; b a] x + t`: four parameters, linear in all of them. `a + ib` is the complex factor `s·e^{iθ}`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Similarity2 {
    /// `s·cos θ`, dimensionless.
    pub a: f64,
    /// `s·sin θ`, dimensionless; positive θ turns +x towards +y (clockwise on a screen, since y is down).
    pub b: f64,
    /// Translation, px.
    pub t: Vec2,
}

impl Similarity2 {
    /// The map that leaves every point where it is.
    pub const IDENTITY: Self = Self { a: 1.0, b: 0.0, t: Vec2::new(0.0, 0.0) };

    /// Rotation by `angle_rad` and scaling by `scale` about `center`, then a move by `shift` px.
    pub fn about(center: Point2, angle_rad: f64, scale: f64, shift: Vec2) -> Self {
        let (sin, cos) = angle_rad.sin_cos();
        let linear = Self { a: scale * cos, b: scale * sin, t: Vec2::zeros() };
        Self { t: center.coords - linear.apply(center).coords + shift, ..linear }
    }

    /// Image of `p`.
    pub fn apply(&self, p: Point2) -> Point2 {
        Point2::new(self.a * p.x - self.b * p.y + self.t.x, self.b * p.x + self.a * p.y + self.t.y)
    }

    /// Uniform scale factor, > 0 for an invertible similarity.
    pub fn scale(&self) -> f64 {
        self.a.hypot(self.b)
    }

    /// Rotation angle in (−π, π], rad.
    pub fn angle(&self) -> f64 {
        self.b.atan2(self.a)
    }

    /// The inverse map; `None` where the scale is zero or not finite.
    pub fn inverse(&self) -> Option<Self> {
        let d = self.a * self.a + self.b * self.b;
        if !(d > 0.0 && d.is_finite()) {
            return None;
        }
        let linear = Self { a: self.a / d, b: -self.b / d, t: Vec2::zeros() };
        let t = -linear.apply(Point2::from(self.t)).coords;
        Some(Self { t, ..linear })
    }

    /// The same map as a 3×3 matrix.
    pub fn to_homography(self) -> Homography {
        #[rustfmt::skip]
        let m = nalgebra::Matrix3::new(
            self.a, -self.b, self.t.x,
            self.b,  self.a, self.t.y,
            0.0,     0.0,    1.0,
        );
        Homography::new(m)
    }
}

/// `f * g` first applies `g`, then `f`.
impl std::ops::Mul for Similarity2 {
    type Output = Self;

    fn mul(self, g: Self) -> Self {
        Self { a: self.a * g.a - self.b * g.b, b: self.a * g.b + self.b * g.a, t: self.apply(Point2::from(g.t)).coords }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Similarity2 {
        Similarity2::about(Point2::new(320.0, 180.0), 0.3, 1.2, Vec2::new(5.0, -7.0))
    }

    #[test]
    fn composition_applies_the_right_factor_first() {
        let (f, g) = (sample(), Similarity2 { a: 0.9, b: -0.2, t: Vec2::new(1.0, 2.0) });
        let p = Point2::new(17.0, -4.0);
        assert!(((f * g).apply(p) - f.apply(g.apply(p))).norm() < 1e-11);
    }

    #[test]
    fn the_inverse_undoes_the_map() {
        let p = Point2::new(100.0, 33.0);
        let back = sample().inverse().expect("scale is 1.2").apply(sample().apply(p));
        assert!((back - p).norm() < 1e-11);
        assert!(Similarity2 { a: 0.0, b: 0.0, t: Vec2::zeros() }.inverse().is_none());
    }

    #[test]
    fn the_matrix_is_the_same_map() {
        let p = Point2::new(100.0, 33.0);
        let q = sample().to_homography().apply(p).expect("affine maps are defined everywhere");
        assert!((q - sample().apply(p)).norm() < 1e-11);
    }

    #[test]
    fn about_turns_and_scales_around_its_center() {
        let c = Point2::new(320.0, 180.0);
        assert!((sample().apply(c) - (c + Vec2::new(5.0, -7.0))).norm() < 1e-11);
        assert!((sample().scale() - 1.2).abs() < 1e-15);
        assert!((sample().angle() - 0.3).abs() < 1e-15);
    }
}
