//! Uniform resampling of branches.
//!
//! Ends and junctions stay; a branch of length `l` gets `round(l / spacing)` segments of equal length along the polyline. Vertices of each old
//! node go to the nearest new node along the branch. Detours around the outside leave denser nodes; unnecessary ones are removed.

use super::aabb::AabbTree;
use super::curve_graph::{Branch, CurveGraph};

/// A node is redundant if the path between its neighbors is shorter than this many spacings.
const MAX_REDUNDANT_SPACINGS: f64 = 1.25;

/// The same curve with nodes `spacing` apart; at least three on a loop.
pub(super) fn resample(graph: &CurveGraph, spacing: f64) -> CurveGraph {
    let mut nodes = Vec::new();
    let mut pinned = Vec::new();
    let mut edges = Vec::new();
    let mut number = vec![u32::MAX; graph.nodes.len()];
    let keep = |v: u32, nodes: &mut Vec<_>, pinned: &mut Vec<bool>| {
        nodes.push(graph.nodes[v as usize]);
        pinned.push(graph.pinned[v as usize]);
        nodes.len() as u32 - 1
    };
    for v in graph.alive().filter(|v| graph.degree(*v) != 2) {
        number[v as usize] = keep(v, &mut nodes, &mut pinned);
    }
    for branch in graph.branches() {
        let (first, last) = (branch[0], branch[branch.len() - 1]);
        if number[first as usize] == u32::MAX {
            number[first as usize] = keep(first, &mut nodes, &mut pinned);
        }
        let lengths = lengths(graph, &branch);
        let total = lengths[lengths.len() - 1];
        let least = if first == last { 3.0 } else { 1.0 };
        let parts = (total / spacing).round().max(least) as usize;
        let mut row = vec![number[first as usize]];
        for k in 1..parts {
            let at = total * k as f64 / parts as f64;
            let i = lengths.partition_point(|l| *l <= at).clamp(1, branch.len() - 1);
            let (a, b) = (graph.nodes[branch[i - 1] as usize], graph.nodes[branch[i] as usize]);
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
    let node_of_vertex = (0..graph.vertex_count()).map(|v| number[graph.node_of(v) as usize]).collect();
    let mut result = CurveGraph::new(nodes, &edges, node_of_vertex);
    result.pinned = pinned;
    result
}

/// Removes redundant nodes if the segment between their neighbors stays inside.
pub(super) fn thin(graph: &mut CurveGraph, tree: &AabbTree, spacing: f64) {
    for v in graph.alive().collect::<Vec<_>>() {
        let [a, b] = *graph.neighbors(v) else { continue };
        let [p, q] = [a, b].map(|v| graph.nodes[v as usize]);
        let near = graph.length(a, v) + graph.length(v, b) < MAX_REDUNDANT_SPACINGS * spacing;
        if near && !graph.pinned[v as usize] && !graph.neighbors(a).contains(&b) && !tree.is_hit(&p, &(q - p), 1.0) {
            graph.merge(v, if graph.length(a, v) < graph.length(v, b) { a } else { b });
        }
    }
}

/// Arc length at each node of a branch.
fn lengths(graph: &CurveGraph, branch: &Branch) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = vec![0.0];
    for w in branch.windows(2) {
        sum += graph.length(w[0], w[1]);
        all.push(sum);
    }
    all
}
