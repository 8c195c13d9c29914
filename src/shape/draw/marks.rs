//! Points and segments in space (handles, skeletons), drawn over the picture and attenuated where the surface hides them.

#![allow(clippy::cast_possible_wrap)] // sides of pictures are far below 2^63

use nalgebra::Point3;

use super::SurfaceCamera;
use super::occlusion::Occlusion;
use plumbline_image::canvas::{Canvas, Rgb};
use plumbline_num::math::Point2;

/// Depth bias of marks as a fraction of their distance: marks on the surface would otherwise be half hidden by it.
const DEPTH_BIAS: f32 = 0.004;
/// Half the width of a mark as a fraction of its distance, at most, where marks are sorted: wider ones would reach the camera.
const MAX_HALF_WIDTH: f64 = 0.5;
/// Width of the dark outline around points, px, for contrast on any color.
const RIM: f64 = 1.2;

/// Shape of a mark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A disk.
    Point(Point3<f64>),
    /// A line segment.
    Segment(Point3<f64>, Point3<f64>),
}

/// A point or a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Its shape and position.
    pub shape: Shape,
    /// Its color.
    pub color: Rgb,
    /// Diameter of a disk, width of a line, px.
    pub width_px: f64,
}

/// A projected mark: both end points (equal for a point) with their inverse depths `1/z`.
struct Drawn<'m> {
    mark: &'m Mark,
    ends: [(Point2, f32); 2],
}

/// Draws the marks, the farthest first.
pub(super) fn draw(marks: &[Mark], camera: &SurfaceCamera, occlusion: &Occlusion, canvas: &mut Canvas) {
    let mut drawn: Vec<Drawn<'_>> = marks.iter().filter_map(|m| Drawn::of(m, camera)).collect();
    // Marks are as deep as they are wide: the disk at the end of a line is in front of it, whatever rounding says of their middles.
    let nearness = |d: &Drawn<'_>| {
        let half_width = (d.mark.width_px / 2.0 / camera.focal_px).min(MAX_HALF_WIDTH);
        f64::from(d.ends[0].1 + d.ends[1].1) / (1.0 - half_width)
    };
    drawn.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    for mark in &drawn {
        mark.draw(occlusion, canvas);
    }
}

impl<'m> Drawn<'m> {
    /// `None` for a mark behind the camera or with a coordinate that is not finite.
    fn of(mark: &'m Mark, camera: &SurfaceCamera) -> Option<Self> {
        let (a, b) = match mark.shape {
            Shape::Point(p) => (p, p),
            Shape::Segment(a, b) => (a, b),
        };
        let [mut a, mut b] = [a, b].map(|p| camera.pose.apply(&p));
        if !(a.z.max(b.z) > camera.near) {
            return None;
        }
        let cut = |from: Point3<f64>, to: Point3<f64>| from + (to - from) * ((camera.near - from.z) / (to.z - from.z));
        if a.z <= camera.near {
            a = cut(a, b);
        } else if b.z <= camera.near {
            b = cut(b, a);
        }
        let end = |p: Point3<f64>| (camera.project(&p), (1.0 / p.z) as f32);
        let ends = [end(a), end(b)];
        let finite = ends.iter().all(|(p, _)| p.x.is_finite() && p.y.is_finite()) && mark.width_px > 0.0;
        finite.then_some(Self { mark, ends })
    }

    fn draw(&self, occlusion: &Occlusion, canvas: &mut Canvas) {
        let radius = self.mark.width_px / 2.0;
        let rim = if matches!(self.mark.shape, Shape::Point(_)) { RIM } else { 0.0 };
        let reach = radius + rim + 1.0;
        let [(a, near_a), (b, near_b)] = self.ends;
        let range = |p: f64, q: f64, size: usize| {
            let (low, high) = ((p.min(q) - reach).floor(), (p.max(q) + reach).ceil());
            low.clamp(0.0, size as f64) as usize..high.clamp(0.0, size as f64) as usize
        };
        let (columns, rows) = (range(a.x, b.x, canvas.width()), range(a.y, b.y, canvas.height()));
        let d = b - a;
        let length2 = d.norm_squared();
        for y in rows {
            for x in columns.clone() {
                let p = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
                let t = if length2 > 0.0 { ((p - a).dot(&d) / length2).clamp(0.0, 1.0) } else { 0.0 };
                let distance = (p - (a + d * t)).norm();
                let cover = |r: f64| (r + 0.5 - distance).clamp(0.0, 1.0) as f32;
                if cover(radius + rim) <= 0.0 {
                    continue;
                }
                let strength =
                    occlusion.transmittance((x, y), (near_a + (near_b - near_a) * t as f32) * (1.0 + DEPTH_BIAS));
                if rim > 0.0 {
                    canvas.blend(x as i64, y as i64, [24, 26, 32], cover(radius + rim) * strength);
                }
                canvas.blend(x as i64, y as i64, self.mark.color, cover(radius) * strength);
            }
        }
    }
}
