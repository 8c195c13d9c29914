//! Lenses given by how much of the world the picture shows.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::{Lens, LensError, Projection};
use crate::Vec3;
use plumbline_num::math::{Point2, Vec2};

/// Along which line through the middle of the picture a field of view is measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum FieldAxis {
    /// Horizontally.
    ///
    /// From the left edge to the right one.
    #[default]
    #[serde(rename = "h")]
    Horizontal,
    /// Vertically.
    ///
    /// From the top edge to the bottom one.
    #[serde(rename = "v")]
    Vertical,
    /// From corner to corner.
    #[serde(rename = "d")]
    Diagonal,
}

impl FieldAxis {
    fn name(self) -> &'static str {
        match self {
            Self::Horizontal => "horizontal",
            Self::Vertical => "vertical",
            Self::Diagonal => "diagonal",
        }
    }
}

/// The angle between the rays of two opposite ends of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldOfView {
    /// The angle, rad.
    pub radians: f64,
    /// Which ends are meant.
    pub axis: FieldAxis,
}

impl FieldOfView {
    /// A field of view in degrees.
    pub fn degrees(degrees: f64, axis: FieldAxis) -> Self {
        Self { radians: degrees.to_radians(), axis }
    }
}

impl Lens {
    /// The lens with square pixels whose axis goes through the middle of the picture and whose picture shows `fov`: one half
    /// of it towards +x or +y, and, where the projection is symmetric, the other half on the other side.
    ///
    /// # Errors
    /// [`LensError::Size`] for a size that is none, [`LensError::FieldOfView`] for an angle that the projection cannot show.
    pub fn from_field_of_view(projection: Projection, fov: FieldOfView, size: (f64, f64)) -> Result<Self, LensError> {
        let valid = |s: f64| s > 0.0 && s.is_finite();
        if !(valid(size.0) && valid(size.1)) {
            return Err(LensError::Size(size.0, size.1));
        }
        let refused = |(limit, included): (f64, bool)| LensError::FieldOfView {
            degrees: fov.radians.to_degrees(),
            axis: fov.axis.name(),
            projection: projection.name(),
            bound: if included { "at most" } else { "below" },
            limit_deg: 2.0 * limit.to_degrees(),
        };
        let (limit, included) = limit(&projection, fov.axis);
        let half = 0.5 * fov.radians;
        if !(half > 0.0 && (half < limit || included && half <= limit)) {
            return Err(refused((limit, included)));
        }
        let focal = focal(&projection, half, fov.axis, size).ok_or_else(|| refused((limit, included)))?;
        Ok(Self { projection, focal: Vec2::new(focal, focal), center: Point2::new(0.5 * size.0, 0.5 * size.1), size })
    }

    /// The angle between the rays of opposite ends of the picture, each measured from the axis; `None` where an end
    /// shows nothing.
    pub fn field_of_view(&self, axis: FieldAxis) -> Option<FieldOfView> {
        let (w, h) = self.size;
        let c = self.center;
        let ends = match axis {
            FieldAxis::Horizontal => [Point2::new(0.0, c.y), Point2::new(w, c.y)],
            FieldAxis::Vertical => [Point2::new(c.x, 0.0), Point2::new(c.x, h)],
            FieldAxis::Diagonal => [Point2::new(0.0, 0.0), Point2::new(w, h)],
        };
        if let (true, FieldAxis::Horizontal) = (self.projection.is_panoramic(), axis) {
            // The ends of a whole turn look in the same direction: longitudes tell more than directions.
            let longitude = |p: Point2| self.unproject(p).map(|r| r.x.atan2(r.z).abs());
            return Some(FieldOfView { radians: longitude(ends[0])? + longitude(ends[1])?, axis });
        }
        let angle = |p: Point2| self.unproject(p).map(|r| r.x.hypot(r.y).atan2(r.z));
        Some(FieldOfView { radians: angle(ends[0])? + angle(ends[1])?, axis })
    }
}

/// Largest half angle along an axis, and whether it can itself be shown.
fn limit(projection: &Projection, axis: FieldAxis) -> (f64, bool) {
    match (projection.panoramic(), axis) {
        (None, _) | (_, FieldAxis::Diagonal) => (projection.with(|m| m.max_angle()), false),
        (Some(p), FieldAxis::Horizontal) => (p.longitude_limit(), !matches!(projection, Projection::Panini(_))),
        (Some(_), FieldAxis::Vertical) => (0.5 * PI, matches!(projection, Projection::Equirectangular)),
    }
}

