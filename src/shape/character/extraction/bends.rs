//! Smooths sharp bends of the curve.
//!
//! Sight steps and detours around the outside leave sharp bends. A node at which the direction changes by more than an angle moves halfway
//! to the midpoint of its neighbors, repeatedly, unless one of its edges would then cross the surface: a curve inside stays inside.

use nalgebra::Point3;

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;

/// Cosine of the smallest sharp angle, 45°.
const MAX_SHARP_COSINE: f64 = 0.7;
/// Number of passes.
const PASSES: usize = 10;

/// Smooths all sharp bends, except at junctions and pinned nodes.
pub(super) fn round_off(graph: &mut CurveGraph, tree: &AabbTree) {
    let inner: Vec<u32> = graph.alive().filter(|v| graph.degree(*v) == 2 && !graph.pinned[*v as usize]).collect();
    for _ in (0..PASSES).take_while(|_| !tree.is_exhausted()) {
        for &v in &inner {
            round(graph, tree, v);
        }
    }
}

fn round(graph: &mut CurveGraph, tree: &AabbTree, v: u32) {
    let [a, b] = *graph.neighbors(v) else { return };
    let [p, at, q] = [a, v, b].map(|v| graph.nodes[v as usize]);
    let along = |from: Point3<f64>, to: Point3<f64>| (to - from).try_normalize(0.0);
    let straight = along(p, at).zip(along(at, q)).is_none_or(|(before, after)| before.dot(&after) >= MAX_SHARP_COSINE);
    if straight {
        return;
    }
    let position = at + (nalgebra::center(&p, &q) - at) * 0.5;
    // The path of the node and its new edges must not cross the surface.
    if ![at, p, q].iter().any(|to| tree.is_hit(&position, &(to - position), 1.0)) {
        graph.nodes[v as usize] = position;
    }
}
