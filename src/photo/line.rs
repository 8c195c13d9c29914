//! A marked line: something straight in the world, as the picture shows it.

use plumbline_camera::Lens;
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

impl Line {
    /// The line at whatever angle suits.
    pub(crate) fn free(&self) -> Self {
        Self { orientation: Orientation::Free, ..self.clone() }
    }

    /// Points along the line, px: from each mark to the next `pieces` steps of the image of a straight edge under `lens`; straight
    /// steps without a lens, and where it does not see both marks.
    ///
    /// # Example
    /// ```
    /// use plumbline_camera::{FieldAxis, FieldOfView, Lens, Projection};
    /// use plumbline_num::math::Point2;
    /// use plumbline_photo::{Line, Orientation};
    ///
    /// let fov = FieldOfView::degrees(150.0, FieldAxis::Horizontal);
    /// let fisheye = Lens::from_field_of_view(Projection::Equidistant, fov, (1000.0, 800.0))?;
    /// let ends = vec![Point2::new(100.0, 100.0), Point2::new(900.0, 100.0)];
    /// let eaves = Line { name: "eaves".to_owned(), points: ends, orientation: Orientation::Free };
    /// let middle = eaves.course(Some(&fisheye), 2)[1];
    /// assert!(middle.y < 80.0, "a fisheye bends a straight edge away from the center: {middle}");
    /// assert_eq!(eaves.course(None, 2)[1], Point2::new(500.0, 100.0));
    /// # Ok::<(), plumbline_camera::LensError>(())
    /// ```
    pub fn course(&self, lens: Option<&Lens>, pieces: usize) -> Vec<Point2> {
        let Some(first) = self.points.first() else { return Vec::new() };
        let mut course = vec![*first];
        for pair in self.points.windows(2) {
            let rays = lens.and_then(|lens| Some((lens, lens.unproject(pair[0])?, lens.unproject(pair[1])?)));
            for k in 1..=pieces {
                let t = k as f64 / pieces as f64;
                match rays {
                    Some(_) if k == pieces => course.push(pair[1]),
                    Some((lens, from, to)) => course.extend(lens.project(&(from * (1.0 - t) + to * t))),
                    None => course.push(pair[0] + (pair[1] - pair[0]) * t),
                }
            }
        }
        course
    }
}
