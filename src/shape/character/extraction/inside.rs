//! Distances to the surface, and nodes and edges brought inside it.
//!
//! A node outside moves through the nearest surface point to the midpoint of the chord beyond it, at most by the local thickness. An edge that
//! passes outside is split by a node inside that makes the shortest detour.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::curve_graph::CurveGraph;
use super::order::Cost;

/// Largest number of subdivisions of an edge that passes outside.
const MAX_SPLITS: usize = 5;
/// Largest number of steps to bring a point inside: one is typical, folds of the surface need more.
const MAX_STEPS_INSIDE: usize = 4;
/// Number of directions across an edge that passes outside: one of them is within 12° of the floor of a cleft.
const DIRECTIONS: usize = 16;
/// Offset beyond an intersection before the search for the next, as a fraction of the edge.
const RAY_OFFSET: f64 = 1e-6;

/// Distance to the surface.
pub(super) fn radius(tree: &AabbTree, c: &Point3<f64>) -> f64 {
    tree.nearest(c).map_or(0.0, |p| nalgebra::distance(c, &p))
}

/// Distance to the surface for each node of a curve.
pub(super) fn radii(graph: &CurveGraph, tree: &AabbTree) -> Vec<f64> {
    let mut all = vec![0.0; graph.nodes.len()];
    let mut last = None;
    for v in graph.alive() {
        let c = &graph.nodes[v as usize];
        // Consecutive nodes are close: the last result is a good guess.
        last = match last {
            Some(guess) => Some(tree.nearest_from(c, &guess)),
            None => tree.nearest(c),
        };
        all[v as usize] = last.map_or(0.0, |p| nalgebra::distance(c, &p));
    }
    all
}

/// Brings nodes outside a closed surface back inside.
pub(super) fn bring_nodes_in(graph: &mut CurveGraph, tree: &AabbTree) {
    for v in graph.alive().filter(|v| !graph.pinned[*v as usize]).collect::<Vec<_>>() {
        let position = graph.nodes[v as usize];
        if !tree.encloses(&position) {
            graph.nodes[v as usize] = brought_in(tree, position).unwrap_or(position);
        }
    }
}

/// Brings nodes inside and splits edges that pass outside.
pub(super) fn keep_inside(graph: &mut CurveGraph, tree: &AabbTree) {
    bring_nodes_in(graph, tree);
    let joined = |v: u32| graph.neighbors(v).iter().filter(move |u| v < **u).map(move |u| (v, *u, MAX_SPLITS));
    let mut edges: Vec<(u32, u32, usize)> = graph.alive().flat_map(joined).collect();
    while let Some((a, b, splits)) = edges.pop().filter(|_| !tree.is_exhausted()) {
        let (p, q) = (graph.nodes[a as usize], graph.nodes[b as usize]);
        let outside = outside(tree, &p, &q).filter(|_| splits > 0);
        if let Some(inside) = outside.and_then(|position| detour_around(tree, &p, &q, &position)) {
            let new = graph.split(a, b, inside);
            edges.extend([(a, new, splits - 1), (new, b, splits - 1)]);
        }
    }
}

/// Midpoint of the first part of the segment from `p` to `q` that is outside.
fn outside(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>) -> Option<Point3<f64>> {
    let along = q - p;
    let mut leaves = tree.first_hit(p, &along).filter(|t| *t < 1.0)?;
    // A self-intersecting surface also has intersections with the inside on both sides.
    loop {
        let beyond = leaves + RAY_OFFSET;
        let enters = tree.first_hit(&(p + along * beyond), &along).map_or(1.0, |t| (beyond + t).min(1.0));
        let position = p + along * (0.5 * (leaves + enters));
        if !tree.encloses(&position) {
            return Some(position);
        }
        if enters >= 1.0 || tree.is_exhausted() {
            return None;
        }
        leaves = enters;
    }
}

/// The inside point that gives the shortest path from `p` to `q` around `outside`, among midpoints of chords beyond the surface in directions
/// perpendicular to the segment.
fn detour_around(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>, outside: &Point3<f64>) -> Option<Point3<f64>> {
    let along = (q - p).try_normalize(0.0)?;
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let beyond = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / DIRECTIONS as f64;
        let across = side * angle.cos() + other * angle.sin();
        let enters = tree.first_hit(outside, &across)? * (1.0 + RAY_OFFSET);
        let leaves = tree.first_hit(&(outside + across * enters), &across)?;
        let position = outside + across * (enters + 0.5 * leaves);
        tree.encloses(&position).then_some(position)
    };
    let detour = |x: &Point3<f64>| Cost::new(nalgebra::distance(p, x) + nalgebra::distance(x, q));
    (0..DIRECTIONS).filter_map(beyond).min_by_key(detour).or_else(|| brought_in(tree, *outside))
}

/// An inside point reached by steps beyond the nearest surface point.
fn brought_in(tree: &AabbTree, position: Point3<f64>) -> Option<Point3<f64>> {
    let mut at = position;
    (0..MAX_STEPS_INSIDE).find_map(|_| {
        at = beyond_surface(tree, &at)?;
        tree.encloses(&at).then_some(at)
    })
}

/// The midpoint of the chord beyond the surface point nearest to a point outside, but no deeper than the surface is thick there.
fn beyond_surface(tree: &AabbTree, c: &Point3<f64>) -> Option<Point3<f64>> {
    let nearest = tree.nearest(c)?;
    let (inward, distance) = (nearest - c, nalgebra::distance(c, &nearest));
    let Some(inward) = inward.try_normalize(0.0) else { return Some(*c) };
    let start = nearest + inward * (1e-6 + 1e-3 * distance);
    let half = 0.5 * tree.first_hit(&start, &inward).unwrap_or(0.0);
    Some(nearest + inward * radius(tree, &(start + inward * half)).min(half))
}
