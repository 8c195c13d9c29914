//! The curve is drawn to where it is seen from the surface.
//!
//! A place of the surface should see the point of the curve nearest to it. Where a limb lies close beside a trunk, a flank is nearer to
//! the curve of the limb, which it does not see. For such a place `p`, with the nearest node `s` hidden and `u` the nearest one in sight,
//! `u` is drawn toward `p` until it is as near as `s`. Steps are evened out along the curve, and no node goes farther from the middle than a
//! share of the radius there: the curve gives up a little of its middle for the sight of its whole surface.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::centering::radius;
use super::error::ExtractionError;
use super::fairing::Fairing;
use super::kd_tree::KdTree;
use super::order::Cost;
use super::web::Web;

/// Times that it is drawn.
const PASSES: usize = 8;
/// Over how many radii steps agree.
const AGREE: f64 = 0.2;
/// Over how many radii the whole way is evened out at last.
const EVEN: f64 = 0.1;
/// Nodes that are tried for the nearest one in sight.
const TRIED: usize = 40;
/// How far a node goes from the middle, in radii.
const FARTHEST: f64 = 0.5;
/// How much nearer than the hidden one the node in sight shall be.
const MARGIN: f64 = 0.05;

/// Draws the curve to places that do not see it.
pub(super) fn draw(web: &mut Web, tree: &AabbTree, places: &[Point3<f64>]) -> Result<(), ExtractionError> {
    let alive: Vec<u32> = web.alive().collect();
    let middle = web.nodes.clone();
    let radii: Vec<f64> = middle.iter().map(|p| radius(tree, p)).collect();
    let mut hidden = places.to_vec();
    for pass in 0..PASSES {
        if pass == PASSES / 2 {
            // What has moved may have hidden others.
            hidden = places.to_vec();
        }
        let Some(mut steps) = steps(web, tree, &alive, &mut hidden) else { break };
        Fairing::new(web, &alive, &radii, AGREE, |_| false)?.apply(&mut steps);
        let free = |v: &u32| !web.pinned[*v as usize] && web.degree(*v) > 1;
        let free: Vec<usize> = alive.iter().filter(|v| free(v)).map(|v| *v as usize).collect();
        for v in free {
            let off = web.nodes[v] + steps[v] - middle[v];
            let most = FARTHEST * radii[v];
            web.nodes[v] = middle[v] + off * (most / off.norm().max(most));
        }
    }
    // Steps of single places leave corners.
    let mut off: Vec<Vector3<f64>> = web.nodes.iter().zip(&middle).map(|(p, m)| p - m).collect();
    Fairing::new(web, &alive, &radii, EVEN, |_| false)?.apply(&mut off);
    let pinned = web.pinned.clone();
    for v in alive.iter().map(|v| *v as usize).filter(|v| !pinned[*v]) {
        web.nodes[v] = middle[v] + off[v];
    }
    Ok(())
}

/// The longest step that is wanted of each node, and the places for which; `None` where all is seen.
fn steps(web: &Web, tree: &AabbTree, alive: &[u32], places: &mut Vec<Point3<f64>>) -> Option<Vec<Vector3<f64>>> {
    let nodes: Vec<Point3<f64>> = alive.iter().map(|v| web.nodes[*v as usize]).collect();
    let near = KdTree::new(&nodes);
    let mut steps = vec![Vector3::zeros(); web.nodes.len()];
    let mut any = false;
    let hidden = |p: &Point3<f64>| near.nearest(p, |_| true).is_some_and(|(s, _)| !sees(tree, p, &nodes[s as usize]));
    places.retain(hidden);
    for p in places.iter() {
        let Some((_, square)) = near.nearest(p, |_| true) else { continue };
        let Some(u) = in_sight(tree, p, &nodes, square.sqrt()) else { continue };
        let (to, far) = (p - nodes[u], nalgebra::distance(p, &nodes[u]));
        let step = to * (1.0 - (1.0 - MARGIN) * square.sqrt() / far);
        let own = &mut steps[alive[u] as usize];
        if step.norm_squared() > own.norm_squared() {
            *own = step;
            any = true;
        }
    }
    any.then_some(steps)
}

/// The nearest node that is seen from `p`, within twice the distance of the hidden one.
fn in_sight(tree: &AabbTree, p: &Point3<f64>, nodes: &[Point3<f64>], hidden: f64) -> Option<usize> {
    let mut by_distance: Vec<(Cost, usize)> =
        nodes.iter().enumerate().map(|(i, q)| (Cost::new(nalgebra::distance(p, q)), i)).collect();
    by_distance.retain(|(d, _)| *d < Cost::new(2.0 * hidden));
    by_distance.sort_unstable();
    let every = by_distance.len().div_ceil(TRIED).max(1);
    by_distance.into_iter().step_by(every).map(|(_, i)| i).find(|i| sees(tree, p, &nodes[*i]))
}

/// True where nothing but the surface at `p` itself lies between.
fn sees(tree: &AabbTree, p: &Point3<f64>, q: &Point3<f64>) -> bool {
    // From the node outward: the first surface that is met is the one at `p`.
    !tree.is_hit(q, &(p - q), 1.0 - 1e-3)
}
