//! Joints on a curve: few nodes that tell its shape.
//!
//! Ends and junctions are joints, and where a branch bends away from the straight line between two joints by more than a share of
//! the local radius, the farthest node becomes one (Douglas–Peucker with a tolerance relative to the radius). With a number asked
//! for, bends are taken in the order of how far they are off. The root of each part is the joint nearest to the center of its
//! nodes, weighted by the cubes of their radii: the middle of its volume. Skeletons are trees: a loop is cut at the joint where
//! the ways from the root meet.
//!
//! # Reference
//! D. H. Douglas, T. K. Peucker, *Algorithms for the reduction of the number of points required to represent a digitized line*,
//! Cartographica 10 (1973).

use std::collections::VecDeque;

use nalgebra::{Point3, Vector3};

use super::order::Cost;
use super::web::{Branch, Web};
use crate::character::{CharacterError, CurveSkeleton, Joint, Skeleton};
use plumbline_num::math::Trs;

/// A bend farther off than this share of the radius is a joint: what a limb as thick shows as bent.
const BEND: f64 = 0.4;

/// The skeleton of a curve, with about `count` joints where that is asked for: never fewer than ends and junctions.
///
/// # Errors
/// [`CharacterError`]: a curve without nodes, or of more joints than a skeleton holds.
pub fn skeleton_of(curve: &CurveSkeleton, count: Option<usize>) -> Result<Skeleton, CharacterError> {
    let web = Web::new(curve.nodes.clone(), &curve.edges, Vec::new());
    let radius = |v: u32| curve.radius.get(v as usize).copied().unwrap_or(0.0);
    let branches = web.branches();
    let chosen = chosen(&web, &branches, &radius, count);
    let mut links: Vec<Vec<u32>> = vec![Vec::new(); curve.nodes.len()];
    for branch in &branches {
        let stops: Vec<u32> = branch.iter().copied().filter(|v| chosen[*v as usize]).collect();
        for pair in stops.windows(2).filter(|pair| pair[0] != pair[1]) {
            links[pair[0] as usize].push(pair[1]);
            links[pair[1] as usize].push(pair[0]);
        }
    }
    let mut joints: Vec<Joint> = Vec::new();
    let mut number = vec![u32::MAX; curve.nodes.len()];
    for root in roots(&web, &chosen, &links, &radius) {
        hang(curve, root, &links, &mut number, &mut joints);
    }
    Skeleton::new(joints)
}

/// Which nodes are joints.
fn chosen(web: &Web, branches: &[Branch], radius: &dyn Fn(u32) -> f64, count: Option<usize>) -> Vec<bool> {
    let mut chosen: Vec<bool> = (0..web.nodes.len() as u32).map(|v| web.degree(v) != 2).collect();
    let mut spans: Vec<(Cost, usize, usize, usize, usize)> = Vec::new();
    for (b, branch) in branches.iter().enumerate() {
        let last = branch.len() - 1;
        for i in [0, last] {
            chosen[branch[i] as usize] = true;
        }
        // A loop needs three corners to be one.
        let cuts = if branch[0] == branch[last] { vec![0, last / 3, 2 * last / 3, last] } else { vec![0, last] };
        for i in &cuts {
            chosen[branch[*i] as usize] = true;
        }
        for pair in cuts.windows(2) {
            spans.extend(worst(web, branch, pair[0], pair[1], radius).map(|(c, i)| (c, b, pair[0], i, pair[1])));
        }
    }
    let mut joints = chosen.iter().filter(|c| **c).count();
    while let Some(at) = (0..spans.len()).max_by_key(|i| (spans[*i].0, std::cmp::Reverse(*i))) {
        let (cost, b, from, i, to) = spans.swap_remove(at);
        let wanted = count.map_or(cost > Cost::new(BEND), |count| joints < count);
        if !wanted {
            break;
        }
        chosen[branches[b][i] as usize] = true;
        joints += 1;
        for (from, to) in [(from, i), (i, to)] {
            spans.extend(worst(web, &branches[b], from, to, radius).map(|(c, i)| (c, b, from, i, to)));
        }
    }
    chosen
}

/// The node of a branch farthest from the line between two others, in radii; for straight spans the one in the middle.
fn worst(web: &Web, branch: &[u32], from: usize, to: usize, radius: &dyn Fn(u32) -> f64) -> Option<(Cost, usize)> {
    let (a, b) = (web.nodes[branch[from] as usize], web.nodes[branch[to] as usize]);
    let along = b - a;
    let middle = usize::midpoint(from, to);
    let off = |i: usize| {
        let p = web.nodes[branch[i] as usize];
        let t =
            if along.norm_squared() > 0.0 { ((p - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
        let distance = (p - (a + along * t)).norm();
        let size = radius(branch[i]);
        if size > 0.0 { distance / size } else { distance }
    };
    (from + 1..to).map(|i| (Cost::new(off(i)), i)).max_by_key(|(c, i)| (*c, std::cmp::Reverse(i.abs_diff(middle))))
}

/// The root of each connected piece.
fn roots(web: &Web, chosen: &[bool], links: &[Vec<u32>], radius: &dyn Fn(u32) -> f64) -> Vec<u32> {
    let mut seen = vec![false; web.nodes.len()];
    let mut roots = Vec::new();
    for start in (0..web.nodes.len()).filter(|v| chosen[*v]) {
        if seen[start] {
            continue;
        }
        let mut piece = vec![start as u32];
        seen[start] = true;
        let mut at = 0;
        while let Some(v) = piece.get(at).copied() {
            at += 1;
            for &u in &links[v as usize] {
                if !std::mem::replace(&mut seen[u as usize], true) {
                    piece.push(u);
                }
            }
        }
        let center = volume_center(web, piece[0], radius);
        let near = |v: &u32| (Cost::new(nalgebra::distance(&web.nodes[*v as usize], &center)), *v);
        roots.extend(piece.into_iter().min_by_key(near));
    }
    roots
}

/// Center of the nodes connected with `start`, weighted by the cubes of their radii.
fn volume_center(web: &Web, start: u32, radius: &dyn Fn(u32) -> f64) -> Point3<f64> {
    let origin = web.nodes[start as usize];
    let mut seen = std::collections::BTreeSet::from([start]);
    let mut stack = vec![start];
    let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
    while let Some(v) = stack.pop() {
        let w = radius(v).powi(3).max(f64::MIN_POSITIVE);
        sum += (web.nodes[v as usize] - origin) * w;
        weight += w;
        stack.extend(web.neighbors(v).iter().copied().filter(|u| seen.insert(*u)));
    }
    origin + sum / weight
}

/// Hangs joints on a root, breadth first.
fn hang(curve: &CurveSkeleton, root: u32, links: &[Vec<u32>], number: &mut [u32], joints: &mut Vec<Joint>) {
    let mut queue = VecDeque::from([(root, None::<u32>)]);
    number[root as usize] = u32::MAX - 1;
    while let Some((v, from)) = queue.pop_front() {
        let parent = from.map(|u| number[u as usize]);
        let place = curve.nodes[v as usize];
        let offset = from.map_or(place.coords, |u| place - curve.nodes[u as usize]);
        let j = joints.len() as u32;
        number[v as usize] = j;
        let name = if parent.is_none() && j == 0 { "root".to_owned() } else { format!("joint_{j}") };
        joints.push(Joint { name, parent, rest: Trs::from_translation(offset), limits: None });
        for &u in &links[v as usize] {
            if number[u as usize] == u32::MAX {
                number[u as usize] = u32::MAX - 1;
                queue.push_back((u, Some(v)));
            }
        }
    }
}
