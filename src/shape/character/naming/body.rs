//! The search for the parts of a body in a tree of joints.

use nalgebra::{Point3, Vector3};

use super::{BodyPlan, Sides};
use crate::character::{CurveSkeleton, Skeleton};

/// A limb, from the trunk outward without the joint of the trunk.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    pub(super) joints: Vec<u32>,
    /// Path length of each joint from the trunk.
    pub(super) lengths: Vec<f64>,
}

/// The parts of a body.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) plan: BodyPlan,
    pub(super) sides: Sides,
    /// From the hips to the chest.
    pub(super) trunk: Vec<u32>,
    /// Left and right.
    pub(super) hind: [Limb; 2],
    pub(super) front: [Limb; 2],
    pub(super) head: Vec<u32>,
    pub(super) tail: Vec<u32>,
}

/// Ends of limbs that are considered: two pairs, head, tail, and as many again of ears and horns.
const MAX_ENDS: usize = 10;
/// Shortest limb, as a fraction of the longest path: shorter ones are fingers and ears.
const MIN_LIMB: f64 = 0.05;
/// Largest difference of length between the limbs of a pair, as a fraction of the longer: curves of thick bodies let one arm begin at the
/// neck and the other in the chest, a third of their length apart.
const MAX_DIFFERENCE: f64 = 0.45;
/// Longest limb that belongs to no part, as a fraction of the shortest of the pairs: ears and horns are shorter; a body with a limb as long as
/// this is another than those that are known.
const SPARE: f64 = 0.5;
/// Cosine to the trunk from which legs go on from it, and below which they are across it; and between the legs of front and back.
const ALONG: f64 = 0.6;
/// Ratio of radii from which the thicker of two ends is the head.
const THICKER: f64 = 1.2;
/// Slope of the feet from which they show where a biped faces: a tenth of a right angle is bent soles and rounding of ends.
const FEET: f64 = 0.2;

/// The tree of joints.
struct Tree {
    at: Vec<Point3<f64>>,
    neighbors: Vec<Vec<u32>>,
}

impl Tree {
    fn new(skeleton: &Skeleton) -> Self {
        let mut neighbors = vec![Vec::new(); skeleton.joint_count()];
        for (joint, j) in skeleton.joints().iter().zip(0..) {
            if let Some(parent) = joint.parent {
                neighbors[j as usize].push(parent);
                neighbors[parent as usize].push(j);
            }
        }
        Self { at: skeleton.rest_positions(), neighbors }
    }

    fn length(&self, a: u32, b: u32) -> f64 {
        nalgebra::distance(&self.at[a as usize], &self.at[b as usize])
    }

    /// Distances from a set of joints along bones, and the joint before each.
    fn paths(&self, from: &[u32]) -> (Vec<f64>, Vec<Option<u32>>) {
        let mut distance = vec![f64::INFINITY; self.at.len()];
        let mut before = vec![None; self.at.len()];
        let mut stack = from.to_vec();
        for &j in from {
            distance[j as usize] = 0.0;
        }
        while let Some(j) = stack.pop() {
            for &n in &self.neighbors[j as usize] {
                if distance[n as usize].is_infinite() {
                    distance[n as usize] = distance[j as usize] + self.length(j, n);
                    before[n as usize] = Some(j);
                    stack.push(n);
                }
            }
        }
        (distance, before)
    }

    /// The joints from `a` to `b`, both included.
    fn path(&self, a: u32, b: u32) -> Vec<u32> {
        let (_, before) = self.paths(&[b]);
        std::iter::successors(Some(a), |j| before[*j as usize]).collect()
    }

    /// The joint at which the paths between three others meet.
    fn median(&self, a: u32, b: u32, c: u32) -> Option<u32> {
        let other: std::collections::HashSet<u32> = self.path(a, b).into_iter().collect();
        self.path(c, a).into_iter().find(|j| other.contains(j))
    }

