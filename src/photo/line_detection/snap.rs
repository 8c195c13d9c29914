//! Marks of a line moved to the edge near them.
//!
//! Through each mark `p` runs the normal `n` of the polyline of marks. Along it the gray level is averaged over a few pixels of the
//! line's direction `t`, and differentiated:
//!
//! ```text
//! g(o) = |L(o + ½) − L(o − ½)|,    L(o) = mean over |s| ≤ 3 of levels(p + o n + s t),    |o| ≤ reach
//! ```
//!
//! The mark goes to the largest `g` that exceeds [`MIN_CONTRAST`], refined by a parabola through its neighbors. An edge is the
//! same along the whole line, so that the sign of the gradient is that which most marks agree on.

use plumbline_image::PlaneRef;
use plumbline_num::math::{Point2, Vec2};

/// Samples along the line on each side of a mark, px: an edge is straight over so few.
const HALF_LENGTH: i32 = 3;
/// Smallest step of gray levels, 0 to 255, that is an edge: noise of photos averaged over the samples is below 2.
const MIN_CONTRAST: f64 = 4.0;

/// The points of a line with each moved along the line's normal to the strongest edge within `reach` px; points near which there
/// is none stay. `levels` are gray levels, 0 to 255; points are px of them.
///
/// # Example
/// ```
/// use plumbline_image::Plane;
/// use plumbline_num::math::Point2;
/// use plumbline_photo::line_detection::snapped;
///
/// let levels = Plane::from_fn(60, 60, |x, _| if x < 30 { 20.0 } else { 200.0 });
/// let marks = [Point2::new(27.0, 10.0), Point2::new(32.5, 50.0)];
/// for p in snapped(levels.as_ref(), &marks, 6.0) {
///     assert!((p.x - 30.0).abs() < 0.5, "{p}");
/// }
/// ```
pub fn snapped(levels: PlaneRef<'_, f32>, points: &[Point2], reach: f64) -> Vec<Point2> {
    let steps = reach.clamp(0.0, 200.0).ceil() as i32;
    let profiles: Vec<Profile> = (0..points.len()).map(|k| Profile::of(levels, points, k, steps)).collect();
    // Which side is the brighter one: as most of the contrast says.
    let sign = profiles.iter().map(Profile::signed_peak).sum::<f64>().signum();
    let moved = |(p, profile): (&Point2, &Profile)| profile.edge(sign).map_or(*p, |offset| p + profile.normal * offset);
    points.iter().zip(&profiles).map(moved).collect()
}

/// Gradients along the normal of a mark, at whole offsets from `-steps` on.
struct Profile {
    normal: Vec2,
    steps: i32,
    gradients: Vec<f64>,
}

impl Profile {
    fn of(levels: PlaneRef<'_, f32>, points: &[Point2], k: usize, steps: i32) -> Self {
        let (before, after) = (points[k.saturating_sub(1)], points[(k + 1).min(points.len() - 1)]);
        let along = (after - before).try_normalize(1e-9).unwrap_or_else(Vec2::zeros);
        let normal = Vec2::new(-along.y, along.x);
        let level = |offset: f64| {
            let at = |s: i32| sampled(levels, points[k] + normal * offset + along * f64::from(s));
            (-HALF_LENGTH..=HALF_LENGTH).map(at).sum::<f64>() / f64::from(2 * HALF_LENGTH + 1)
        };
        let gradient = |o: i32| level(f64::from(o) + 0.5) - level(f64::from(o) - 0.5);
        Self { normal, steps, gradients: (-steps..=steps).map(gradient).collect() }
    }

    /// The gradient of largest amount.
    fn signed_peak(&self) -> f64 {
        self.gradients.iter().copied().fold(0.0, |best: f64, g| if g.abs() > best.abs() { g } else { best })
    }

    /// Offset of the strongest edge of this sign.
    fn edge(&self, sign: f64) -> Option<f64> {
        let strength = |i: usize| self.gradients.get(i).map_or(0.0, |g| (g * sign).max(0.0));
        let best = (0..self.gradients.len()).max_by(|a, b| strength(*a).total_cmp(&strength(*b)))?;
        if strength(best) < MIN_CONTRAST {
            return None;
        }
        let before = if best > 0 { strength(best - 1) } else { 0.0 };
        let (peak, after) = (strength(best), strength(best + 1));
        let bend = before - 2.0 * peak + after;
        let refined = if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
        Some(f64::from(best as i32 - self.steps) + refined.clamp(-0.5, 0.5))
    }
}

/// The level at a position, pixel centers at integer + 0.5; the edge's beyond it.
fn sampled(levels: PlaneRef<'_, f32>, p: Point2) -> f64 {
    let axis = |v: f64, n: usize| {
        let v = (v - 0.5).clamp(0.0, (n - 1) as f64);
        let low = (v as usize).min(n.saturating_sub(2));
        (low, (low + 1).min(n - 1), v - low as f64)
    };
    if levels.width() == 0 || levels.height() == 0 || !(p.x.is_finite() && p.y.is_finite()) {
        return 0.0;
    }
    let ((x, x1, s), (y, y1, t)) = (axis(p.x, levels.width()), axis(p.y, levels.height()));
    let row = |y: usize| f64::from(levels.row(y)[x]) * (1.0 - s) + f64::from(levels.row(y)[x1]) * s;
    row(y) * (1.0 - t) + row(y1) * t
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::Plane;

    #[test]
    fn marks_beside_a_slanted_edge_move_onto_it_to_a_tenth_of_a_pixel() {
        // The edge x = 40 + y / 4 of a picture whose pixels hold the covered part.
        let edge = |y: f64| 40.0 + 0.25 * y;
        let levels = Plane::from_fn(120, 120, |x, y| {
            let covered = (edge(y as f64 + 0.5) - x as f64).clamp(0.0, 1.0);
            (30.0 + 150.0 * covered) as f32
        });
        let marks: Vec<Point2> = [(43.0, 8.0), (54.0, 50.0), (64.0, 110.0)].map(|(x, y)| Point2::new(x, y)).into();
        for (p, before) in snapped(levels.as_ref(), &marks, 8.0).iter().zip(&marks) {
            assert!((p.x - edge(p.y)).abs() < 0.15, "{before} went to {p}, the edge is at {}", edge(p.y));
        }
    }

    #[test]
    fn marks_near_no_edge_stay() {
        let levels = Plane::from_fn(50, 50, |x, _| 100.0 + (x % 2) as f32);
        let marks = [Point2::new(10.0, 10.0), Point2::new(40.0, 30.0)];
        assert_eq!(snapped(levels.as_ref(), &marks, 6.0), marks);
        assert_eq!(snapped(levels.as_ref(), &[], 6.0), []);
        let outside = [Point2::new(-80.0, 10.0), Point2::new(f64::NAN, 30.0)];
        assert!(snapped(levels.as_ref(), &outside, 1e9)[0].x.is_finite());
    }

    #[test]
    fn all_marks_take_the_side_on_which_most_of_the_contrast_is() {
        // A bright stripe: its left edge is nearer to two marks of three.
        let levels = Plane::from_fn(60, 90, |x, _| if (25..33).contains(&x) { 200.0 } else { 20.0 });
        let marks = [Point2::new(26.0, 10.0), Point2::new(26.5, 45.0), Point2::new(27.0, 80.0)];
        let moved = snapped(levels.as_ref(), &marks, 4.0);
        assert!(moved.iter().all(|p| (p.x - 25.0).abs() < 0.3), "{moved:?}");
    }
}
