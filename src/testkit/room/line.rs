//! Images of the room's segments.

use super::{Room, Segment};
use plumbline_camera::{CameraPose, Lens, Vec3};
use plumbline_num::math::Point2;

/// Samples of a segment, clipped to the picture; the longest edge of the room then has one every 8 mm.
const SAMPLES: usize = 900;
/// Distance between points of an image line, px.
const SPACING_PX: f64 = 12.0;
/// Minimum length of an image line, px: nobody would mark shorter ones.
const MIN_PX: f64 = 40.0;

/// Direction of a segment in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineKind {
    /// Plumb.
    Vertical,
    /// Level.
    Level,
}

/// The image of a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageLine {
    /// Name of the edge.
    pub name: String,
    /// Its direction in the world.
    pub kind: LineKind,
    /// Exact positions along it, px, in order; the longest stretch that is in the picture.
    pub points: Vec<Point2>,
    /// For each point, the direction in which the camera sees it.
    pub rays: Vec<Vec3>,
}

impl Room {
    /// Exact images of the marked edges through `lens` from `pose`, those in the picture.
    pub fn lines(&self, lens: &Lens, pose: &CameraPose) -> Vec<ImageLine> {
        self.segments.iter().filter_map(|segment| image(segment, lens, pose)).collect()
    }
}

/// A point of a segment and where it is seen.
struct Seen {
    p: Point2,
    ray: Vec3,
}

fn image(segment: &Segment, lens: &Lens, pose: &CameraPose) -> Option<ImageLine> {
    let (mut longest, mut run): (Vec<Seen>, Vec<Seen>) = (Vec::new(), Vec::new());
    for i in 0..=SAMPLES {
        let at = segment.from + (segment.to - segment.from) * (i as f64 / SAMPLES as f64);
        let ray = pose.apply(&at).coords.normalize();
        let inside = |p: &Point2| p.x > 0.0 && p.y > 0.0 && p.x < lens.size.0 && p.y < lens.size.1;
        match lens.project(&ray).filter(inside) {
            Some(p) => run.push(Seen { p, ray }),
            None => longest = longer(longest, std::mem::take(&mut run)),
        }
    }
    let line = thinned(longer(longest, run));
    let length: f64 = line.windows(2).map(|w| (w[1].p - w[0].p).norm()).sum();
    let plumb = (segment.to - segment.from).xz().norm() == 0.0;
    (length >= MIN_PX).then(|| ImageLine {
        name: segment.name.clone(),
        kind: if plumb { LineKind::Vertical } else { LineKind::Level },
        rays: line.iter().map(|s| s.ray).collect(),
        points: line.into_iter().map(|s| s.p).collect(),
    })
}

fn longer(a: Vec<Seen>, b: Vec<Seen>) -> Vec<Seen> {
    if b.len() > a.len() { b } else { a }
}

/// Every point that is far enough from the one kept before, and the last.
fn thinned(line: Vec<Seen>) -> Vec<Seen> {
    let count = line.len();
    let mut kept: Vec<Seen> = Vec::new();
    for (i, seen) in line.into_iter().enumerate() {
        let far = kept.last().is_none_or(|k| (seen.p - k.p).norm() >= SPACING_PX);
        if far || i + 1 == count {
            kept.push(seen);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::super::view::hit;
    use super::super::{RoomView, Wall};
    use super::*;
    use plumbline_camera::{FieldAxis, FieldOfView, Point3, Projection};

    fn lens(projection: Projection, degrees: f64) -> Lens {
        let fov = FieldOfView::degrees(degrees, FieldAxis::Diagonal);
        Lens::from_field_of_view(projection, fov, (300.0, 200.0)).expect("a lens")
    }

    fn pose() -> CameraPose {
        CameraPose::looking_from(
            Point3::new(0.2, 0.0, -1.2),
            UnitQuaternion::from_scaled_axis(Vec3::new(0.1, -0.2, 0.03)),
        )
    }

    #[test]
    fn rays_of_a_line_lie_in_a_plane_through_the_camera() {
        for (projection, degrees) in [(Projection::Equisolid, 180.0), (Projection::Rectilinear, 100.0)] {
            for line in Room::furnished().lines(&lens(projection, degrees), &pose()) {
                let last = line.rays.len() - 1;
                let normal = line.rays[0].cross(&line.rays[last]).normalize();
                assert!(line.rays.iter().all(|r| r.dot(&normal).abs() < 1e-12), "{}", line.name);
            }
        }
    }

    #[test]
    fn a_rectilinear_lens_sees_straight_lines_and_a_fisheye_does_not() {
        let bend = |projection, degrees| {
            let lines = Room::furnished().lines(&lens(projection, degrees), &pose());
            assert!(lines.len() > 20, "{}", lines.len());
            let off = |line: &ImageLine| {
                let (a, b) = (line.points[0], line.points[line.points.len() - 1]);
                let along = (b - a).normalize();
                line.points.iter().map(|p| (p - a).perp(&along).abs()).fold(0.0, f64::max)
            };
            lines.iter().map(off).fold(0.0, f64::max)
        };
        assert!(bend(Projection::Rectilinear, 100.0) < 1e-9);
        assert!(bend(Projection::Equisolid, 170.0) > 5.0);
    }

    #[test]
    fn the_picture_changes_across_a_line_where_the_line_says() {
        // Blue plaster above, brown planks below.
        let lens = lens(Projection::Equidistant, 150.0);
        let room = Room::furnished();
        let view = RoomView { lens: lens.clone(), pose: pose(), samples: 3 };
        let picture = view.render(&room);
        let lines = room.lines(&lens, &pose());
        let edge = lines.iter().find(|l| l.name == "wainscot top").expect("in the picture");
        let at = |p: Point2| f64::from(picture.pixels()[p.y as usize * picture.width() + p.x as usize][2]);
        for w in edge.points.windows(2) {
            let (middle, along) = (nalgebra::center(&w[0], &w[1]), (w[1] - w[0]).normalize());
            let across = plumbline_num::math::Vec2::new(-along.y, along.x) * 1.6;
            let (one, other) = (at(middle - across), at(middle + across));
            assert!((one - other).abs() > 40.0, "at {middle}: {one} and {other}");
        }
    }

    #[test]
    fn a_ray_meets_the_wall_that_it_is_aimed_at() {
        for wall in [Wall::FLOOR, Wall::CEILING, Wall::LEFT, Wall::RIGHT, Wall::FRONT, Wall::BACK] {
            let target = wall.place(0.4, 0.7);
            let (hit_wall, place) = hit(&Point3::new(0.2, 0.0, -1.2), &(target - Point3::new(0.2, 0.0, -1.2)));
            assert_eq!(hit_wall, wall);
            assert!((place - target).norm() < 1e-12);
        }
    }
}
