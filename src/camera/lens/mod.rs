//! Lenses: which direction a pixel looks in, and where a direction is seen.
//!
//! ```text
//! p = c + (f_x m_x, f_y m_y),      m = projection(ray)
//! ```
//!
//! A [`Projection`] maps directions to a plane of unit focal length (on the axis `m ≈ (x, y)/z`); focal lengths and the
//! center give pixels. A direction need not be of unit length. Directions outside a lens's field, or where its formula
//! is not invertible, have no image: formulas are inverted only on the branch that leads from the axis to the first
//! angle at which the image turns back, [`Lens::max_angle`]. NaN and infinities have no image and no direction.

mod brown_conrady;
mod division;
mod error;
mod field_of_view;
mod invert;
mod kannala_brandt;
mod ocam;
mod panoramic;
mod polynomial;
mod projection;
mod radial;
mod radial_polynomial;
#[cfg(test)]
pub(super) mod tests;
mod unified;

use nalgebra::{Matrix2, Matrix2x3};

pub use brown_conrady::{BrownConrady, DistortedPlane, DistortionTerms};
pub use error::LensError;
pub use field_of_view::{FieldAxis, FieldOfView};
pub use kannala_brandt::{AnglePolynomial, KannalaBrandt};
pub use ocam::Ocam;
pub use projection::Projection;
pub use radial_polynomial::RadialPolynomial;
pub use unified::Unified;

use super::Vec3;
use plumbline_num::math::{Point2, Vec2};

/// Difference below which aspect ratios are equal: scaled pictures round their sides, video sides to multiples of 8.
const SAME_ASPECT: f64 = 0.005;

/// Radius up to which an unbounded plane is searched, focal lengths: 89.99° off the axis.
const MAX_PLANE_RADIUS: f64 = 1e4;

/// A projection with its scale: the map between directions in space and pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// From directions to the plane of unit focal length.
    pub projection: Projection,
    /// `(f_x, f_y)`, px.
    pub focal: Vec2,
    /// Pixel on the axis; pixel centers at integer + 0.5.
    pub center: Point2,
    /// Width and height of the picture that the lens is for, px.
    pub size: (f64, f64),
}

/// Directions to a plane, and back.
trait PlaneModel {
    /// Image of a direction that is finite and not zero.
    fn plane(&self, ray: &Vec3) -> Option<Vec2>;

    /// Image of a direction and its derivative by the direction.
    fn plane_with_jacobian(&self, ray: &Vec3) -> Option<(Vec2, Matrix2x3<f64>)>;

    /// The unit direction that is seen at a finite point of the plane.
    fn ray(&self, m: Vec2) -> Option<Vec3>;

    /// Limit of the field, rad off the axis.
    fn max_angle(&self) -> f64;
}

impl Lens {
    /// The pixel at which a direction is seen; `None` outside the field.
    pub fn project(&self, ray: &Vec3) -> Option<Point2> {
        let (ray, _) = direction(ray)?;
        self.pixel(self.projection.with(|m| m.plane(&ray))?)
    }

    /// The pixel at which a direction is seen and `∂(u, v)/∂(x, y, z)`, px; `None` outside the field and where there is no
    /// derivative (the poles of panoramas).
    pub fn project_with_jacobian(&self, ray: &Vec3) -> Option<(Point2, Matrix2x3<f64>)> {
        let (ray, scale) = direction(ray)?;
        let (m, jacobian) = self.projection.with(|m| m.plane_with_jacobian(&ray))?;
        Some((self.pixel(m)?, Matrix2::from_diagonal(&(scale * self.focal)) * jacobian))
    }

    /// The unit vector in which a pixel looks; `None` outside the image of the field.
    pub fn unproject(&self, p: Point2) -> Option<Vec3> {
        let m = (p - self.center).component_div(&self.focal);
        if !(m.x.is_finite() && m.y.is_finite()) {
            return None;
        }
        self.projection.with(|model| model.ray(m))
    }

    /// The angle off the axis, rad, up to which (exclusively) all directions have an image. Lenses show nothing beyond it;
    /// panoramas, whose field is no cone, do.
    pub fn max_angle(&self) -> f64 {
        self.projection.with(|m| m.max_angle())
    }

    /// The angle off the axis, rad, to which the picture's farthest corner looks, or the limit of the field where corners see
    /// nothing.
    pub fn corner_angle(&self) -> f64 {
        let (w, h) = self.size;
        let corners = [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| self.unproject(Point2::new(x, y)));
        let angle = |ray: Option<Vec3>| ray.map_or(self.max_angle(), |r| r.x.hypot(r.y).atan2(r.z));
        corners.map(angle).into_iter().fold(0.0, f64::max)
    }

    /// The same lens for the picture scaled to `size`.
    ///
    /// # Errors
    /// [`LensError::Size`] for a size that is none, [`LensError::Aspect`] for a picture of another shape.
    pub fn resized(&self, size: (f64, f64)) -> Result<Self, LensError> {
        let valid = |s: f64| s > 0.0 && s.is_finite();
        if !(valid(size.0) && valid(size.1)) {
            return Err(LensError::Size(size.0, size.1));
        }
        if !same_shape(self.size, size) {
            return Err(LensError::Aspect { lens: self.size, picture: size });
        }
        let scale = Vec2::new(size.0 / self.size.0, size.1 / self.size.1);
        Ok(Self {
            projection: self.projection.clone(),
            focal: self.focal.component_mul(&scale),
            center: Point2::from(self.center.coords.component_mul(&scale)),
            size,
        })
    }

    /// The pixel of a point of the plane.
    fn pixel(&self, m: Vec2) -> Option<Point2> {
        let p = self.center + self.focal.component_mul(&m);
        (p.x.is_finite() && p.y.is_finite()).then_some(p)
    }
}

/// The direction with a length whose square is a number, and the factor that led there; `None` where it is not finite or zero.
fn direction(ray: &Vec3) -> Option<(Vec3, f64)> {
    const ORDINARY: std::ops::Range<f64> = 1e-100..1e100;
    let size = ray.amax();
    if !(size > 0.0 && ray.iter().all(|v| v.is_finite())) {
        return None;
    }
    let scale = if ORDINARY.contains(&size) { 1.0 } else { size.recip() };
    Some((scale * ray, scale)).filter(|_| scale.is_finite())
}

/// Whether a picture of size `a` can be one of size `b` scaled, sides rounded to pixels.
fn same_shape(a: (f64, f64), b: (f64, f64)) -> bool {
    let off = a.0 * b.1 / (a.1 * b.0) - 1.0;
    // Each side of the smaller picture may be off by half a pixel.
    off.abs() <= SAME_ASPECT.max(0.5 / a.0.min(b.0) + 0.5 / a.1.min(b.1))
}
