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
use super::error::ExtractionError;
use super::fairing::Fairing;
use super::web::Web;

/// Over how many radii steps agree.
const AGREE: f64 = 0.5;
/// Over how many radii the curve is smoothed in each pass.
const SMOOTH: f64 = 0.2;
/// A step is at most this share of the distance to the surface.
const LONGEST: f64 = 0.5;
/// Times that an edge which passes outside is split.
const SPLITS: usize = 5;

/// Distance to the surface.
pub(super) fn radius(tree: &AabbTree, c: &Point3<f64>) -> f64 {
    tree.nearest(c).map_or(0.0, |p| nalgebra::distance(c, &p))
}

/// Moves all nodes but pinned ones toward the middle. Only a `closed` surface has an outside.
pub(super) fn center(web: &mut Web, tree: &AabbTree, closed: bool, passes: usize) -> Result<(), ExtractionError> {
    let alive: Vec<u32> = web.alive().collect();
    let pinned = web.pinned.clone();
    for _ in 0..passes {
        let mut radii = vec![0.0; web.nodes.len()];
        let mut steps = vec![Vector3::zeros(); web.nodes.len()];
        for &v in &alive {
            radii[v as usize] = radius(tree, &web.nodes[v as usize]);
            let step = step(tree, closed, &web.nodes[v as usize]);
            let along = tangent(web, v);
            steps[v as usize] = step - along * step.dot(&along);
        }
        Fairing::new(web, &alive, &radii, AGREE, |_| false)?.apply(&mut steps);
        for &v in alive.iter().filter(|v| !pinned[**v as usize]) {
            web.nodes[v as usize] += steps[v as usize];
        }
        smooth(web, &alive, &radii, SMOOTH)?;
    }
    Ok(())
}

/// Smooths the curve over a share of the radius about it; ends stay.
fn smooth(web: &mut Web, alive: &[u32], radii: &[f64], share: f64) -> Result<(), ExtractionError> {
    let held = |v: u32| web.pinned[v as usize] || web.degree(v) < 2;
    let mut fairing = Fairing::new(web, alive, radii, share, held)?;
    let free: Vec<u32> = alive.iter().copied().filter(|v| !held(*v)).collect();
    let mut places: Vec<Vector3<f64>> = web.nodes.iter().map(|p| p.coords).collect();
    fairing.apply(&mut places);
    for v in free {
        web.nodes[v as usize] = Point3::from(places[v as usize]);
    }
    Ok(())
}

/// Brings nodes of a closed surface that are outside back in, and the middles of edges that pass outside.
pub(super) fn keep_inside(web: &mut Web, tree: &AabbTree) {
    let back = |p: &Point3<f64>| (!tree.encloses(p)).then(|| p + step(tree, true, p));
    for v in web.alive().filter(|v| !web.pinned[*v as usize]).collect::<Vec<_>>() {
        if let Some(p) = back(&web.nodes[v as usize]) {
            web.nodes[v as usize] = p;
        }
    }
    let joined = |v: u32| web.neighbors(v).iter().filter(move |u| v < **u).map(move |u| (v, *u, SPLITS));
    let mut edges: Vec<(u32, u32, usize)> = web.alive().flat_map(joined).collect();
    while let Some((a, b, splits)) = edges.pop() {
        let (p, q) = (web.nodes[a as usize], web.nodes[b as usize]);
        let mut places = [0.5, 0.25, 0.75].iter().map(|t| p + (q - p) * *t);
        if let Some(inside) = places.find_map(|p| back(&p)).filter(|p| splits > 0 && tree.encloses(p)) {
            let new = web.split(a, b, inside);
            edges.extend([(a, new, splits - 1), (new, b, splits - 1)]);
        }
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

/// The way from a place inside to the middle of its chord.
pub(super) fn across(tree: &AabbTree, c: &Point3<f64>) -> Vector3<f64> {
    step(tree, false, c)
}

/// Direction of the curve at a node with two neighbors; zero at ends and junctions, which move freely.
fn tangent(web: &Web, v: u32) -> Vector3<f64> {
    match web.neighbors(v) {
        [a, b] => (web.nodes[*b as usize] - web.nodes[*a as usize]).try_normalize(0.0).unwrap_or_default(),
        _ => Vector3::zeros(),
    }
}
