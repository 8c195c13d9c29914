//! A tree of boxes over polygons, so that a ray meets a few of thousands.

use super::Vec3;
use super::geometry::Polygon;

/// Polygons per leaf: fewer cost more steps down the tree, more cost more tests.
const LEAF: usize = 4;

enum Node {
    Leaf { low: Vec3, high: Vec3, members: Vec<u32> },
    Split { low: Vec3, high: Vec3, children: Box<[Node; 2]> },
}

/// The tree; polygons are known by their indices.
pub(super) struct Bvh<'a> {
    polygons: &'a [Polygon],
    root: Node,
}

impl<'a> Bvh<'a> {
    /// Splits at the median of the longest axis, down to a few polygons.
    pub(super) fn new(polygons: &'a [Polygon]) -> Self {
        let mut all: Vec<u32> = (0..polygons.len() as u32).collect();
        Self { root: build(polygons, &mut all), polygons }
    }

    /// Distance to the nearest polygon other than `own` that the ray meets before `far`; the first met at all with `any`.
    pub(super) fn nearest(&self, own: usize, from: Vec3, direction: Vec3, far: f32, any: bool) -> Option<f32> {
        let (mut stack, mut best) = (vec![&self.root], far);
        let inverse = direction.map(|v| 1.0 / v);
        while let Some(node) = stack.pop() {
            let (Node::Leaf { low, high, .. } | Node::Split { low, high, .. }) = node;
            if !crosses(low, high, from, inverse, best) {
                continue;
            }
            match node {
                Node::Split { children, .. } => stack.extend(children.iter()),
                Node::Leaf { members, .. } => {
                    for &i in members.iter().filter(|i| **i as usize != own) {
                        let Some(d) = self.polygons[i as usize].hit(from, direction, 1e-3, best) else { continue };
                        if any {
                            return Some(d);
                        }
                        best = d;
                    }
                }
            }
        }
        (best < far).then_some(best)
    }
}

fn build(polygons: &[Polygon], members: &mut [u32]) -> Node {
    let corners = || members.iter().flat_map(|i| &polygons[*i as usize].vertices);
    let low = corners().fold(Vec3::repeat(f32::MAX), |a, v| a.inf(v));
    let high = corners().fold(Vec3::repeat(f32::MIN), |a, v| a.sup(v));
    if members.len() <= LEAF {
        return Node::Leaf { low, high, members: members.to_vec() };
    }
    let axis = (high - low).imax();
    let key = |i: &u32| polygons[*i as usize].center()[axis];
    members.sort_by(|a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (first, second) = members.split_at_mut(members.len() / 2);
    Node::Split { low, high, children: Box::new([build(polygons, first), build(polygons, second)]) }
}

/// Whether the ray passes through the box before `far`; a hair of slack for flat boxes.
fn crosses(low: &Vec3, high: &Vec3, from: Vec3, inverse: Vec3, far: f32) -> bool {
    let (mut enter, mut leave) = (0.0_f32, far);
    for c in 0..3 {
        let (a, b) = ((low[c] - 1e-4 - from[c]) * inverse[c], (high[c] + 1e-4 - from[c]) * inverse[c]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::geometry::{Material, Shapes};

    #[test]
    fn the_tree_finds_what_a_search_of_all_finds() {
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
