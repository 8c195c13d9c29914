//! The layout of a matching: junctions, the path of each limb on the curve, and the cost.
//!
//! A junction `b` of the template has matched leaves behind each of its bones. Its image is the curve node
//!
//! ```text
//! min_n  Σ_bones mean_leaves d_C(e, n)  +  ε mean_leaves |d_C(e, n) − s d_T(e, b)|  +  penalty for nearness to earlier junctions
//! ```
//!
//! For three bones on a tree the first term alone has its minimum at the branching node. If four bones meet and the curve has two
//! junctions, the first term is constant between them, and the second decides.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::along::{Path, bent};
use super::ends::Ends;
use super::graph::Graph;
use super::matching::{Images, POSITION_WEIGHT, spare};
use super::moments::{Alignment, Moments};

/// `ε`: small, so that it decides only where the first term is constant.
const LENGTH_WEIGHT: f64 = 0.1;
/// Lower bound of the length of limbs between two junctions, relative to the template: without it they vanish if the curve has a single
/// junction for both.
const MIN_JUNCTION_DISTANCE_RATIO: f64 = 0.3;
/// Penalty per unit below that bound: exceeds the slope of one bone in the first term.
const NEARNESS_PENALTY: f64 = 4.0;
/// Limb length ratios below this have the same cost: bounds the logarithm.
const MIN_RATIO: f64 = 0.05;

/// A limb and its path on the curve.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    /// Joints from one end to the other.
    pub(super) joints: Vec<u32>,
    /// Arc-length fraction of each joint.
    fractions: Vec<f64>,
    /// Length in the template.
    pub(super) length: f64,
    /// Path on the curve.
    pub(super) path: Path,
}

/// Joints on the curve.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Limbs with a path.
    pub(super) limbs: Vec<Limb>,
    /// Joint positions, in units of the curve; `None` for joints without image.
    positions: Vec<Option<Vector3<f64>>>,
    /// The best similarity from the template.
    pub(super) alignment: Alignment,
    pub(super) cost: f64,
    matched: usize,
}

