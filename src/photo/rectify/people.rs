//! People in the crop: faces, and the region of the body below each.
//!
//! A face that is cut, or a body that ends at the chest where the source shows all of it, is seen at once; what is lost of a wall is
//! not. The body of a face of height `h` is looked for from its top to `3 h` below its chin, one width of the face to either side of
//! its middle. Where the source ends above that, it is the photographer's cut, and the face alone is kept.

use crate::warp::Forward;
use plumbline_num::math::{Point2, Rect, Vec2};

/// Height of a body below its face, in heights of the face: to the hips.
const BODY_HEIGHT: f64 = 3.0;
/// Half its width, in widths of the face: shoulders are two faces wide.
const BODY_HALF_WIDTH: f64 = 1.0;
/// Points along each side of a region at which its outline is mapped.
const POINTS: usize = 9;

/// The region of a face's body, if the picture shows it whole down to the hips; what lies beside the picture is cut off.
pub(super) fn body(face: &Rect, picture: &Rect) -> Option<Rect> {
    let (middle, half) = (face.center().x, BODY_HALF_WIDTH * face.width());
    let bottom = face.max.y + BODY_HEIGHT * face.height();
    let shown = face.min.y >= picture.min.y && bottom <= picture.max.y;
    let min = Point2::new((middle - half).max(picture.min.x), face.min.y);
    let max = Point2::new((middle + half).min(picture.max.x), bottom);
    (shown && max.x > min.x).then_some(Rect { min, max })
}

/// Bounds of the part of a region that the picture has, under a map; `None` where the map does not show all of it.
pub(super) fn outline(region: &Rect, picture: &Rect, forward: &Forward) -> Option<Rect> {
    let part = Rect { min: region.min.sup(&picture.min), max: region.max.inf(&picture.max) };
    if !(part.width() > 0.0 && part.height() > 0.0) {
        return None;
    }
    let at = |k: usize| k as f64 / (POINTS - 1) as f64;
    let mut points = (0..POINTS * POINTS).map(|k| forward(part.at(at(k % POINTS), at(k / POINTS))));
    let first = points.next()??;
    points.try_fold(Rect { min: first, max: first }, |b, p| Some(Rect { min: b.min.inf(&p?), max: b.max.sup(&p?) }))
}

/// The largest rectangle that contains faces and bodies, faces first and then bodies, each added greedily by size; `None` if it can
/// contain none.
pub(super) fn around(
    faces: &mut [Rect],
    bodies: &mut [Rect],
    largest: impl Fn(Option<&Rect>) -> Option<Rect>,
) -> Option<Rect> {
    let mut best: Option<(Rect, Rect)> = None;
    for regions in [faces, bodies] {
        regions.sort_by(|a, b| (b.width() * b.height()).total_cmp(&(a.width() * a.height())));
        for region in regions.iter() {
            let kept = best.map_or(*region, |(kept, _)| union(&kept, region));
            if let Some(found) = largest(Some(&kept)) {
                best = Some((kept, found));
            }
        }
    }
    best.map(|(_, found)| found)
}

fn union(a: &Rect, b: &Rect) -> Rect {
    Rect { min: a.min.inf(&b.min), max: a.max.sup(&b.max) }
}

/// A rectangle lies within another.
pub(super) fn within(inner: &Rect, outer: &Rect) -> bool {
    inner.min.x >= outer.min.x && inner.min.y >= outer.min.y && inner.max.x <= outer.max.x && inner.max.y <= outer.max.y
}

/// Indices of the regions that an output does not show whole; `tolerance` is a fraction of its longer side.
pub(super) fn cut(
    regions: &[Option<Rect>],
    picture: &Rect,
    forward: &Forward,
    size: (usize, usize),
    tolerance: f64,
) -> Vec<usize> {
    let grown = Vec2::repeat(tolerance * size.0.max(size.1) as f64);
    let frame = Rect { min: Point2::from(-grown), max: Point2::new(size.0 as f64, size.1 as f64) + grown };
    let whole = |region: &Rect| outline(region, picture, forward).is_some_and(|shown| within(&shown, &frame));
    (0..regions.len()).filter(|&k| regions[k].is_some_and(|region| !whole(&region))).collect()
}
