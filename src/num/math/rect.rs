//! Rectangles along the axes: face boxes, crops.

use super::{Point2, Vec2};

/// The rectangle `[min.x, max.x] × [min.y, max.y]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Top left corner.
    pub min: Point2,
    /// Bottom right corner.
    pub max: Point2,
}

impl Rect {
    /// The rectangle of an image: `[0, width] × [0, height]`.
    pub fn of_size(width: f64, height: f64) -> Self {
        Self { min: Point2::origin(), max: Point2::new(width, height) }
    }

    /// Extent along x.
    pub fn width(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// Extent along y.
    pub fn height(&self) -> f64 {
        self.max.y - self.min.y
    }

    /// The middle.
    pub fn center(&self) -> Point2 {
        nalgebra::center(&self.min, &self.max)
    }

    /// True for points inside or on the border; false for NaN.
    pub fn contains(&self, p: Point2) -> bool {
        p.x >= self.min.x && p.x <= self.max.x && p.y >= self.min.y && p.y <= self.max.y
    }

    /// The point at fractions `(s, t)` of width and height.
    pub fn at(&self, s: f64, t: f64) -> Point2 {
        self.min + Vec2::new(s * self.width(), t * self.height())
    }
}
