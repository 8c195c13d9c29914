//! Removes detours of the curve.
//!
//! A pinned tip holds the surface during contraction; if it turns out to be no end, the curve still goes there and back. With `r` the
//! distance to the surface, the cost of a path is
//!
//! `∫ ds / r`,
//!
//! which is least along the medial axis. Between two nodes of a branch the curve takes the straight segment if it is inside, costs less than
//! a fraction of the path along the branch, and the balls along it cover all skipped nodes: an excursion to a head represents the head. The
//! shortest such path along each branch is found by dynamic programming.
//!
//! # Reference
//! L. Antiga, B. Ene-Iordache, A. Remuzzi, *Computational geometry for patient-specific reconstruction and meshing of blood vessels from MR
//! and CT angiography*, IEEE Trans. Medical Imaging 22 (2003), section II-C: the cost.

use nalgebra::Point3;

use super::aabb::AabbTree;
use super::centering::radius;
use super::curve_graph::{Branch, CurveGraph};
use plumbline_num::run::{Run, Stopped};

/// Cost ratio by which a segment must improve on the path.
const MIN_GAIN: f64 = 1.5;
/// Length of the quadrature intervals of a segment, in radii at its first node.
const INTERVAL_RADII: f64 = 0.5;
/// Largest number of quadrature intervals.
const MAX_INTERVALS: usize = 16;
/// Lower bound of the distance to the surface in the cost.
const MIN_RADIUS: f64 = 1e-3;

/// Removes detours of all branches; `radii` are the distances of the nodes to the surface.
pub(super) fn cut(graph: &mut CurveGraph, tree: &AabbTree, radii: &[f64], run: &Run) -> Result<(), Stopped> {
    for branch in graph.branches() {
        run.check()?;
        let kept = shortest(graph, tree, radii, &branch, run)?;
        for pair in kept.windows(2) {
            bridge(graph, &branch[pair[0]..=pair[1]]);
        }
    }
    Ok(())
}

/// Merges the inner nodes of a row into the nearer of its two ends, which become adjacent.
fn bridge(graph: &mut CurveGraph, row: &[u32]) {
    let (first, last) = (0, row.len() - 1);
    let half = last.div_ceil(2);
    (1..half).for_each(|k| graph.merge(row[k], row[first]));
    (half..last).rev().for_each(|k| graph.merge(row[k], row[last]));
}

/// Indices in a branch of the nodes on the cheapest path along it.
fn shortest(
    graph: &CurveGraph,
    tree: &AabbTree,
    radii: &[f64],
    branch: &Branch,
    run: &Run,
) -> Result<Vec<usize>, Stopped> {
    let positions: Vec<Point3<f64>> = branch.iter().map(|v| graph.nodes[*v as usize]).collect();
    let radii: Vec<f64> = branch.iter().map(|v| radii[*v as usize].max(MIN_RADIUS)).collect();
    let mut length = vec![0.0; positions.len()];
    let mut cost = vec![0.0; positions.len()];
    let mut before: Vec<usize> = (0..positions.len()).map(|j| j.saturating_sub(1)).collect();
    // Number of pinned nodes before each.
    let pinned = |sum: &mut usize, v: &u32| {
        *sum += usize::from(graph.pinned[*v as usize]);
        Some(*sum)
    };
    let pinned: Vec<usize> = std::iter::once(0).chain(branch.iter().scan(0, pinned)).collect();
    for j in 1..positions.len() {
        run.check()?;
        let step = nalgebra::distance(&positions[j - 1], &positions[j]);
        length[j] = length[j - 1] + step;
        cost[j] = cost[j - 1] + 0.5 * step * (1.0 / radii[j - 1] + 1.0 / radii[j]);
        for i in 0..j.saturating_sub(1) {
            let direct = MIN_GAIN * nalgebra::distance(&positions[i], &positions[j]);
            let fixed = pinned[j] > pinned[i + 1];
            if fixed || branch[i] == branch[j] || length[j] - length[i] <= direct || tree.is_exhausted() {
                continue;
            }
            let line =
                MIN_GAIN * line_cost(tree, (&positions[i], radii[i]), (&positions[j], radii[j]), &positions[i + 1..j]);
            if cost[i] + line < cost[j] {
                cost[j] = cost[i] + line;
                before[j] = i;
            }
        }
    }
    let mut kept = vec![positions.len() - 1];
    while let Some(j) = kept.last().copied().filter(|j| *j > 0) {
        kept.push(before[j]);
    }
    kept.reverse();
    Ok(kept)
}

/// Cost of a segment; infinite if it leaves the inside or if a skipped node is not covered by the balls along it.
fn line_cost(
    tree: &AabbTree,
    (p, r): (&Point3<f64>, f64),
    (q, s): (&Point3<f64>, f64),
    left_out: &[Point3<f64>],
) -> f64 {
    let along = q - p;
    if tree.first_hit(p, &along).is_some_and(|t| t <= 1.0) {
        return f64::INFINITY;
    }
    let pieces = (along.norm() / (INTERVAL_RADII * r.min(s))).ceil().clamp(1.0, MAX_INTERVALS as f64) as usize;
    let inner = (1..pieces).map(|k| p + along * (k as f64 / pieces as f64)).map(|c| (c, radius(tree, &c)));
    let balls: Vec<(Point3<f64>, f64)> = std::iter::once((*p, r)).chain(inner).chain([(*q, s)]).collect();
    let is_covered = |x: &Point3<f64>| balls.iter().any(|(c, r)| nalgebra::distance(x, c) <= *r);
    if !left_out.iter().all(is_covered) {
        return f64::INFINITY;
    }
    let over = |(_, r): &(Point3<f64>, f64)| 1.0 / r.max(MIN_RADIUS);
    let mean = |pair: &[(Point3<f64>, f64)]| 0.5 * (over(&pair[0]) + over(&pair[1]));
    along.norm() / pieces as f64 * balls.windows(2).map(mean).sum::<f64>()
}
