//! The curve is drawn to where it is seen from the surface.
//!
//! A place of the surface should see the point of the curve nearest to it. Where a limb lies close beside a trunk, a flank is nearer to
//! the curve of the limb, which it does not see. For such a place `p`, with the nearest node `s` hidden and `u` the nearest one in sight,
//! `u` is drawn toward `p` until it is as near as `s`. Steps are evened out along the curve, and no node goes farther from the middle than a
//! share of the radius there: the curve gives up a little of its middle for the sight of its whole surface.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::radii;
use super::error::ExtractionError;
use super::fairing::Fairing;
use super::order::Cost;
use super::web::Web;
use plumbline_num::run::Run;
use plumbline_num::spatial::KdTree;

/// Times that it is drawn.
const PASSES: usize = 8;
/// Over how many radii steps agree.
const AGREE: f64 = 0.2;
/// Over how many radii the whole way is evened out at last.
const EVEN: f64 = 0.1;
/// Nodes that are tried for the nearest one in sight.
const TRIED: usize = 40;
/// How far a node goes from the middle, in radii.
const MAX_OFFSET: f64 = 0.7;
/// How much nearer than the hidden one the node in sight shall be.
const MARGIN: f64 = 0.05;

/// Draws the curve to places that do not see it.
pub(super) fn draw(web: &mut Web, tree: &AabbTree, places: &[Point3<f64>], run: &Run) -> Result<(), ExtractionError> {
    let alive: Vec<u32> = web.alive().collect();
    let middle = web.nodes.clone();
    let radii = radii(web, tree);
    let mut hidden = places.to_vec();
    for pass in 0..PASSES {
        run.check()?;
        if pass == PASSES / 2 {
            // What has moved may have hidden others.
            hidden = places.to_vec();
        }
        let clear: Vec<f64> =
            (0..radii.len()).map(|v| radii[v] - nalgebra::distance(&web.nodes[v], &middle[v])).collect();
        let Some(mut steps) = steps(web, tree, (&alive, &clear), &mut hidden) else { break };
        Fairing::new(web, &alive, &radii, AGREE, |_| false, run)?.apply(&mut steps);
        let free = |v: &u32| !web.pinned[*v as usize] && web.degree(*v) > 1;
        let free: Vec<usize> = alive.iter().filter(|v| free(v)).map(|v| *v as usize).collect();
        for v in free {
            let off = web.nodes[v] + steps[v] - middle[v];
            let most = MAX_OFFSET * radii[v];
            web.nodes[v] = middle[v] + off * (most / off.norm().max(most));
        }
    }
    // Steps of single places leave corners.
    let mut off: Vec<Vector3<f64>> = web.nodes.iter().zip(&middle).map(|(p, m)| p - m).collect();
    Fairing::new(web, &alive, &radii, EVEN, |_| false, run)?.apply(&mut off);
    let pinned = web.pinned.clone();
    for v in alive.iter().map(|v| *v as usize).filter(|v| !pinned[*v]) {
        web.nodes[v] = middle[v] + off[v];
    }
    Ok(())
}

/// The longest step that is wanted of each node, and the places for which; `None` where all is seen. About each node nothing is nearer
/// than `clear`.
fn steps(
    web: &Web,
    tree: &AabbTree,
    (alive, clear): (&[u32], &[f64]),
    places: &mut Vec<Point3<f64>>,
) -> Option<Vec<Vector3<f64>>> {
    let nodes: Vec<Point3<f64>> = alive.iter().map(|v| web.nodes[*v as usize]).collect();
    let sees = |p: &Point3<f64>, node: usize| sees(tree, p, &nodes[node], clear[alive[node] as usize]);
    let near = KdTree::new(&nodes);
    let mut steps = vec![Vector3::zeros(); web.nodes.len()];
    let mut any = false;
    places.retain(|p| {
        let Some((s, square)) = near.nearest(p, |_| true) else { return false };
        if sees(p, s as usize) {
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
    any.then_some(steps)
}

/// The nearest node that is seen from `p`, within twice the distance of the hidden one.
fn in_sight(p: &Point3<f64>, nodes: &[Point3<f64>], hidden: f64, sees: &dyn Fn(usize) -> bool) -> Option<usize> {
    let mut by_distance: Vec<(Cost, usize)> =
        nodes.iter().enumerate().map(|(i, q)| (Cost::new(nalgebra::distance(p, q)), i)).collect();
    by_distance.retain(|(d, _)| *d < Cost::new(2.0 * hidden));
    by_distance.sort_unstable();
    let every = by_distance.len().div_ceil(TRIED).max(1);
    by_distance.into_iter().step_by(every).map(|(_, i)| i).find(|i| sees(*i))
}

/// True where nothing but the surface at `p` itself lies between it and `q`, about which nothing is nearer than `clear`.
fn sees(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>, clear: f64) -> bool {
    // From the node outward: the first surface that is met is the one at `p`.
    let (way, until) = (p - q, 1.0 - 1e-3);
    let from = (clear / way.norm()).clamp(0.0, until);
    from == until || !tree.is_hit(&(q + way * from), &way, until - from)
}