    /// The ends of the longest limbs: those of the longest path, then always the one farthest from the paths so far.
    fn ends(&self, start: u32) -> (Vec<u32>, f64) {
        let farthest = |distance: &[f64]| {
            let finite = distance.iter().enumerate().filter(|(_, d)| d.is_finite());
            finite
                .max_by(|a, b| rounded(*a.1).total_cmp(&rounded(*b.1)).then(b.0.cmp(&a.0)))
                .map_or((start, 0.0), |(j, d)| (j as u32, *d))
        };
        let (first, _) = farthest(&self.paths(&[start]).0);
        let (second, longest) = farthest(&self.paths(&[first]).0);
        let mut spanned = self.path(first, second);
        let mut ends = vec![first, second];
        while ends.len() < MAX_ENDS {
            let (end, length) = farthest(&self.paths(&spanned).0);
            if !(length > MIN_LIMB * longest) {
                break;
            }
            let near = spanned.clone();
            let (_, before) = self.paths(&near);
            spanned.extend(std::iter::successors(Some(end), |j| before[*j as usize]).take_while(|j| !near.contains(j)));
            ends.push(end);
        }
        (ends, longest)
    }

    /// A limb from a joint of the trunk.
    fn limb(&self, from: u32, to: u32) -> Limb {
        let joints = self.path(from, to);
        let mut lengths = vec![0.0];
        for pair in joints.windows(2) {
            lengths.push(lengths[lengths.len() - 1] + self.length(pair[0], pair[1]));
        }
        Limb { joints: joints[1..].to_vec(), lengths: lengths[1..].to_vec() }
    }

    /// Mean position along a limb.
    fn middle(&self, from: u32, to: u32) -> Vector3<f64> {
        let path = self.path(from, to);
        let (mut sum, mut total) = (Vector3::zeros(), 0.0);
        for pair in path.windows(2) {
            let length = self.length(pair[0], pair[1]);
            sum += (self.at[pair[0] as usize].coords + self.at[pair[1] as usize].coords) * (0.5 * length);
            total += length;
        }
        if total > 0.0 { sum / total } else { self.at[from as usize].coords }
    }

    /// The direction at the end of a limb: over its last seventh, as a slope.
    fn toe_out(&self, limb: &Limb, from: u32) -> Vector3<f64> {
        let total = limb.lengths.last().copied().unwrap_or(0.0);
        let back = total / 7.0;
        let (mut before, mut reached) = (self.at[from as usize], 0.0);
        for (joint, length) in limb.joints.iter().zip(&limb.lengths) {
            let at = self.at[*joint as usize];
            if *length >= total - back {
                let u = if *length > reached { (total - back - reached) / (length - reached) } else { 0.0 };
                before += (at - before) * u.clamp(0.0, 1.0);
                break;
            }
            (before, reached) = (at, *length);
        }
        let end = limb.joints.last().map_or(before, |j| self.at[*j as usize]);
        if back > 0.0 { (end - before) / back } else { Vector3::zeros() }
    }
}

/// Single precision: equal for a model and its rotated copy.
fn rounded(x: f64) -> f32 {
    x as f32
}

/// Two pairs of limbs at the ends of a trunk.
struct Pairs {
    limbs: [[u32; 2]; 2],
    junctions: [u32; 2],
    score: f64,
    /// Normal of the plane between the limbs of each pair, where it is along it, and how far the farthest limbs are from it.
    side: Vector3<f64>,
    center: f64,
    half: f64,
}

