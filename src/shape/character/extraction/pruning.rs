//! Prunes insignificant branches and merges close junctions.
//!
//! Bumps and the edges of thick sheets leave short branches. With `c` and `s` the position and radius of an end, its ball extends beyond the
//! balls of the rest of the curve, with centers `u` and radii `r_u`, by
//!
//! `b = s + min_u (‖c − u‖ − r_u)`.
//!
//! A branch is pruned if `b < prune · w`, with `w` the half-width at its end: half the longest chord across it. On a round limb `w = s`, and
//! `prune = 1` means that the end is inside a ball of the rest; folds of lips and corners of hooves extend slightly more, fingers and ears
//! twice that. The edge of a slab is as wide as the slab, and a branch toward it extends by less. The ratio is dimensionless and equal
//! for fingers and trunks. The branch with the smallest ratio goes first, since others may be less covered afterwards; its vertices go to
//! the junction. Pinned ends stay, and so does a branch that continues at the bend of a hairpin, unless its end is inside (`b < w`):
//! without the crown of a head the curve would run up the neck and back to the nose.
//!
//! Two junctions closer than a fraction of the larger radius merge, unless a loop would vanish.

use nalgebra::Vector3;

use super::aabb::AabbTree;
use super::curve_graph::{Branch, CurveGraph};
use super::order::Cost;
use plumbline_num::run::{Run, Stopped};

/// Number of chords across an end.
const CHORDS: usize = 8;
/// Number of planes tilted from perpendicular to the branch.
const TILTS: usize = 6;
/// Tangent of the tilt angle (39°).
const TILT_TANGENT: f64 = 0.8;

/// Number of covered branches of which one goes at a time: of more, the most covered ones go together. Figures have fewer; a ball of
/// five thousand spikes would compare every branch with every node thousands of times.
const BRANCHES_PER_BATCH: usize = 64;
/// Number of comparisons of a branch with a node after which all covered branches go together: about ten seconds.
const MAX_COMPARISONS: usize = 1_000_000_000;

/// Angle below which two branches form a hairpin, rad (60°).
const MAX_HAIRPIN_ANGLE: f64 = 1.05;

/// Prunes covered branches; `radii` are the distances of the nodes to the surface.
pub(super) fn prune(
    graph: &mut CurveGraph,
    tree: &AabbTree,
    radii: &[f64],
    prune: f64,
    run: &Run,
) -> Result<(), Stopped> {
    let mut widths = std::collections::HashMap::new();
    let mut left = MAX_COMPARISONS;
    loop {
        let mut covered: Vec<(Cost, Branch)> = Vec::new();
        for branch in graph.limbs() {
            run.check()?;
            let (junction, end) = (branch[0], branch[branch.len() - 1]);
            let width =
                *widths.entry((junction, end)).or_insert_with(|| half_width(graph, tree, &branch, radii[end as usize]));
            let out = Cost::new(sticks_out(graph, &branch, radii).0 / width.max(f64::MIN_POSITIVE));
            left = left.saturating_sub(graph.nodes.len());
            let is_inside = out < Cost::new(1.0);
            if out < Cost::new(prune) && (is_inside || !leaves_a_hairpin(graph, &branch, radii[junction as usize])) {
                covered.push((out, branch));
            }
        }
        if covered.is_empty() {
            return Ok(());
        }
        let batch = if left == 0 { covered.len() } else { (covered.len() / BRANCHES_PER_BATCH).max(1) };
        covered.sort_by_key(|(out, _)| *out);
        // A junction that lost a branch may be none any more, and what was its other branch is now a part of a longer one.
        let mut touched = std::collections::HashSet::new();
        for (_, branch) in covered.into_iter().take(batch) {
            if touched.insert(branch[0]) {
                graph.remove_branch(&branch);
            }
        }
    }
}

/// Whether a branch continues at the bend of two others that run side by side.
fn leaves_a_hairpin(graph: &CurveGraph, branch: &[u32], radius: f64) -> bool {
    let junction = branch[0];
    let others: Vec<u32> = graph.neighbors(junction).iter().copied().filter(|v| *v != branch[1]).collect();
    let [a, b] = others[..] else { return false };
    match [a, b].map(|to| direction(graph, junction, to, radius)) {
        [Some(a), Some(b)] => a.angle(&b) < MAX_HAIRPIN_ANGLE,
        _ => false,
    }
}