/// Focal length, px, at which the end of an axis is at the angle `half` from the center.
fn focal(projection: &Projection, half: f64, axis: FieldAxis, (w, h): (f64, f64)) -> Option<f64> {
    let (sin, cos) = half.sin_cos();
    let seen = |x: f64, y: f64| projection.with(|m| m.plane(&Vec3::new(x * sin, y * sin, cos)));
    let focal = match axis {
        FieldAxis::Horizontal if half == PI => 0.5 * w / half,
        FieldAxis::Horizontal => 0.5 * w / seen(1.0, 0.0)?.x,
        FieldAxis::Vertical => 0.5 * h / seen(0.0, 1.0)?.y,
        FieldAxis::Diagonal if projection.is_panoramic() => return cornered(projection, half, (w, h)),
        FieldAxis::Diagonal => {
            let d = w.hypot(h);
            0.5 * d / seen(w / d, h / d)?.norm()
        }
    };
    (focal > 0.0 && focal.is_finite()).then_some(focal)
}

/// The focal length at which the corner of a panorama looks `half` off the axis: the angle falls with the focal length.
fn cornered(projection: &Projection, half: f64, (w, h): (f64, f64)) -> Option<f64> {
    let corner = 0.5 * Vec2::new(w, h);
    let angle = |focal: f64| projection.with(|m| m.ray(corner / focal)).map_or(PI, |r| r.x.hypot(r.y).atan2(r.z));
    // Near the axis every projection is the tangent plane; wide ones are longer by less than the factor below.
    let (mut low, mut high) = (1e-6 * corner.norm(), corner.norm() / half.min(1.0) * 4.0);
    if !(angle(high) < half && angle(low) > half) {
        return None;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if angle(middle) > half {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (f64, f64) = (1200.0, 800.0);

    #[test]
    fn the_picture_shows_the_field_that_was_asked_for() {
        for projection in super::super::tests::projections() {
            for axis in [FieldAxis::Horizontal, FieldAxis::Vertical, FieldAxis::Diagonal] {
                let fov = FieldOfView::degrees(95.0, axis);
                let lens = Lens::from_field_of_view(projection.clone(), fov, SIZE).expect("less than every limit");
                let shown = lens.field_of_view(axis).expect("ends inside the field").radians;
                let even = !matches!(projection, Projection::Ocam(_) | Projection::BrownConrady(_));
                assert!(
                    (shown - fov.radians).abs() < if even { 1e-9 } else { 0.01 },
                    "{projection:?} {axis:?}: {}°",
                    shown.to_degrees()
                );
            }
        }
    }

    #[test]
    fn a_full_panorama_is_as_wide_as_the_picture() {
        let fov = FieldOfView::degrees(360.0, FieldAxis::Horizontal);
        let lens = Lens::from_field_of_view(Projection::Equirectangular, fov, (2000.0, 1000.0)).expect("a panorama");
        assert!((lens.focal.x * std::f64::consts::TAU - 2000.0).abs() < 1e-9);
        assert!((lens.field_of_view(FieldAxis::Vertical).expect("poles").radians - PI).abs() < 1e-12);
        assert!((lens.field_of_view(FieldAxis::Horizontal).expect("seam").radians - 2.0 * PI).abs() < 1e-12);
    }

    #[test]
    fn fields_beyond_a_projection_are_refused_with_the_limit() {
        let lens = |p, degrees| Lens::from_field_of_view(p, FieldOfView::degrees(degrees, FieldAxis::Horizontal), SIZE);
        for (projection, degrees) in [
            (Projection::Rectilinear, 180.0),
            (Projection::Orthographic, 181.0),
            (Projection::Equidistant, 360.0),
            (Projection::Equirectangular, 360.1),
            (Projection::Panini(1.0), 360.0),
            (Projection::Equidistant, 0.0),
            (Projection::Equidistant, -10.0),
            (Projection::Equidistant, f64::NAN),
        ] {
            assert!(matches!(lens(projection.clone(), degrees), Err(LensError::FieldOfView { .. })), "{projection:?}");
        }
        assert_eq!(
            lens(Projection::Rectilinear, 200.0).expect_err("too wide").to_string(),
            "a horizontal field of view of 200.000000° is invalid for the rectilinear projection (expected above 0° and below \
             180.0000°): give another angle or another projection"
        );
        assert!(matches!(
            Lens::from_field_of_view(
                Projection::Equidistant,
                FieldOfView::degrees(90.0, FieldAxis::Diagonal),
                (0.0, f64::NAN)
            ),
            Err(LensError::Size(..))
        ));
    }
}
