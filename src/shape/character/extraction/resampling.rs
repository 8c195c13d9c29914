//! Nodes at even distances along the branches.
//!
//! Ends and junctions stay; between them a branch of length `l` gets `round(l / spacing)` segments of equal length along the polyline.
//! Each old node hands the vertices that belong to it to the new node nearest along the branch. Where the curve is led round what is
//! outside, nodes come closer; those that it does not need are taken away.

use super::aabb::AabbTree;
use super::web::{Branch, Web};

/// A node is close to its two neighbors where the way between these is less than this many spacings.
const CLOSE: f64 = 1.25;

/// The same curve with nodes `spacing` apart, of a loop at least three.
pub(super) fn resample(web: &Web, spacing: f64) -> Web {
    let mut nodes = Vec::new();
    let mut pinned = Vec::new();
    let mut edges = Vec::new();
    let mut number = vec![u32::MAX; web.nodes.len()];
    let keep = |v: u32, nodes: &mut Vec<_>, pinned: &mut Vec<bool>| {
        nodes.push(web.nodes[v as usize]);
        pinned.push(web.pinned[v as usize]);
        nodes.len() as u32 - 1
    };
    for v in web.alive().filter(|v| web.degree(*v) != 2) {
        number[v as usize] = keep(v, &mut nodes, &mut pinned);
    }
    for branch in web.branches() {
        let (first, last) = (branch[0], branch[branch.len() - 1]);
        if number[first as usize] == u32::MAX {
            number[first as usize] = keep(first, &mut nodes, &mut pinned);
        }
        let lengths = lengths(web, &branch);
        let total = lengths[lengths.len() - 1];
        let least = if first == last { 3.0 } else { 1.0 };
        let parts = (total / spacing).round().max(least) as usize;
        let mut row = vec![number[first as usize]];
        for k in 1..parts {
            let at = total * k as f64 / parts as f64;
            let i = lengths.partition_point(|l| *l <= at).clamp(1, branch.len() - 1);
            let (a, b) = (web.nodes[branch[i - 1] as usize], web.nodes[branch[i] as usize]);
            let span = lengths[i] - lengths[i - 1];
            let share = if span > 0.0 { (at - lengths[i - 1]) / span } else { 0.0 };
            row.push(nodes.len() as u32);
            nodes.push(a + (b - a) * share);
            pinned.push(false);
        }
        row.push(number[last as usize]);
        edges.extend(row.windows(2).map(|w| [w[0], w[1]]));
        for (v, l) in branch.iter().zip(&lengths).take(branch.len() - 1).skip(1) {
            let k = if total > 0.0 { (l / total * parts as f64).round() as usize } else { 0 };
            number[*v as usize] = row[k.min(parts)];
        }
    }
    let node_of_vertex = (0..web.vertex_count()).map(|v| number[web.node_of(v) as usize]).collect();
    let mut result = Web::new(nodes, &edges, node_of_vertex);
    result.pinned = pinned;
    result
}

/// Takes nodes away that are close to their two neighbors, as far as the line between these stays inside.
pub(super) fn thin(web: &mut Web, tree: &AabbTree, spacing: f64) {
    for v in web.alive().collect::<Vec<_>>() {
        let [a, b] = *web.neighbors(v) else { continue };
        let [p, q] = [a, b].map(|v| web.nodes[v as usize]);
        let near = web.length(a, v) + web.length(v, b) < CLOSE * spacing;
        if near && !web.pinned[v as usize] && !web.neighbors(a).contains(&b) && !tree.is_hit(&p, &(q - p), 1.0) {
            web.merge(v, if web.length(a, v) < web.length(v, b) { a } else { b });
        }
    }
}

/// Length along a branch up to each of its nodes.
fn lengths(web: &Web, branch: &Branch) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = vec![0.0];
    for w in branch.windows(2) {
        sum += web.length(w[0], w[1]);
        all.push(sum);
    }
    all
}