impl Body {
    pub(super) fn find(skeleton: &Skeleton, curve: &CurveSkeleton) -> Option<Self> {
        let tree = Tree::new(skeleton);
        let start = main_component(&tree)?;
        let (ends, longest) = tree.ends(start);
        let pairs = best_pairs(&tree, &ends, longest)?;
        let others: Vec<u32> = ends.iter().copied().filter(|e| !pairs.limbs.as_flattened().contains(e)).collect();
        let [first, second] = further_limbs(&tree, &pairs, &others);
        let head_at = match (first, second) {
            (Some(_), None) => 0,
            (None, Some(_)) => 1,
            (None, None) => return None,
            (Some(a), Some(b)) => {
                let [a, b] = [(a, 0), (b, 1)].map(|(end, k)| thickness(&tree, curve, pairs.junctions[k], end));
                match (a?, b?) {
                    (a, b) if a > THICKER * b => 0,
                    (a, b) if b > THICKER * a => 1,
                    _ => return None,
                }
            }
        };
        let [hips, chest] = [pairs.junctions[1 - head_at], pairs.junctions[head_at]];
        let [hind, front] = [pairs.limbs[1 - head_at], pairs.limbs[head_at]];
        let [head, tail] = if head_at == 0 { [first, second] } else { [second, first] };
        // A head that is as far from the middle as a limb is a limb, and what was taken for one the head.
        let aside = |end: u32| (tree.middle(chest, end).dot(&pairs.side) - pairs.center).abs();
        if head.is_some_and(|end| aside(end) > pairs.half) {
            return None;
        }
        let trunk = tree.path(hips, chest);
        let shortest = |pair: [u32; 2], from: u32| {
            pair.map(|end| tree.limb(from, end).lengths.last().copied().unwrap_or(0.0))
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        };
        let shortest = shortest(hind, hips).min(shortest(front, chest));
        let known = hind.iter().chain(&front).chain(&head).chain(&tail).flat_map(|end| tree.path(hips, *end));
        let beyond = tree.paths(&known.collect::<Vec<_>>()).0;
        if others.iter().any(|end| beyond[*end as usize] > SPARE * shortest) {
            return None;
        }
        let posture = Posture::of(&tree, [hips, chest], [hind, front])?;
        let ordered = |junction: u32, pair: [u32; 2]| {
            let limbs = pair.map(|end| (tree.middle(junction, end).dot(&posture.left), tree.limb(junction, end)));
            let [a, b] = limbs;
            if a.0 >= b.0 { [a.1, b.1] } else { [b.1, a.1] }
        };
        let beyond = |end: Option<u32>| -> Vec<u32> {
            let path = end.map(|end| tree.path(hips, end)).unwrap_or_default();
            path.into_iter().filter(|j| !trunk.contains(j)).collect()
        };
        Some(Self {
            plan: posture.plan,
            sides: posture.sides,
            hind: ordered(hips, hind),
            front: ordered(chest, front),
            head: beyond(head),
            tail: beyond(tail),
            trunk,
        })
    }
}

/// A joint of the component with the largest total length of bones.
fn main_component(tree: &Tree) -> Option<u32> {
    let mut seen = vec![false; tree.at.len()];
    let mut best: Option<(f32, u32)> = None;
    for j in 0..tree.at.len() as u32 {
        if std::mem::replace(&mut seen[j as usize], true) {
            continue;
        }
        let (mut stack, mut total) = (vec![j], 0.0);
        while let Some(v) = stack.pop() {
            for &n in &tree.neighbors[v as usize] {
                if !std::mem::replace(&mut seen[n as usize], true) {
                    total += tree.length(v, n);
                    stack.push(n);
                }
            }
        }
        if best.is_none_or(|(length, _)| rounded(total) > length) {
            best = Some((rounded(total), j));
        }
    }
    best.map(|(_, j)| j)
}

/// The two pairs with the longest limbs of the most equal lengths.
fn best_pairs(tree: &Tree, ends: &[u32], longest: f64) -> Option<Pairs> {
    let distances: Vec<Vec<f64>> = ends.iter().map(|e| tree.paths(&[*e]).0).collect();
    let d = |i: usize, j: usize| distances[i][ends[j] as usize];
    let mut best: Option<Pairs> = None;
    for a in 0..ends.len() {
        for b in a + 1..ends.len() {
            for c in a + 1..ends.len() {
                for e in c + 1..ends.len() {
                    if c == b || e == b {
                        continue;
                    }
                    // The four-point condition: paths a–b and c–e have the trunk between them.
                    let trunk = 0.5 * (d(a, c) + d(b, e) - d(a, b) - d(c, e));
                    if !(trunk > MIN_LIMB * longest) {
                        continue;
                    }
                    let found = scored(tree, [[ends[a], ends[b]], [ends[c], ends[e]]]);
                    let better =
                        |found: &Pairs| best.as_ref().is_none_or(|best| rounded(found.score) > rounded(best.score));
                    if let Some(found) = found.filter(better) {
                        best = Some(found);
                    }
                }
            }
        }
    }
    best
}

