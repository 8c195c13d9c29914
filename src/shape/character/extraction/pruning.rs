//! Takes branches away that say nothing of the shape, and brings junctions together that are one.
//!
//! Bumps of a surface leave short branches, and so do the edges of thick sheets. With `c` and `s` the place and radius of an end, the ball
//! there sticks out of the balls about the rest of the curve, of centers `u` and radii `r_u`, by
//!
//! `b = s + min_u (‖c − u‖ − r_u)`.
//!
//! A branch is no limb where `b < prune · w`, with `w` half its width at the end: half the longest chord across it. Of a round limb `w = s`, and
//! with `prune = 1` this says that the end lies inside a ball of the rest; the fold of a lip and the corner of a hoof stick out by little more,
//! fingers and ears by twice that. The edge of a slab is as wide as the slab, and a branch that reaches for it sticks out by
//! less. The ratio needs no unit and is the same for fingers and trunks. The branch that sticks out least
//! goes first, since others may be covered less by then. Vertices of the branch go to the junction. Ends that are pinned stay, and so does
//! a branch that goes on at the bend of a hairpin: without the crown of a head the curve would run up the neck and back to the nose.
//!
//! Two junctions nearer to each other than a share of the larger radius are one, unless a loop would vanish.

use nalgebra::Vector3;

use super::aabb::AabbTree;
use super::order::Cost;
use super::web::{Branch, Web};
use plumbline_num::run::{Run, Stopped};

/// Chords across an end.
const CHORDS: usize = 8;
/// Planes tilted against the direction of the branch, and the tangent of the angle.
const TILTS: usize = 6;
const TILT: f64 = 0.8;

/// Two branches at less than this angle run side by side, 60°.
const HAIRPIN: f64 = 1.05;

/// Takes away what is covered; `radii` are the distances of the nodes to the surface.
pub(super) fn prune(web: &mut Web, tree: &AabbTree, radii: &[f64], prune: f64, run: &Run) -> Result<(), Stopped> {
    let mut widths = std::collections::HashMap::new();
    loop {
        let mut worst: Option<(Cost, Branch)> = None;
        for branch in web.limbs() {
            run.check()?;
            let (junction, end) = (branch[0], branch[branch.len() - 1]);
            let width =
                *widths.entry((junction, end)).or_insert_with(|| half_width(web, tree, &branch, radii[end as usize]));
            let out = Cost::new(sticks_out(web, &branch, radii).0 / width.max(f64::MIN_POSITIVE));
            if out < Cost::new(prune)
                && !leaves_a_hairpin(web, &branch, radii[junction as usize])
                && worst.as_ref().is_none_or(|(least, _)| out < *least)
            {
                worst = Some((out, branch));
            }
        }
        let Some((_, branch)) = worst else { return Ok(()) };
        web.take_away(&branch);
    }
}

/// True where a branch goes on at the bend of two others that run side by side: without it the curve would go there and back.
fn leaves_a_hairpin(web: &Web, branch: &[u32], radius: f64) -> bool {
    let junction = branch[0];
    let others: Vec<u32> = web.neighbors(junction).iter().copied().filter(|v| *v != branch[1]).collect();
    let [a, b] = others[..] else { return false };
    match [a, b].map(|to| direction(web, junction, to, radius)) {
        [Some(a), Some(b)] => a.angle(&b) < HAIRPIN,
        _ => false,
    }
}

/// From a node to where the branch toward `to` is `reach` away; none where that is shorter.
fn direction(web: &Web, from: u32, to: u32, reach: f64) -> Option<Vector3<f64>> {
    let row = web.row(from, to, reach);
    let at = row[row.len() - 1];
    (web.length(from, at) >= reach).then(|| web.nodes[at as usize] - web.nodes[from as usize])
}

