//! Detours of the curve are cut.
//!
//! A tip holds the surface while it contracts; where the tip turns out to be none, the curve still goes there and back. With `r` the
//! distance to the surface, the way along a line costs
//!
//! `∫ ds / r`,
//!
//! which the middle of the shape makes small. Between two nodes of a branch the curve takes the straight line where that stays inside, costs
//! less than a share of the way along the branch, and leaves out no node that is not in the balls about it: what goes there and back to a
//! head shows the head. Of all ways along a branch the one of the least cost is taken.
//!
//! # Reference
//! L. Antiga, B. Ene-Iordache, A. Remuzzi, *Computational geometry for patient-specific reconstruction and meshing of blood vessels from MR
//! and CT angiography*, IEEE Trans. Medical Imaging 22 (2003), section II-C: the cost.

use nalgebra::Point3;

use super::aabb::AabbTree;
use super::centering::radius;
use super::web::{Branch, Web};
use plumbline_num::run::{Run, Stopped};

/// A line costs this many times what it does before it is taken.
const GAIN: f64 = 1.5;
/// Lengths of the pieces by which the cost of a line is found, in radii at the node it starts from.
const PIECE: f64 = 0.5;
/// And how many at most.
const PIECES: usize = 16;
/// The distance to the surface counts as at least this.
const MIN_RADIUS: f64 = 1e-3;

/// Cuts detours of all branches; `radii` are the distances of the nodes to the surface.
pub(super) fn cut(web: &mut Web, tree: &AabbTree, radii: &[f64], run: &Run) -> Result<(), Stopped> {
    for branch in web.branches() {
        run.check()?;
        let kept = shortest(web, tree, radii, &branch);
        for pair in kept.windows(2) {
            bridge(web, &branch[pair[0]..=pair[1]]);
        }
    }
    Ok(())
}

/// Merges the inner nodes of a row into the nearer of its two ends, which are neighbors after.
fn bridge(web: &mut Web, row: &[u32]) {
    let (first, last) = (0, row.len() - 1);
    let half = last.div_ceil(2);
    (1..half).for_each(|k| web.merge(row[k], row[first]));
    (half..last).rev().for_each(|k| web.merge(row[k], row[last]));
}

/// Positions in a branch of the nodes by which the way along it is cheapest.
fn shortest(web: &Web, tree: &AabbTree, radii: &[f64], branch: &Branch) -> Vec<usize> {
    let places: Vec<Point3<f64>> = branch.iter().map(|v| web.nodes[*v as usize]).collect();
    let radii: Vec<f64> = branch.iter().map(|v| radii[*v as usize].max(MIN_RADIUS)).collect();
    let mut length = vec![0.0; places.len()];
    let mut cost = vec![0.0; places.len()];
    let mut before: Vec<usize> = (0..places.len()).map(|j| j.saturating_sub(1)).collect();
    for j in 1..places.len() {
        let step = nalgebra::distance(&places[j - 1], &places[j]);
        length[j] = length[j - 1] + step;
        cost[j] = cost[j - 1] + 0.5 * step * (1.0 / radii[j - 1] + 1.0 / radii[j]);
        for i in 0..j.saturating_sub(1) {
            let direct = GAIN * nalgebra::distance(&places[i], &places[j]);
            let held = branch[i + 1..j].iter().any(|v| web.pinned[*v as usize]);
            if held || branch[i] == branch[j] || length[j] - length[i] <= direct {
                continue;
            }
            let line = GAIN * line_cost(tree, (&places[i], radii[i]), (&places[j], radii[j]), &places[i + 1..j]);
            if cost[i] + line < cost[j] {
                cost[j] = cost[i] + line;
                before[j] = i;
            }
        }
    }
    let mut kept = vec![places.len() - 1];
    while let Some(j) = kept.last().copied().filter(|j| *j > 0) {
        kept.push(before[j]);
    }
    kept.reverse();
    kept
}

/// What a straight line costs; infinity where it leaves the inside, or where what it leaves out is not in the balls about it.
fn line_cost(
    tree: &AabbTree,
    (p, r): (&Point3<f64>, f64),
    (q, s): (&Point3<f64>, f64),
    left_out: &[Point3<f64>],
) -> f64 {
    let way = q - p;
    if tree.first_hit(p, &way).is_some_and(|t| t <= 1.0) {
        return f64::INFINITY;
    }
    let pieces = (way.norm() / (PIECE * r.min(s))).ceil().clamp(1.0, PIECES as f64) as usize;
    let inner = (1..pieces).map(|k| p + way * (k as f64 / pieces as f64)).map(|c| (c, radius(tree, &c)));
    let balls: Vec<(Point3<f64>, f64)> = std::iter::once((*p, r)).chain(inner).chain([(*q, s)]).collect();
    let is_covered = |x: &Point3<f64>| balls.iter().any(|(c, r)| nalgebra::distance(x, c) <= *r);
    if !left_out.iter().all(is_covered) {
        return f64::INFINITY;
    }
    let over = |(_, r): &(Point3<f64>, f64)| 1.0 / r.max(MIN_RADIUS);
    let mean = |pair: &[(Point3<f64>, f64)]| 0.5 * (over(&pair[0]) + over(&pair[1]));
    way.norm() / pieces as f64 * balls.windows(2).map(mean).sum::<f64>()
}