/// Lengths of two pairs, less where they differ, if both are on either side of one plane.
fn scored(tree: &Tree, limbs: [[u32; 2]; 2]) -> Option<Pairs> {
    let [[a, b], [c, e]] = limbs;
    let junctions = [tree.median(a, b, c)?, tree.median(c, e, a)?];
    let along = (tree.at[junctions[1] as usize] - tree.at[junctions[0] as usize]).try_normalize(0.0)?;
    // A product: two pairs of middle length rather than long limbs and fingers.
    let (mut score, mut middles, mut across) = (1.0, Vec::new(), Vec::new());
    for (pair, junction) in limbs.iter().zip(junctions) {
        let length = pair.map(|end| tree.limb(junction, end).lengths.last().copied().unwrap_or(0.0));
        let (short, long) = (length[0].min(length[1]), length[0].max(length[1]));
        if !(long > 0.0 && long - short <= MAX_DIFFERENCE * long) {
            return None;
        }
        score *= short * short / long;
        let [p, q] = pair.map(|end| tree.middle(junction, end));
        across.push(((p - q) - along * along.dot(&(p - q))).try_normalize(0.0)?);
        middles.push([p, q]);
    }
    let parallel = across[0].dot(&across[1]);
    let side = (across[0] + across[1] * parallel.signum()).try_normalize(0.0)?;
    // Where the middle of each pair is along the normal of the plane, and how far its limbs are from there.
    let [(center, half), (other, other_half)] =
        [0, 1].map(|k| middles[k].map(|m| m.dot(&side))).map(|[p, q]| (0.5 * (p + q), 0.5 * (p - q).abs()));
    (parallel.abs() > 0.5).then(|| Pairs {
        limbs,
        junctions,
        score: score * parallel.abs(),
        side,
        center: 0.5 * (center + other),
        half: half.max(other_half),
    })
}

/// The longest further limb at the first and at the second end of the trunk.
fn further_limbs(tree: &Tree, pairs: &Pairs, others: &[u32]) -> [Option<u32>; 2] {
    let [from, to] = pairs.junctions;
    let mut found: [Option<(f32, u32)>; 2] = [None, None];
    for &end in others {
        // A finger has more than half of its path in common with a limb; a neck may begin on one.
        let distances = tree.paths(&[end]).0;
        let of_limb = |junction: u32, limb: u32| {
            let length = tree.limb(junction, limb).lengths.last().copied().unwrap_or(0.0);
            0.5 * (distances[junction as usize] + length - distances[limb as usize]) > 0.5 * length
        };
        let limbs = pairs.limbs.iter().zip(pairs.junctions);
        if limbs
            .flat_map(|(pair, junction)| pair.map(|limb| (junction, limb)))
            .any(|(junction, limb)| of_limb(junction, limb))
        {
            continue;
        }
        let side = usize::from(distances[from as usize] > distances[to as usize]);
        let length = rounded(distances[pairs.junctions[side] as usize]);
        if found[side].is_none_or(|(other, _)| length > other) {
            found[side] = Some((length, end));
        }
    }
    found.map(|f| f.map(|(_, end)| end))
}

