//! A marked line: something straight in the world, as the picture shows it.

use plumbline_num::math::Point2;

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

/// A line as it was marked or found.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// What messages call it.
    pub name: String,
    /// Source px, in order along the line, at least two. Two are the ends of a line whose course between them the lens
    /// tells (on a picture without a lens: a straight segment); more are measurements of it.
    pub points: Vec<Point2>,
    /// How it shall lie in the output.
    pub orientation: Orientation,
}
