//! The pinhole camera with one radial term.
//!
//! ```text
//! (x, y) = X_xy / X_z,   ρ = x² + y²,   d = 1 + k₁ ρ,   u = f d x + c_x,   v = f d y + c_y
//! ```

use nalgebra::Matrix2;

use super::{Point3, Vec3};
use plumbline_num::math::{Point2, Vec2};

/// Maximum number of Newton iterations in [`Intrinsics::undistorted`]: they converge quadratically from a close initial
/// guess.
const NEWTON_STEPS: usize = 20;

/// How a camera maps directions to pixels; square pixels, center of projection given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// `f`, px.
    pub focal: f64,
    /// `(c_x, c_y)`, px.
    pub center: Point2,
    /// `k₁`, dimensionless; negative for barrel distortion.
    pub k1: f64,
}

impl Intrinsics {
    /// A distortion-free camera of `width × height` px that looks through the middle of its picture.
    pub fn centered(focal: f64, width: u32, height: u32) -> Self {
        Self { focal, center: Point2::new(f64::from(width) / 2.0, f64::from(height) / 2.0), k1: 0.0 }
    }

    /// Pixel at which a point is seen; `None` behind the camera or in its plane.
    pub fn project(&self, x_in_camera: &Point3) -> Option<Point2> {
        (x_in_camera.z > 0.0).then(|| self.distorted(Vec2::new(x_in_camera.x, x_in_camera.y) / x_in_camera.z))
    }

    /// Pixel of the normalized image point `(x, y)`.
    pub fn distorted(&self, xy: Vec2) -> Point2 {
        self.center + self.focal * (1.0 + self.k1 * xy.norm_squared()) * xy
    }

    /// `∂(u, v)/∂(x, y)` at a normalized image point.
    pub fn jacobian(&self, xy: Vec2) -> Matrix2<f64> {
        let d = 1.0 + self.k1 * xy.norm_squared();
        self.focal * (d * Matrix2::identity() + 2.0 * self.k1 * xy * xy.transpose())
    }

    /// The normalized image point `(x, y)` seen at a pixel; `None` beyond the radius at which the lens folds over.
    pub fn undistorted(&self, pixel: Point2) -> Option<Vec2> {
        let target = (pixel - self.center) / self.focal;
        let wanted = target.norm();
        if self.k1 == 0.0 || wanted == 0.0 {
            return Some(target);
        }
        // r (1 + k₁ r²) = wanted, on the branch that starts at the center.
        let mut r = wanted;
        for _ in 0..NEWTON_STEPS {
            let slope = 1.0 + 3.0 * self.k1 * r * r;
            if !(slope > 0.0) {
                r *= 0.5;
                continue;
            }
            r -= (r * (1.0 + self.k1 * r * r) - wanted) / slope;
        }
        let miss = (r * (1.0 + self.k1 * r * r) - wanted).abs();
        (miss <= 1e-12 * wanted.max(1.0) && r > 0.0 && 1.0 + 3.0 * self.k1 * r * r > 0.0).then(|| target * (r / wanted))
    }

    /// Direction (not normalized, `z = 1`) in which a pixel looks; `None` as for [`Self::undistorted`].
    pub fn ray(&self, pixel: Point2) -> Option<Vec3> {
        self.undistorted(pixel).map(|xy| Vec3::new(xy.x, xy.y, 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn barrel() -> Intrinsics {
        Intrinsics { k1: -0.08, ..Intrinsics::centered(576.0, 640, 360) }
    }

    #[test]
    fn the_ray_of_a_projection_meets_the_point() {
        for camera in [barrel(), Intrinsics { k1: 0.2, ..barrel() }, Intrinsics { k1: 0.0, ..barrel() }] {
            let x = Point3::new(1.1, -0.6, 2.0);
            let ray = camera.ray(camera.project(&x).expect("in front")).expect("inside the lens");
            assert!((ray * x.z - x.coords).norm() < 1e-12, "{camera:?}");
        }
    }

    #[test]
    fn barrel_distortion_draws_points_towards_the_center() {
        let x = Point3::new(1.0, 0.0, 2.0);
        let plain = Intrinsics { k1: 0.0, ..barrel() };
        let (bent, straight) = (barrel().project(&x).expect("in front"), plain.project(&x).expect("in front"));
        assert!(bent.x < straight.x && bent.x > plain.center.x);
    }

    #[test]
    fn the_jacobian_agrees_with_central_differences() {
        let (camera, xy, h) = (barrel(), Vec2::new(0.4, -0.3), 1e-6);
        for (k, step) in [Vec2::new(h, 0.0), Vec2::new(0.0, h)].into_iter().enumerate() {
            let slope = (camera.distorted(xy + step) - camera.distorted(xy - step)) / (2.0 * h);
            assert!((slope - camera.jacobian(xy).column(k)).norm() < 1e-6);
        }
    }

    #[test]
    fn nothing_is_seen_behind_the_camera_or_beyond_the_fold() {
        assert!(barrel().project(&Point3::new(0.0, 0.0, -1.0)).is_none());
        let folds = Intrinsics { k1: -0.3, ..barrel() };
        assert!(folds.undistorted(Point2::new(320.0 + 576.0 * 0.9, 180.0)).is_none());
    }
}