impl Layout {
    /// Lays out a matching; `None` if a limb has zero length.
    pub(super) fn new(bones: &Graph, ours: &Ends, branches: &Graph, theirs: &Ends, images: &Images) -> Option<Self> {
        let matching = Matching { bones, ours, branches, theirs, images };
        let spanned = matching.spanned();
        let nodes = matching.nodes(&spanned);
        let mut used: [BTreeSet<[u32; 2]>; 2] = Default::default();
        let doubted = |j: u32| ours.nodes.iter().position(|n| *n == j).map_or(1.0, |k| ours.trust[k]);
        let mut trust = 1.0;
        let mut limbs = Vec::new();
        for joints in chains(&spanned) {
            let (from, to) = (nodes[joints[0] as usize]?, nodes[joints[joints.len() - 1] as usize]?);
            let route = branches.paths(to).back_from(from);
            let least = doubted(joints[0]).min(doubted(joints[joints.len() - 1]));
            trust = least.min(trust);
            used[usize::from(least < 1.0)].extend(route.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]));
            limbs.push(Limb::new(bones, branches, joints, &route)?);
        }
        let [sure, doubted] = used;
        let only = doubted.difference(&sure).copied();
        let covered =
            branches.surface_fraction_around(sure.iter().copied()) + trust * branches.surface_fraction_around(only);
        let mut layout = Self {
            positions: placed(&limbs, bones.points.len(), |limb| limb.fractions.clone()),
            limbs,
            alignment: Moments::default().alignment(),
            cost: 0.0,
            matched: images.iter().flatten().count(),
        };
        layout.alignment = layout.aligned(bones);
        let missing: f64 = ours.need.iter().zip(images).filter_map(|(need, i)| i.is_none().then_some(need)).sum();
        layout.cost = layout.distortion() + POSITION_WEIGHT * layout.alignment.residual + missing + spare(covered);
        Some(layout)
    }

    /// Ratio of the total limb lengths on the curve and in the template, which is independent of the pose.
    pub(super) fn scale(&self) -> f64 {
        self.limbs.iter().map(|l| l.path.length()).sum::<f64>() / self.limbs.iter().map(|l| l.length).sum::<f64>()
    }

    /// Number of matched template leaves.
    pub(super) fn matched_ends(&self) -> usize {
        self.matched
    }

    /// Whether joints differ by more than a fraction of the curve's length on average.
    pub(super) fn differs(&self, other: &Self, fraction: f64) -> bool {
        let both: Vec<f64> = self
            .positions
            .iter()
            .zip(&other.positions)
            .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()))
            .collect();
        both.iter().sum::<f64>() > fraction * both.len() as f64
    }

    /// Joint positions adapted to the bends of the paths.
    pub(super) fn refined(&self) -> Vec<Option<Vector3<f64>>> {
        placed(&self.limbs, self.positions.len(), |limb| bent(&limb.path, &limb.fractions))
    }

    /// Rotation of the trunk: junctions, their neighbors and the limbs between two junctions; without junctions that of all joints.
    pub(super) fn trunk_rotation(&self, bones: &Graph, positions: &[Option<Vector3<f64>>]) -> Matrix3<f64> {
        let meet = |j: &u32| bones.neighbors(*j).len() > 2;
        let between = self.limbs.iter().filter(|l| meet(&l.joints[0]) && meet(&l.joints[l.joints.len() - 1]));
        let mut trunk: BTreeSet<u32> = between.flat_map(|l| l.joints.iter().copied()).collect();
        for j in (0..positions.len() as u32).filter(meet) {
            trunk.insert(j);
            trunk.extend(bones.neighbors(j));
        }
        let mut moments = Moments::default();
        for j in &trunk {
            if let Some(position) = positions[*j as usize] {
                moments.add(1.0, &bones.points[*j as usize], &position);
            }
        }
        if trunk.is_empty() { self.alignment.rotation } else { moments.alignment().rotation }
    }

    /// Similarity of all joints, weighted by the lengths of their bones.
    fn aligned(&self, bones: &Graph) -> Alignment {
        let mut moments = Moments::default();
        for (j, position) in self.positions.iter().enumerate() {
            let Some(position) = position else { continue };
            let weight: f64 = bones.neighbors(j as u32).iter().map(|n| bones.length(j as u32, *n)).sum();
            moments.add(weight, &bones.points[j], position);
        }
        moments.alignment()
    }

    /// Variance of the log stretch of limbs, weighted by length.
    fn distortion(&self) -> f64 {
        let total: f64 = self.limbs.iter().map(|l| l.length).sum();
        let log = |l: &Limb| (l.path.length() / l.length).max(MIN_RATIO).ln();
        let mean = self.limbs.iter().map(|l| l.length * log(l)).sum::<f64>() / total;
        self.limbs.iter().map(|l| l.length * (log(l) - mean).powi(2)).sum::<f64>() / total
    }
}

impl Limb {
    fn new(bones: &Graph, branches: &Graph, joints: Vec<u32>, route: &[u32]) -> Option<Self> {
        let mut upto = vec![0.0];
        for pair in joints.windows(2) {
            upto.push(upto[upto.len() - 1] + bones.length(pair[0], pair[1]));
        }
        let length = upto[upto.len() - 1];
        let path = Path::new(route.iter().map(|n| branches.points[*n as usize]).collect());
        let fractions = upto.iter().map(|u| u / length).collect();
        (length > 0.0 && path.length() > 0.0).then_some(Self { joints, fractions, length, path })
    }
}

/// Joint positions at given fractions of the limbs.
fn placed(limbs: &[Limb], joints: usize, fractions: impl Fn(&Limb) -> Vec<f64>) -> Vec<Option<Vector3<f64>>> {
    let mut positions = vec![None; joints];
    for limb in limbs {
        for (j, fraction) in limb.joints.iter().zip(fractions(limb)) {
            positions[*j as usize] = Some(limb.path.at(fraction));
        }
    }
    positions
}

/// Both graphs, and the images of the leaves.
struct Matching<'a> {
    bones: &'a Graph,
    ours: &'a Ends,
    branches: &'a Graph,
    theirs: &'a Ends,
    images: &'a Images,
}