/// Vector from a node to the first node at distance `reach` on the branch toward `to`; `None` if the branch is shorter.
fn direction(graph: &CurveGraph, from: u32, to: u32, reach: f64) -> Option<Vector3<f64>> {
    let row = graph.row(from, to, reach);
    let at = row[row.len() - 1];
    (graph.length(from, at) >= reach).then(|| graph.nodes[at as usize] - graph.nodes[from as usize])
}

/// Extent of the end ball of a branch beyond the balls of the rest of the curve, and the node of the ball that covers it most.
pub(super) fn sticks_out(graph: &CurveGraph, branch: &[u32], radii: &[f64]) -> (f64, u32) {
    let last = branch[branch.len() - 1];
    let end = graph.nodes[last as usize];
    let mut own = branch[1..].to_vec();
    own.sort_unstable();
    let rest = graph.alive().filter(|v| own.binary_search(v).is_err());
    let beyond = |v: u32| nalgebra::distance(&end, &graph.nodes[v as usize]) - radii[v as usize];
    let base = rest.min_by_key(|v| (Cost::new(beyond(*v)), *v)).unwrap_or(branch[0]);
    (beyond(base) + radii[last as usize], base)
}

/// Half the longest chord across a branch at its end, at least its radius there; the least over slightly tilted planes.
fn half_width(graph: &CurveGraph, tree: &AabbTree, branch: &[u32], radius: f64) -> f64 {
    let end = graph.nodes[branch[branch.len() - 1] as usize];
    let mut before = branch.iter().rev().map(|v| graph.nodes[*v as usize]);
    let from = before.find(|p| nalgebra::distance(p, &end) >= radius).unwrap_or(graph.nodes[branch[0] as usize]);
    let Some(along) = (end - from).try_normalize(1e-12).filter(|_| !tree.is_exhausted()) else { return radius };
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let around = |k: usize, of: usize| {
        let angle = std::f64::consts::TAU * k as f64 / of as f64;
        side * angle.cos() + other * angle.sin()
    };
    let tilted = (0..TILTS).map(|k| along + around(k, TILTS) * TILT_TANGENT);
    let widest = |axis: Vector3<f64>| {
        let axis = axis.normalize();
        let chord = |k: usize| {
            let across = around(k, 2 * CHORDS);
            let across = (across - axis * across.dot(&axis)).normalize();
            let half_chords = [across, -across].map(|d| tree.first_hit(&end, &d).unwrap_or(0.0));
            0.5 * (half_chords[0] + half_chords[1])
        };
        (0..CHORDS).map(chord).fold(radius, f64::max)
    };
    std::iter::once(along).chain(tilted).map(widest).fold(f64::INFINITY, f64::min)
}

/// Merges close junctions.
pub(super) fn join_junctions(graph: &mut CurveGraph, radii: &[f64], share: f64, run: &Run) -> Result<(), Stopped> {
    let radius = |v: u32| radii[v as usize];
    loop {
        let mut nearest: Option<(Cost, Vec<u32>)> = None;
        for branch in graph.branches() {
            run.check()?;
            let (a, b) = (branch[0], branch[branch.len() - 1]);
            if a == b || graph.degree(a) < 3 || graph.degree(b) < 3 {
                continue;
            }
            let length = graph.branch_length(&branch);
            let widest = radius(a).max(radius(b));
            let rank = Cost::new(length / widest);
            if length < share * widest
                && !closes_a_loop(graph, &branch)
                && nearest.as_ref().is_none_or(|(least, _)| rank < *least)
            {
                nearest = Some((rank, branch));
            }
        }
        let Some((_, branch)) = nearest else { return Ok(()) };
        let (a, b) = (branch[0], branch[branch.len() - 1]);
        let (inner, keep) = if radius(a) >= radius(b) {
            (branch[1..].to_vec(), a)
        } else {
            let mut rest = branch.clone();
            rest.pop();
            rest.reverse();
            (rest, b)
        };
        for v in inner {
            graph.merge(v, keep);
        }
    }
}

/// Whether another branch connects the same junctions, or a node is adjacent to both: merging would remove the loop.
fn closes_a_loop(graph: &CurveGraph, branch: &[u32]) -> bool {
    let (a, b) = (branch[0], branch[branch.len() - 1]);
    let (mut inner, others) = (branch.to_vec(), graph.branches());
    inner.sort_unstable();
    others.iter().any(|other| {
        let ends = (other[0], other[other.len() - 1]);
        let mut same = other.clone();
        same.sort_unstable();
        same != inner && (ends == (a, b) || ends == (b, a)) && other.len() <= 3
    }) || graph.neighbors(a).iter().any(|v| !branch.contains(v) && graph.neighbors(b).contains(v))
}
