//! Pulls the curve to where it is visible from the surface.
//!
//! A surface point should see the nearest point of the curve. Where a limb is close to a trunk, a flank is nearer to the hidden curve of the
//! limb. For such a point `p`, with `s` the nearest (hidden) node and `u` the nearest visible one, `u` is pulled toward `p` until it is as
//! near as `s`. Steps are smoothed along the curve, and nodes stay within a fraction of the local radius of the medial axis: the curve trades
//! a little centeredness for visibility.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::radii;
use super::curve_graph::CurveGraph;
use super::fairing::Fairing;
use super::order::Cost;
use crate::character::CharacterError;
use plumbline_num::run::{Run, Stopped};
use plumbline_num::spatial::KdTree;

/// Number of passes.
const PASSES: usize = 8;
/// Smoothing width of the steps, in radii.
const STEP_SMOOTHING_RADII: f64 = 0.2;
/// Smoothing width of the total displacement, in radii.
const FINAL_SMOOTHING_RADII: f64 = 0.1;
/// Largest number of candidates for the nearest visible node.
const MAX_CANDIDATES: usize = 40;
/// Largest distance of a node from its centered position, in radii.
const MAX_OFFSET: f64 = 0.7;
/// Relative margin by which the visible node must become nearer than the hidden one.
const MARGIN: f64 = 0.05;

/// Pulls the curve toward points that do not see it.
pub(super) fn draw(
    graph: &mut CurveGraph,
    tree: &AabbTree,
    positions: &[Point3<f64>],
    run: &Run,
) -> Result<(), CharacterError> {
    let alive: Vec<u32> = graph.alive().collect();
    let middle = graph.nodes.clone();
    let radii = radii(graph, tree);
    let mut hidden = positions.to_vec();
    for pass in 0..PASSES {
        run.check()?;
        if tree.is_exhausted() {
            break;
        }
        if pass == PASSES / 2 {
            // Moved nodes may hide others: check all points again.
            hidden = positions.to_vec();
        }
        let clear: Vec<f64> =
            (0..radii.len()).map(|v| radii[v] - nalgebra::distance(&graph.nodes[v], &middle[v])).collect();
        let Some(mut steps) = steps(graph, tree, (&alive, &clear), &mut hidden, run)? else { break };
        Fairing::new(graph, &alive, &radii, STEP_SMOOTHING_RADII, |_| false, run)?.apply(&mut steps);
        let free = |v: &u32| !graph.pinned[*v as usize] && graph.degree(*v) > 1;
        let free: Vec<usize> = alive.iter().filter(|v| free(v)).map(|v| *v as usize).collect();
        for v in free {
            let off = graph.nodes[v] + steps[v] - middle[v];
            let most = MAX_OFFSET * radii[v];
            graph.nodes[v] = middle[v] + off * (most / off.norm().max(most));
        }
    }
    // Steps for isolated points leave corners.
    let mut off: Vec<Vector3<f64>> = graph.nodes.iter().zip(&middle).map(|(p, m)| p - m).collect();
    Fairing::new(graph, &alive, &radii, FINAL_SMOOTHING_RADII, |_| false, run)?.apply(&mut off);
    let pinned = graph.pinned.clone();
    for v in alive.iter().map(|v| *v as usize).filter(|v| !pinned[*v]) {
        graph.nodes[v] = middle[v] + off[v];
    }
    Ok(())
}

/// The longest step requested of each node; retains the points that request one. `None` if all points see the curve. `clear` bounds the
/// distance to the surface from below.
fn steps(
    graph: &CurveGraph,
    tree: &AabbTree,
    (alive, clear): (&[u32], &[f64]),
    positions: &mut Vec<Point3<f64>>,
    run: &Run,
) -> Result<Option<Vec<Vector3<f64>>>, Stopped> {
    let nodes: Vec<Point3<f64>> = alive.iter().map(|v| graph.nodes[*v as usize]).collect();
    let sees = |p: &Point3<f64>, node: usize| sees(tree, p, &nodes[node], clear[alive[node] as usize]);
    let near = KdTree::new(&nodes);
    let mut steps = vec![Vector3::zeros(); graph.nodes.len()];
    let mut any = false;
    positions.retain(|p| {
        let Some((s, square)) = near.nearest(p, |_| true) else { return false };
        if tree.is_exhausted() || run.check().is_err() || sees(p, s as usize) {
            return false;
        }
        let hidden = square.sqrt();
        let Some(u) = in_sight(p, &nodes, hidden, &|node| sees(p, node)) else { return true };
        let to = p - nodes[u];
        let step = to * (1.0 - (1.0 - MARGIN) * hidden / to.norm());
        let own = &mut steps[alive[u] as usize];
        if step.norm_squared() > own.norm_squared() {
            *own = step;
            any = true;
        }
        true
    });
    run.complete(any.then_some(steps))
}

/// The nearest node visible from `p`, within twice the distance of the hidden one.
fn in_sight(p: &Point3<f64>, nodes: &[Point3<f64>], hidden: f64, sees: &dyn Fn(usize) -> bool) -> Option<usize> {
    let mut by_distance: Vec<(Cost, usize)> =
        nodes.iter().enumerate().map(|(i, q)| (Cost::new(nalgebra::distance(p, q)), i)).collect();
    by_distance.retain(|(d, _)| *d < Cost::new(2.0 * hidden));
    by_distance.sort_unstable();
    let every = by_distance.len().div_ceil(MAX_CANDIDATES).max(1);
    by_distance.into_iter().step_by(every).map(|(_, i)| i).find(|i| sees(*i))
}

/// Whether `q` is visible from the surface point `p`; the ball of radius `clear` around `q` is empty.
fn sees(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>, clear: f64) -> bool {
    // From the node outward: the last intersection is the surface at `p` itself, excluded by 1e-3.
    let (direction, until) = (p - q, 1.0 - 1e-3);
    let from = (clear / direction.norm()).clamp(0.0, until);
    from == until || !tree.is_hit(&(q + direction * from), &direction, until - from)
}
