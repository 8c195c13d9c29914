//! A tree of boxes over polygons, so that a ray meets a few of thousands.

use nalgebra::Vector3;

use super::Vec3;
use super::geometry::Polygon;
use plumbline_num::spatial::{Aabb, BoxTree, Ray};

/// Margin of boxes around their polygons, m: hits are computed in single precision.
const SLACK_M: f64 = 1e-4;

/// The tree; polygons are known by their indices.
pub(super) struct Bvh<'a> {
    polygons: &'a [Polygon],
    tree: BoxTree,
}

impl<'a> Bvh<'a> {
    pub(super) fn new(polygons: &'a [Polygon]) -> Self {
        let item = |polygon: &Polygon| {
            let corners: Vec<_> = polygon.vertices.iter().map(|v| v.cast::<f64>().into()).collect();
            let Aabb { low, high } = Aabb::around(&corners);
            let slack = Vector3::repeat(SLACK_M);
            (Aabb { low: low - slack, high: high + slack }, polygon.center().cast::<f64>().into())
        };
        Self { tree: BoxTree::new(polygons.iter().map(item)), polygons }
    }

    /// Distance to the nearest polygon other than `own` that the ray meets before `far`; the first met at all with `any`.
    pub(super) fn nearest(&self, own: usize, from: Vec3, direction: Vec3, far: f32, any: bool) -> Option<f32> {
        let mut best = far;
        let ray = Ray::new(&from.cast::<f64>().into(), &direction.cast());
        self.tree.along(&ray, f64::from(far), |items| {
            for &i in self.tree.order()[items].iter().filter(|i| **i as usize != own) {
                if let Some(d) = self.polygons[i as usize].hit(from, direction, 1e-3, best) {
                    best = d;
                }
            }
            if any && best < far { f64::NEG_INFINITY } else { f64::from(best) }
        });
        (best < far).then_some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::{Material, Shapes};

    #[test]
    fn the_tree_agrees_with_exhaustive_search() {
        let plain = Material { texture: 0, tile_m: None, tint: [1.0; 3] };
        let mut rng = fastrand::Rng::with_seed(7);
        let mut shapes = Shapes::default();
        for _ in 0..40 {
            let at = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 10.0;
            shapes.cuboid(at, [0.8 + rng.f32(), 0.8 + rng.f32(), 0.8 + rng.f32()], rng.f32(), plain);
        }
        let tree = Bvh::new(&shapes.polygons);
        let mut met = 0;
        for _ in 0..400 {
            let from = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 10.0;
            let direction = (Vec3::new(rng.f32(), rng.f32(), rng.f32()) - Vec3::repeat(0.5)).normalize();
            let hits = shapes.polygons.iter().enumerate().filter(|(i, _)| *i != 3);
            let expected = hits.filter_map(|(_, p)| p.hit(from, direction, 1e-3, 6.0)).min_by(f32::total_cmp);
            assert_eq!(tree.nearest(3, from, direction, 6.0, false), expected);
            assert_eq!(tree.nearest(3, from, direction, 6.0, true).is_some(), expected.is_some());
            met += usize::from(expected.is_some());
        }
        assert!(met > 100, "only {met} rays met anything");
    }
}
