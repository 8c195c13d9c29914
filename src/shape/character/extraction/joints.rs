//! Joints on a curve: a few nodes that represent its shape.
//!
//! Ends and junctions are joints; where a branch deviates from the segment between two joints by more than a fraction of the local radius, the
//! farthest node becomes one (Douglas–Peucker with relative tolerance). With a prescribed number of joints, bends are added in descending
//! order of deviation. The root of each component is the joint nearest to the centroid of its nodes, weighted by cubed radii: the center of
//! volume. Skeletons are trees: a loop is cut at the joint where the paths from the root meet. Joints are in the order of the limbs, each from
//! the body outward.
//!
//! # Reference
//! D. H. Douglas, T. K. Peucker, *Algorithms for the reduction of the number of points required to represent a digitized line*,
//! Cartographica 10 (1973).

use nalgebra::{Point3, Vector3};

use super::curve_graph::{Branch, CurveGraph};
use super::order::Cost;
use crate::character::{CharacterError, CurveSkeleton, Joint, Skeleton};
use plumbline_num::math::Trs;
use plumbline_num::spatial::UnionFind;

/// Deviation above which a bend is a joint, in local radii: visible on a limb of that thickness.
const BEND_TOLERANCE: f64 = 0.4;

/// The skeleton of a curve. `count` prescribes the approximate number of joints, at least the ends and junctions.
///
/// # Errors
/// [`CharacterError`]: a curve without nodes, or with more joints than a skeleton supports.
pub fn skeleton_of(curve: &CurveSkeleton, count: Option<usize>) -> Result<Skeleton, CharacterError> {
    let graph = CurveGraph::new(curve.nodes.clone(), &curve.edges, Vec::new());
    let radius = |v: u32| curve.radius.get(v as usize).copied().unwrap_or(0.0);
    let branches = graph.branches();
    let chosen = chosen(&graph, &branches, &radius, count);
    let mut links: Vec<Vec<u32>> = vec![Vec::new(); curve.nodes.len()];
    for branch in &branches {
        let stops: Vec<u32> = branch.iter().copied().filter(|v| chosen[*v as usize]).collect();
        for pair in stops.windows(2).filter(|pair| pair[0] != pair[1]) {
            links[pair[0] as usize].push(pair[1]);
            links[pair[1] as usize].push(pair[0]);
        }
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut number = vec![u32::MAX; curve.nodes.len()];
    for root in roots(&graph, &chosen, &links, &radius) {
        hang(curve, root, &links, &mut number, &mut joints);
    }
    Skeleton::new(joints)
}

/// Which nodes are joints.
fn chosen(graph: &CurveGraph, branches: &[Branch], radius: &dyn Fn(u32) -> f64, count: Option<usize>) -> Vec<bool> {
    let mut chosen: Vec<bool> = (0..graph.nodes.len() as u32).map(|v| graph.degree(v) != 2).collect();
    let mut spans: Vec<(Cost, usize, usize, usize, usize)> = Vec::new();
    for (b, branch) in branches.iter().enumerate() {
        let last = branch.len() - 1;
        for i in [0, last] {
            chosen[branch[i] as usize] = true;
        }
        // A loop needs at least three segments.
        let cuts = if branch[0] == branch[last] { vec![0, last / 3, 2 * last / 3, last] } else { vec![0, last] };
        for i in &cuts {
            chosen[branch[*i] as usize] = true;
        }
        for pair in cuts.windows(2) {
            spans.extend(worst(graph, branch, pair[0], pair[1], radius).map(|(c, i)| (c, b, pair[0], i, pair[1])));
        }
    }
    let mut joints = chosen.iter().filter(|c| **c).count();
    while let Some(at) = (0..spans.len()).max_by_key(|i| (spans[*i].0, std::cmp::Reverse(*i))) {
        let (cost, b, from, i, to) = spans.swap_remove(at);
        let wanted = count.map_or(cost > Cost::new(BEND_TOLERANCE), |count| joints < count);
        if !wanted {
            break;
        }
        chosen[branches[b][i] as usize] = true;
        joints += 1;
        for (from, to) in [(from, i), (i, to)] {
            spans.extend(worst(graph, &branches[b], from, to, radius).map(|(c, i)| (c, b, from, i, to)));
        }
    }
    chosen
}

/// The node of a span with the largest deviation from its segment, in radii; for straight spans the middle one.
fn worst(
    graph: &CurveGraph,
    branch: &[u32],
    from: usize,
    to: usize,
    radius: &dyn Fn(u32) -> f64,
) -> Option<(Cost, usize)> {
    let (a, b) = (graph.nodes[branch[from] as usize], graph.nodes[branch[to] as usize]);
    let along = b - a;
    let middle = usize::midpoint(from, to);
    let off = |i: usize| {
        let p = graph.nodes[branch[i] as usize];
        let t =
            if along.norm_squared() > 0.0 { ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
        let distance = (p - (a + along * t)).norm();
        let size = radius(branch[i]);
        if size > 0.0 { distance / size } else { distance }
    };
    (from + 1..to).map(|i| (Cost::new(off(i)), i)).max_by_key(|(c, i)| (*c, std::cmp::Reverse(i.abs_diff(middle))))
}

/// The root of each connected component.
fn roots(graph: &CurveGraph, chosen: &[bool], links: &[Vec<u32>], radius: &dyn Fn(u32) -> f64) -> Vec<u32> {
    let mut pieces = UnionFind::new(graph.nodes.len());
    for (v, u) in links.iter().zip(0..).flat_map(|(to, v)| to.iter().map(move |u| (v, *u))) {
        pieces.join(v, u);
    }
    let piece = pieces.roots();
    let joints = || (0..graph.nodes.len() as u32).filter(|v| chosen[*v as usize]);
    let root = |first: u32| {
        let center = volume_center(graph, first, radius);
        let near = |v: &u32| (Cost::new(nalgebra::distance(&graph.nodes[*v as usize], &center)), *v);
        joints().filter(|v| piece[*v as usize] == first).min_by_key(near)
    };
    joints().filter(|v| piece[*v as usize] == *v).filter_map(root).collect()
}

/// Centroid of the nodes connected to `start`, weighted by cubed radii.
fn volume_center(graph: &CurveGraph, start: u32, radius: &dyn Fn(u32) -> f64) -> Point3<f64> {
    let origin = graph.nodes[start as usize];
    let mut seen = std::collections::BTreeSet::from([start]);
    let mut stack = vec![start];
    let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
    while let Some(v) = stack.pop() {
        let w = radius(v).powi(3).max(f64::MIN_POSITIVE);
        sum += (graph.nodes[v as usize] - origin) * w;
        weight += w;
        stack.extend(graph.neighbors(v).iter().copied().filter(|u| seen.insert(*u)));
    }
    origin + sum / weight
}

/// Adds the joints of a component along its limbs: each joint is followed by the limbs that go from it, the longest first, and each of them
/// from its begin to its end. Parents are those of a breadth-first search, which cuts a loop where the paths from the root meet.
fn hang(curve: &CurveSkeleton, root: u32, links: &[Vec<u32>], number: &mut [u32], joints: &mut Vec<Joint>) {
    const SEEN: u32 = u32::MAX - 1;
    let (mut order, mut next) = (vec![(root, None::<usize>)], 0);
    number[root as usize] = SEEN;
    while next < order.len() {
        for &u in &links[order[next].0 as usize] {
            if number[u as usize] == u32::MAX {
                number[u as usize] = SEEN;
                order.push((u, Some(next)));
            }
        }
        next += 1;
    }
    let length =
        |k: usize, p: usize| nalgebra::distance(&curve.nodes[order[k].0 as usize], &curve.nodes[order[p].0 as usize]);
    // Longest path below each joint, and its children.
    let (mut below, mut children) = (vec![0.0_f64; order.len()], vec![Vec::new(); order.len()]);
    for k in (0..order.len()).rev() {
        let Some(p) = order[k].1 else { continue };
        below[p] = below[p].max(below[k] + length(k, p));
        children[p].push(k);
    }
    let mut stack = vec![0];
    while let Some(k) = stack.pop() {
        let (v, from) = order[k];
        let parent = from.map(|p| number[order[p].0 as usize]);
        let position = curve.nodes[v as usize];
        let offset = from.map_or(position.coords, |p| position - curve.nodes[order[p].0 as usize]);
        let j = joints.len() as u32;
        number[v as usize] = j;
        let name = if parent.is_none() && j == 0 { "root".to_owned() } else { format!("joint_{j}") };
        joints.push(Joint { name, parent, rest: Trs::from_translation(offset), limits: None });
        children[k].sort_by_key(|&c| (Cost::new(below[c] + length(c, k)), std::cmp::Reverse(c)));
        stack.append(&mut children[k]);
    }
}
