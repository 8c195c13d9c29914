//! A marked line: something straight in the world, as the picture shows it.

use plumbline_num::math::{Point2, Vec2};

/// Orientation constraint of a line in the output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Orientation {
    /// Straight, at whatever angle suits.
    #[default]
    Free,
    /// Along x.
    Horizontal,
    /// Along y.
    Vertical,
    /// At an angle from +x towards +y (down), rad.
    Angle(f64),
}

impl Orientation {
    /// Angle from +x towards +y, rad; `None` for a free line.
    pub(crate) fn angle(self) -> Option<f64> {
        match self {
            Self::Free => None,
            Self::Horizontal => Some(0.0),
            Self::Vertical => Some(std::f64::consts::FRAC_PI_2),
            Self::Angle(angle) => Some(angle),
        }
    }

    /// Unit normal of the direction, exact for horizontal and vertical lines; `None` for a free line.
    pub(crate) fn normal(self) -> Option<Vec2> {
        match self {
            Self::Free => None,
            Self::Horizontal => Some(Vec2::new(0.0, 1.0)),
            Self::Vertical => Some(Vec2::new(1.0, 0.0)),
            Self::Angle(angle) => Some(Vec2::new(-angle.sin(), angle.cos())),
        }
    }
}

/// A line as it was marked or found.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What messages call it.
    pub name: String,
    /// Source px, in order along the line, at least two. Two are the ends of a line whose course between them the lens
    /// gives (on a picture without a lens: a straight segment); more are measurements of it.
    pub points: Vec<Point2>,
    /// How it shall lie in the output.
    pub orientation: Orientation,
}