/// Mean radius of the surface around the outer half of a limb.
fn thickness(tree: &Tree, curve: &CurveSkeleton, from: u32, end: u32) -> Option<f64> {
    let limb = tree.limb(from, end);
    let total = *limb.lengths.last()?;
    let outer: Vec<Point3<f64>> = limb
        .joints
        .iter()
        .zip(&limb.lengths)
        .filter(|(_, l)| **l >= 0.5 * total)
        .map(|(j, _)| tree.at[*j as usize])
        .collect();
    // Nodes of the curve that are nearer to this half than its own length.
    let mut before = tree.at[from as usize];
    for (joint, length) in limb.joints.iter().zip(&limb.lengths) {
        if *length < 0.5 * total {
            before = tree.at[*joint as usize];
        }
    }
    let points: Vec<Point3<f64>> = std::iter::once(before).chain(outer).collect();
    let near = |p: &Point3<f64>| {
        points.windows(2).any(|pair| {
            let along = pair[1] - pair[0];
            let u = if along.norm_squared() > 0.0 { (p - pair[0]).dot(&along) / along.norm_squared() } else { 0.0 };
            (p - (pair[0] + along * u.clamp(0.0, 1.0))).norm() < 0.05 * total
        })
    };
    let radii: Vec<f64> = curve.nodes.iter().zip(&curve.radius).filter(|(p, _)| near(p)).map(|(_, r)| *r).collect();
    (!radii.is_empty()).then(|| radii.iter().sum::<f64>() / radii.len() as f64)
}

/// What the body is and where its left is.
struct Posture {
    plan: BodyPlan,
    sides: Sides,
    left: Vector3<f64>,
}

impl Posture {
    fn of(tree: &Tree, [hips, chest]: [u32; 2], [hind, front]: [[u32; 2]; 2]) -> Option<Self> {
        let at = |j: u32| tree.at[j as usize];
        let along = (at(chest) - at(hips)).try_normalize(0.0)?;
        let reach = |from: u32, pair: [u32; 2]| {
            pair.map(|end| (at(end) - at(from)).try_normalize(0.0).unwrap_or_else(Vector3::zeros))
                .iter()
                .sum::<Vector3<f64>>()
                * 0.5
        };
        let (legs, others) = (reach(hips, hind), reach(chest, front));
        let length = legs.norm();
        let sideways = tree.middle(hips, hind[0]) - tree.middle(hips, hind[1]);
        let unit = |v: Vector3<f64>| v.try_normalize(1e-9);
        let without = |v: Vector3<f64>, axis: Vector3<f64>| v - axis * axis.dot(&v);
        if length > 0.0 && legs.dot(&along) < -ALONG * length {
            let up = unit(along - legs)?;
            let across = unit(without(sideways, up))?;
            let ahead = across.cross(&up);
            let feet = hind.map(|end| tree.toe_out(&tree.limb(hips, end), hips).dot(&ahead)).iter().sum::<f64>() * 0.5;
            let (forward, sides) =
                if feet.abs() > FEET { (Some(ahead * feet.signum()), Sides::Feet) } else { by_convention(up, ahead) };
            let left = forward.map_or(across, |forward| up.cross(&forward));
            return Some(Self { plan: BodyPlan::Biped, sides, left });
        }
        let alike = legs.dot(&others) > ALONG * length * others.norm() && others.norm() > 0.4;
        if length > 0.4 && alike && legs.dot(&along).abs() < ALONG.max(0.75) * length {
            let up = unit(-legs - others)?;
            let forward = unit(without(along, up))?;
            return Some(Self { plan: BodyPlan::Quadruped, sides: Sides::Head, left: up.cross(&forward) });
        }
        None
    }
}

/// The convention of files, where a body is upright in one of them and faces along an axis.
fn by_convention(up: Vector3<f64>, ahead: Vector3<f64>) -> (Option<Vector3<f64>>, Sides) {
    for (vertical, facing) in [(Vector3::y(), Vector3::z()), (Vector3::z(), -Vector3::y())] {
        let toward = ahead.dot(&facing);
        if up.dot(&vertical) > 0.9 && toward.abs() > 0.7 {
            return (Some(ahead * toward.signum()), Sides::Convention);
        }
    }
    (None, Sides::Unknown)
}
