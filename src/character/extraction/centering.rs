//! Brings the curve to the middle of the shape, as a whole.
//!
//! With `p` the point of the surface nearest to a node `c`, `r₁ = ‖c − p‖` and `r₂` how far the surface is on the other side, along the
//! ray from `p` through `c`,
//!
//! `c ← c + (r₂ − r₁)/2 · (c − p)/r₁`
//!
//! is the middle of that chord; repeated, it comes to rest at the center of a maximal inscribed ball. Node by node this would tear
//! the curve: neighbors in a wide part have other nearest sides and would run to different sheets of the medial axis. The steps
//! are therefore taken across the curve, no longer than a share of `r₁`, and evened out along it (`¼, ½, ¼`) before they are made;
//! then the curve is smoothed a little along itself. A node outside steps through the nearest point to the middle beyond it.

use nalgebra::{Point3, Vector3};

use super::aabb::AabbTree;
use super::web::Web;

/// Times that steps are evened out along the curve: about four nodes to both sides agree.
const EVENINGS: usize = 6;
/// A step is at most this share of the distance to the surface.
const LONGEST: f64 = 0.5;
/// How far nodes go to the mean of their neighbors in each pass.
const SMOOTHING: f64 = 0.25;

/// Distance to the surface.
pub(super) fn radius(tree: &AabbTree, c: &Point3<f64>) -> f64 {
    tree.nearest(c).map_or(0.0, |p| nalgebra::distance(c, &p))
}

/// Moves all nodes but pinned ones toward the middle. Only a `closed` surface has an outside.
pub(super) fn center(web: &mut Web, tree: &AabbTree, closed: bool, passes: usize) {
    let alive: Vec<u32> = web.alive().collect();
    for _ in 0..passes {
        let mut steps = vec![Vector3::zeros(); web.nodes.len()];
        for &v in &alive {
            let step = step(tree, closed, &web.nodes[v as usize]);
            let along = tangent(web, v);
            steps[v as usize] = step - along * step.dot(&along);
        }
        for _ in 0..EVENINGS {
            steps = averaged(web, &alive, &steps, 0.5);
        }
        for &v in alive.iter().filter(|v| !web.pinned[**v as usize]) {
            web.nodes[v as usize] += steps[v as usize];
        }
        smooth(web, &alive);
    }
}

/// The way from a node to the middle of its chord.
fn step(tree: &AabbTree, closed: bool, c: &Point3<f64>) -> Vector3<f64> {
    let Some(near) = tree.nearest(c) else { return Vector3::zeros() };
    let Some(away) = (c - near).try_normalize(0.0) else { return Vector3::zeros() };
    if closed && !tree.encloses(c) {
        let inward = -away;
        let beyond = tree.first_hit(&(near + inward * (1e-6 + 1e-3 * (c - near).norm())), &inward).unwrap_or(0.0);
        return near - c + inward * (0.5 * beyond);
    }
    let r1 = (c - near).norm();
    let Some(r2) = tree.first_hit(c, &away) else { return Vector3::zeros() };
    away * (0.5 * (r2 - r1)).clamp(0.0, LONGEST * r1)
}

/// Direction of the curve at a node with two neighbors; zero at ends and junctions, which move freely.
fn tangent(web: &Web, v: u32) -> Vector3<f64> {
    match web.neighbors(v) {
        [a, b] => (web.nodes[*b as usize] - web.nodes[*a as usize]).try_normalize(0.0).unwrap_or_default(),
        _ => Vector3::zeros(),
    }
}

/// Each value moved by `share` to the mean of its neighbors'.
fn averaged(web: &Web, alive: &[u32], values: &[Vector3<f64>], share: f64) -> Vec<Vector3<f64>> {
    let mut result = values.to_vec();
    for &v in alive {
        let around = web.neighbors(v);
        if !around.is_empty() {
            let mean = around.iter().map(|u| values[*u as usize]).sum::<Vector3<f64>>() / around.len() as f64;
            result[v as usize] += (mean - values[v as usize]) * share;
        }
    }
    result
}

/// Evens the curve out; ends stay.
fn smooth(web: &mut Web, alive: &[u32]) {
    let old: Vec<Vector3<f64>> = web.nodes.iter().map(|p| p.coords).collect();
    let new = averaged(web, alive, &old, SMOOTHING);
    for &v in alive.iter().filter(|v| !web.pinned[**v as usize]) {
        if web.degree(v) >= 2 {
            web.nodes[v as usize] = Point3::from(new[v as usize]);
        }
    }
}