/// How far the ball at the end of a branch sticks out of the balls about the rest of the curve, and of which it does so least.
pub(super) fn sticks_out(web: &Web, branch: &[u32], radii: &[f64]) -> (f64, u32) {
    let last = branch[branch.len() - 1];
    let end = web.nodes[last as usize];
    let mut own = branch[1..].to_vec();
    own.sort_unstable();
    let rest = web.alive().filter(|v| own.binary_search(v).is_err());
    let beyond = |v: u32| nalgebra::distance(&end, &web.nodes[v as usize]) - radii[v as usize];
    let base = rest.min_by_key(|v| (Cost::new(beyond(*v)), *v)).unwrap_or(branch[0]);
    (beyond(base) + radii[last as usize], base)
}

/// Half the longest chord across a branch at its end, at least its radius there: that of the plane, among those tilted a little, in
/// which it is least.
fn half_width(web: &Web, tree: &AabbTree, branch: &[u32], radius: f64) -> f64 {
    let end = web.nodes[branch[branch.len() - 1] as usize];
    let mut before = branch.iter().rev().map(|v| web.nodes[*v as usize]);
    let from = before.find(|p| nalgebra::distance(p, &end) >= radius).unwrap_or(web.nodes[branch[0] as usize]);
    let Some(along) = (end - from).try_normalize(1e-12) else { return radius };
    let side = along.cross(&Vector3::ith(along.iamin(), 1.0)).normalize();
    let other = along.cross(&side);
    let around = |k: usize, of: usize| {
        let angle = std::f64::consts::TAU * k as f64 / of as f64;
        side * angle.cos() + other * angle.sin()
    };
    let tilted = (0..TILTS).map(|k| along + around(k, TILTS) * TILT);
    let widest = |axis: Vector3<f64>| {
        let axis = axis.normalize();
        let chord = |k: usize| {
            let across = around(k, 2 * CHORDS);
            let across = (across - axis * across.dot(&axis)).normalize();
            let ways = [across, -across].map(|d| tree.first_hit(&end, &d).unwrap_or(0.0));
            0.5 * (ways[0] + ways[1])
        };
        (0..CHORDS).map(chord).fold(radius, f64::max)
    };
    std::iter::once(along).chain(tilted).map(widest).fold(f64::INFINITY, f64::min)
}

/// Merges junctions that are one.
pub(super) fn join_junctions(web: &mut Web, radii: &[f64], share: f64, run: &Run) -> Result<(), Stopped> {
    let radius = |v: u32| radii[v as usize];
    loop {
        let mut nearest: Option<(Cost, Vec<u32>)> = None;
        for branch in web.branches() {
            let (a, b) = (branch[0], branch[branch.len() - 1]);
            if a == b || web.degree(a) < 3 || web.degree(b) < 3 {
                continue;
            }
            let length = web.branch_length(&branch);
            let widest = radius(a).max(radius(b));
            let rank = Cost::new(length / widest);
            if length < share * widest
                && !closes_a_loop(web, &branch)
                && nearest.as_ref().is_none_or(|(least, _)| rank < *least)
            {
                nearest = Some((rank, branch));
            }
        }
        run.check()?;
        let Some((_, branch)) = nearest else { return Ok(()) };
        let (a, b) = (branch[0], branch[branch.len() - 1]);
        let (inner, keep) = if radius(a) >= radius(b) {
            (branch[1..].to_vec(), a)
        } else {
            let mut rest = branch.clone();
            rest.pop();
            rest.reverse();
            (rest, b)
        };
        for v in inner {
            web.merge(v, keep);
        }
    }
}

/// True where another branch joins the same two junctions, or a node is next to both: merging would take the loop away.
fn closes_a_loop(web: &Web, branch: &[u32]) -> bool {
    let (a, b) = (branch[0], branch[branch.len() - 1]);
    let (mut inner, others) = (branch.to_vec(), web.branches());
    inner.sort_unstable();
    others.iter().any(|other| {
        let ends = (other[0], other[other.len() - 1]);
        let mut same = other.clone();
        same.sort_unstable();
        same != inner && (ends == (a, b) || ends == (b, a)) && other.len() <= 3
    }) || web.neighbors(a).iter().any(|v| !branch.contains(v) && web.neighbors(b).contains(v))
}
