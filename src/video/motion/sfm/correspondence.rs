//! Correspondence of image points in two views.

use nalgebra::{Matrix3, SVector};

use plumbline_camera::Vec3;
use plumbline_num::math::{Point2, Vec2};

/// Homogeneous image coordinates `(x, y, 1)` of one point in two views; normalized (rays) if the camera is calibrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// In the first view.
    pub first: Vec3,
    /// In the second view.
    pub second: Vec3,
}

impl Correspondence {
    /// The pair of two image points.
    pub fn new(first: Vec2, second: Vec2) -> Self {
        Self { first: first.push(1.0), second: second.push(1.0) }
    }

    /// The same pair in pixels of a camera of focal length `focal` with its principal point at 0.
    #[must_use]
    pub fn scaled(&self, focal: f64) -> Self {
        Self::new(self.first.xy() * focal, self.second.xy() * focal)
    }

    /// The two points, without their third coordinates.
    pub fn points(&self) -> (Point2, Point2) {
        (Point2::from(self.first.xy()), Point2::from(self.second.xy()))
    }

    /// Coefficients of `x₂ᵀ M x₁` in the entries of `M`, row by row.
    pub(super) fn epipolar_row(&self) -> SVector<f64, 9> {
        let (p, q) = (self.first, self.second);
        SVector::from([
            q.x * p.x,
            q.x * p.y,
            q.x * p.z,
            q.y * p.x,
            q.y * p.y,
            q.y * p.z,
            q.z * p.x,
            q.z * p.y,
            q.z * p.z,
        ])
    }
}

/// The matrix with the entries `v` in row-major order.
pub(super) fn matrix_of_rows(v: &SVector<f64, 9>) -> Matrix3<f64> {
    Matrix3::from_row_slice(v.as_slice())
}
