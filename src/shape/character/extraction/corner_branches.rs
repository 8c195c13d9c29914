//! Removes branches into corners and rims.
//!
//! The curve of a box is its axis, but medial sheets extend into every corner and edge, and the curve tends to follow them. Toward a corner
//! the inscribed balls shrink linearly and fast to zero, as in a cone: with `r` the radius of the first ball, `s` that of the end at
//! distance `d`,
//!
//! `(r − s) / d > MIN_SLOPE`,   `s < MAX_END_RATIO · r`,   deviation from linear within `−MAX_BELOW_LINEAR · r … MAX_ABOVE_LINEAR · r`,
//!
//! with slope `1/√3` in the corner of a cube, `1/√2` at the rim of a cylinder. Legs, ears, and spines are thinner than linear where they leave
//! the body. A blunt horn is a cone as well; context decides: three or more cones at one ball are the corners of a box; a cone that turns
//! aside at the end of a limb is a hook into a rim; a cone that continues straight is the tip of the limb.

use super::curve_graph::{Branch, CurveGraph};
use super::order::Cost;
use super::pruning::sticks_out;

/// Smallest slope of the radii of a cone.
const MIN_SLOPE: f64 = 0.45;
/// Largest end radius relative to the first: allows for a small fillet.
const MAX_END_RATIO: f64 = 0.35;
/// Largest excess over the linear radius, relative to the first: box sheets bend the path to a corner.
const MAX_ABOVE_LINEAR: f64 = 0.25;
/// Largest deficit below the linear radius: spines and ears have .16 to .4, box corners at most .14, nine in ten below .1.
const MAX_BELOW_LINEAR: f64 = 0.15;
/// Largest extent of a corner beyond its ball, in ball radii.
const MAX_CORNER_EXTENT: f64 = 1.1;
/// Largest extent of a rim hook beyond its ball, in ball radii.
const MAX_RIM_EXTENT: f64 = 0.9;
/// Number of corners at one ball that are no limbs: boxes have four to eight, heads two ears.
const MIN_CLUSTER: usize = 3;
/// Smallest angle at which a hook turns aside, rad (30°).
const MIN_HOOK_ANGLE: f64 = 0.52;

/// Removes clusters of branches into corners; whether there were any. `radii` are the distances of the nodes to the surface.
pub(super) fn remove_corner_clusters(graph: &mut CurveGraph, radii: &[f64]) -> bool {
    let corner = |branch: Branch| {
        let (_, base) = sticks_out(graph, &branch, radii);
        let first = (0..branch.len()).min_by_key(|i| Cost::new(graph.length(base, branch[*i])))?;
        is_cone(graph, radii, base, &branch[first..], MAX_CORNER_EXTENT).then_some((branch, base))
    };
    let corners: Vec<(Branch, u32)> = graph.limbs().filter_map(corner).collect();
    let about =
        |base: u32| corners.iter().filter(|(_, other)| graph.length(base, *other) < radii[base as usize]).count();
    let clusters: Vec<&Branch> =
        corners.iter().filter(|(_, base)| about(*base) >= MIN_CLUSTER).map(|(b, _)| b).collect();
    for branch in &clusters {
        graph.remove_branch(branch);
    }
    !clusters.is_empty()
}

/// Removes hooks into a rim or corner at the ends of limbs.
pub(super) fn remove_rim_hooks(graph: &mut CurveGraph, radii: &[f64]) {
    for mut branch in graph.branches() {
        for _ in 0..2 {
            let end = branch[branch.len() - 1];
            if graph.degree(end) == 1
                && !graph.pinned[end as usize]
                && let Some(base) = hook(graph, radii, &branch)
            {
                graph.remove_branch(&branch[base..]);
                branch.truncate(base + 1);
            }
            branch.reverse();
        }
    }
}

/// Index in a branch at which the hook at its end starts.
fn hook(graph: &CurveGraph, radii: &[f64], branch: &[u32]) -> Option<usize> {
    let last = branch.len() - 1;
    let away = |i: usize, from: usize| graph.length(branch[i], branch[from]);
    let radius = |i: usize| radii[branch[i] as usize];
    let base = (0..last).max_by_key(|i| Cost::new(radius(*i) - MIN_SLOPE * away(*i, last)))?;
    let before = (0..base).rev().find(|i| away(*i, base) >= radius(base))?;
    let [from, at, to] = [before, base, last].map(|i| graph.nodes[branch[i] as usize]);
    let is_hook = (at - from).angle(&(to - at)) > MIN_HOOK_ANGLE
        && is_cone(graph, radii, branch[base], &branch[base..], MAX_RIM_EXTENT);
    is_hook.then_some(base)
}

/// Whether the balls from that of `base` along a row of nodes form a cone, whose end extends by less than `out` radii.
fn is_cone(graph: &CurveGraph, radii: &[f64], base: u32, row: &[u32], out: f64) -> bool {
    let end = row[row.len() - 1];
    let [r, s] = [base, end].map(|v| radii[v as usize]);
    let length = graph.length(base, end);
    let slope = (r - s) / length;
    let even = |v: &u32| {
        let more = (radii[*v as usize] - r + slope * graph.length(base, *v)) / r;
        (-MAX_BELOW_LINEAR..=MAX_ABOVE_LINEAR).contains(&more)
    };
    slope > MIN_SLOPE && s < MAX_END_RATIO * r && length + s < (1.0 + out) * r && row.iter().all(even)
}