impl Matching<'_> {
    /// Matched leaves of the template with their images.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.images.iter().enumerate().filter_map(|(i, image)| Some((i, (*image)?)))
    }

    /// Adjacency of each joint in the tree that the matched leaves span.
    fn spanned(&self) -> Vec<Vec<u32>> {
        let mut spanned = vec![Vec::new(); self.bones.points.len()];
        let mut ends = self.pairs().map(|(i, _)| i);
        let Some(first) = ends.next() else { return spanned };
        for other in ends {
            for pair in self.ours.paths[first].back_from(self.ours.nodes[other]).windows(2) {
                let [a, b] = [pair[0], pair[1]];
                if !spanned[a as usize].contains(&b) {
                    spanned[a as usize].push(b);
                    spanned[b as usize].push(a);
                }
            }
        }
        spanned
    }

    /// The node of each junction and leaf.
    fn nodes(&self, spanned: &[Vec<u32>]) -> Vec<Option<u32>> {
        let mut nodes: Vec<Option<u32>> = vec![None; spanned.len()];
        for (i, e) in self.pairs() {
            nodes[self.ours.nodes[i] as usize] = Some(self.theirs.nodes[e]);
        }
        let scale = self.scale();
        let meetings: Vec<u32> = (0..spanned.len() as u32).filter(|j| spanned[*j as usize].len() > 2).collect();
        let mut known = Vec::new();
        for b in meetings {
            let to = self.bones.paths(b).length;
            let cost = |n: u32| {
                let near = |(other, lengths): &(u32, Vec<f64>)| {
                    (MIN_JUNCTION_DISTANCE_RATIO * scale * to[*other as usize] - lengths[n as usize]).max(0.0)
                };
                self.cost(b, n, scale, &spanned[b as usize]) + NEARNESS_PENALTY * known.iter().map(near).sum::<f64>()
            };
            let all = (0..self.branches.points.len() as u32).map(|n| (cost(n), n));
            let best = all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, n)| n);
            nodes[b as usize] = best;
            known.extend(best.map(|n| (b, self.branches.paths(n).length)));
        }
        nodes
    }

    /// Scale from template to curve: geometric mean over pairs of leaves.
    fn scale(&self) -> f64 {
        let pairs: Vec<_> = self.pairs().collect();
        let (mut sum, mut weight) = (0.0, 0.0);
        for (k, (i, e)) in pairs.iter().enumerate() {
            for (j, f) in &pairs[..k] {
                let (ours, theirs) = (self.ours.between(*i, *j), self.theirs.between(*e, *f));
                sum += ours * (theirs / ours).ln();
                weight += ours;
            }
        }
        (sum / weight).exp()
    }

    fn cost(&self, b: u32, n: u32, scale: f64, sides: &[u32]) -> f64 {
        let mut means = vec![(0.0, 0.0); sides.len()];
        let (mut misfit, mut ends) = (0.0, 0.0);
        for (i, e) in self.pairs() {
            let length = self.theirs.paths[e].length[n as usize];
            misfit += (length - scale * self.ours.paths[i].length[b as usize]).abs();
            ends += 1.0;
            let side = sides.iter().position(|s| Some(*s) == self.ours.paths[i].before(b));
            if let Some(side) = side {
                means[side] = (means[side].0 + length, means[side].1 + 1.0);
            }
        }
        means.iter().filter(|w| w.1 > 0.0).map(|w| w.0 / w.1).sum::<f64>() + LENGTH_WEIGHT * misfit / ends
    }
}

/// Chains of joints between junctions and leaves; each limb once.
fn chains(spanned: &[Vec<u32>]) -> Vec<Vec<u32>> {
    let mut chains = Vec::new();
    for v in (0..spanned.len() as u32).filter(|v| !matches!(spanned[*v as usize].len(), 0 | 2)) {
        for &to in &spanned[v as usize] {
            let mut chain = vec![v, to];
            while let [a, b] = spanned[chain[chain.len() - 1] as usize][..] {
                chain.push(if a == chain[chain.len() - 2] { b } else { a });
            }
            if v < chain[chain.len() - 1] {
                chains.push(chain);
            }
        }
    }
    chains
}
