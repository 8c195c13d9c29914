//! Boxes along the axes, and how rays enter them.

use nalgebra::{Point3, Vector3};

/// By how much, relative, a ray may seem to leave a box before it enters it: rounding must not lose a triangle in the
/// side of its box. Too small loses hits, too large only opens more boxes.
const SLACK: f64 = 1e-12;

/// An axis-aligned bounding box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lowest coordinates.
    pub low: Point3<f64>,
    /// Highest coordinates.
    pub high: Point3<f64>,
}

/// A half-line `origin + t direction`, `t ≥ 0`.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Where it starts.
    pub origin: Point3<f64>,
    /// Its direction, of any length; `t` counts in this length.
    pub direction: Vector3<f64>,
    inverse: Vector3<f64>,
    /// Whether it runs across an axis: then slabs need care.
    is_across: bool,
}

impl Ray {
    /// The half-line from `origin`.
    pub fn new(origin: &Point3<f64>, direction: &Vector3<f64>) -> Self {
        let inverse = direction.map(|c| 1.0 / c);
        let is_across = inverse.iter().any(|c| c.is_infinite());
        Self { origin: *origin, direction: *direction, inverse, is_across }
    }
}

impl Aabb {
    /// The box that contains nothing.
    pub fn empty() -> Self {
        let far = Vector3::repeat(f64::INFINITY);
        Self { low: far.into(), high: (-far).into() }
    }

    /// The smallest box around points.
    #[inline]
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Self {
        points.into_iter().fold(Self::empty(), |b, p| Self { low: b.low.inf(p), high: b.high.sup(p) })
    }

    /// The smallest box around two.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Whether two boxes have a point in common.
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }

    /// Squared distance of a point, 0 inside.
    #[inline]
    pub fn squared_distance(&self, p: &Point3<f64>) -> f64 {
        (self.low - p).sup(&(p - self.high)).sup(&Vector3::zeros()).norm_squared()
    }

    /// Parameter at which a ray enters the box, 0 from within; `None` where it does not.
    #[inline]
    pub fn entry(&self, ray: &Ray) -> Option<f64> {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for k in 0..3 {
            let [a, b] = [self.low[k], self.high[k]].map(|side| (side - ray.origin[k]) * ray.inverse[k]);
            // Along the slab: −∞ and ∞ from within it, NaN from one of its sides. It is in the slab all along.
            if ray.is_across && (a + b).is_nan() {
                continue;
            }
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        (enter <= leave * (1.0 + SLACK)).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_enter_where_they_meet_the_first_side_and_also_along_a_side() {
        let unit = Aabb::around(&[Point3::origin(), Point3::new(1.0, 1.0, 1.0)]);
        let entry = |o: [f64; 3], d: [f64; 3]| unit.entry(&Ray::new(&o.into(), &d.into()));
        assert_eq!(entry([-2.0, 0.5, 0.5], [4.0, 0.0, 0.0]), Some(0.5));
        assert_eq!(entry([0.5, 0.5, 0.5], [4.0, 1.0, 0.0]), Some(0.0));
        for side in [0.0, 1.0] {
            assert_eq!(entry([-2.0, side, 0.5], [1.0, 0.0, 0.0]), Some(2.0));
            assert_eq!(entry([-2.0, side, 0.5], [1.0, -0.0, -0.0]), Some(2.0));
        }
        assert_eq!(entry([-2.0, 1.5, 0.5], [1.0, 0.0, 0.0]), None);
        assert_eq!(entry([2.0, 0.5, 0.5], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn boxes_that_touch_overlap_and_distances_count_from_the_side() {
        let at = |x: f64| Aabb::around(&[Point3::new(x, 0.0, 0.0), Point3::new(x + 1.0, 1.0, 1.0)]);
        assert!(at(0.0).overlaps(&at(1.0)) && !at(0.0).overlaps(&at(1.5)) && !at(0.0).overlaps(&Aabb::empty()));
        assert_eq!(at(0.0).union(&at(2.0)), Aabb { low: at(0.0).low, high: at(2.0).high });
        assert_eq!(at(0.0).squared_distance(&Point3::new(3.0, 0.5, 2.0)), 5.0);
        assert_eq!(at(0.0).squared_distance(&Point3::new(0.3, 0.5, 1.0)), 0.0);
    }
}
