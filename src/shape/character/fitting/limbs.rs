//! A matching of ends laid out: where limbs meet, the way of each limb on the curve, and what it costs.
//!
//! A joint `b` where limbs meet has matched ends behind each of its bones. Its image is the node of the curve
//!
//! ```text
//! min_n  Σ_bones mean_ends d_C(e, n)  +  ε mean_ends |d_C(e, n) − s d_T(e, b)|  +  what it is too near to the images before it
//! ```
//!
//! With three bones on a tree the first term alone is least at the one node where the ways part; where four meet and the curve has two
//! junctions, it is as little on all of the way between them, and lengths decide.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};

use super::along::{Path, bent};
use super::ends::Ends;
use super::graph::Graph;
use super::matching::{Images, PLACE, spare};
use super::moments::{Alignment, Moments};

/// `ε`: decides where the first term does not.
const LENGTHS: f64 = 0.1;
/// Limbs between two joints where limbs meet keep at least this share of their length: without it they vanish where the curve has one
/// junction for both.
const APART: f64 = 0.3;
/// What a unit less costs: more than a bone's share of the first term.
const TOO_NEAR: f64 = 4.0;
/// Limbs shorter than this share of their length cost no more.
const MIN_RATIO: f64 = 0.05;

/// A limb with its way on the curve.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    /// Joints from one end to the other.
    pub(super) joints: Vec<u32>,
    /// Share of the limb's length at which each joint is.
    shares: Vec<f64>,
    /// Length in the template.
    pub(super) length: f64,
    /// Its way.
    pub(super) path: Path,
}

/// Joints on the curve.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Limbs that have a way.
    pub(super) limbs: Vec<Limb>,
    /// Where the joints are, in units of the curve; `None` where the curve has nothing for them.
    places: Vec<Option<Vector3<f64>>>,
    /// The similarity that explains most of it.
    pub(super) alignment: Alignment,
    pub(super) cost: f64,
    matched: usize,
}

impl Layout {
    /// Lays a matching out; `None` where a limb would have no length at all.
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
            let way = branches.paths(to).back_from(from);
            let least = doubted(joints[0]).min(doubted(joints[joints.len() - 1]));
            trust = least.min(trust);
            used[usize::from(least < 1.0)].extend(way.windows(2).map(|w| [w[0].min(w[1]), w[0].max(w[1])]));
            limbs.push(Limb::new(bones, branches, joints, &way)?);
        }
        let [sure, doubted] = used;
        let only = doubted.difference(&sure).copied();
        let covered = branches.share_around(sure.iter().copied()) + trust * branches.share_around(only);
        let mut layout = Self {
            places: placed(&limbs, bones.points.len(), |limb| limb.shares.clone()),
            limbs,
            alignment: Moments::default().alignment(),
            cost: 0.0,
            matched: images.iter().flatten().count(),
        };
        layout.alignment = layout.aligned(bones);
        let missing: f64 = ours.need.iter().zip(images).filter_map(|(need, i)| i.is_none().then_some(need)).sum();
        layout.cost = layout.distortion() + PLACE * layout.alignment.residual + missing + spare(covered);
        Some(layout)
    }

    /// Length of all limbs on the curve by that in the template: a pose does not change it.
    pub(super) fn scale(&self) -> f64 {
        self.limbs.iter().map(|l| l.path.length()).sum::<f64>() / self.limbs.iter().map(|l| l.length).sum::<f64>()
    }

    /// Ends of the template that have an image.
    pub(super) fn matched_ends(&self) -> usize {
        self.matched
    }

    /// Whether joints are elsewhere by more than a share of the curve's length on average.
    pub(super) fn differs(&self, other: &Self, share: f64) -> bool {
        let both: Vec<f64> = self
            .places
            .iter()
            .zip(&other.places)
            .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()))
            .collect();
        both.iter().sum::<f64>() > share * both.len() as f64
    }

    /// The joints with bends where those of the curve are.
    pub(super) fn refined(&self) -> Vec<Option<Vector3<f64>>> {
        placed(&self.limbs, self.places.len(), |limb| bent(&limb.path, &limb.shares))
    }

    /// The turn of the joints where limbs meet, of those next to them and of limbs between two of them; of all joints where limbs do not
    /// meet.
    pub(super) fn trunk_turn(&self, bones: &Graph, places: &[Option<Vector3<f64>>]) -> Matrix3<f64> {
        let meet = |j: &u32| bones.neighbors(*j).len() > 2;
        let between = self.limbs.iter().filter(|l| meet(&l.joints[0]) && meet(&l.joints[l.joints.len() - 1]));
        let mut trunk: BTreeSet<u32> = between.flat_map(|l| l.joints.iter().copied()).collect();
        for j in (0..places.len() as u32).filter(meet) {
            trunk.insert(j);
            trunk.extend(bones.neighbors(j));
        }
        let mut moments = Moments::default();
        for j in &trunk {
            if let Some(place) = places[*j as usize] {
                moments.add(1.0, &bones.points[*j as usize], &place);
            }
        }
        if trunk.is_empty() { self.alignment.rotation } else { moments.alignment().rotation }
    }

    /// Weights are the lengths of the bones at a joint.
    fn aligned(&self, bones: &Graph) -> Alignment {
        let mut moments = Moments::default();
        for (j, place) in self.places.iter().enumerate() {
            let Some(place) = place else { continue };
            let weight: f64 = bones.neighbors(j as u32).iter().map(|n| bones.length(j as u32, *n)).sum();
            moments.add(weight, &bones.points[j], place);
        }
        moments.alignment()
    }

    /// Variance of the logarithm of how limbs are stretched, weighted by their lengths.
    fn distortion(&self) -> f64 {
        let total: f64 = self.limbs.iter().map(|l| l.length).sum();
        let log = |l: &Limb| (l.path.length() / l.length).max(MIN_RATIO).ln();
        let mean = self.limbs.iter().map(|l| l.length * log(l)).sum::<f64>() / total;
        self.limbs.iter().map(|l| l.length * (log(l) - mean).powi(2)).sum::<f64>() / total
    }
}

impl Limb {
    fn new(bones: &Graph, branches: &Graph, joints: Vec<u32>, way: &[u32]) -> Option<Self> {
        let mut upto = vec![0.0];
        for pair in joints.windows(2) {
            upto.push(upto[upto.len() - 1] + bones.length(pair[0], pair[1]));
        }
        let length = upto[upto.len() - 1];
        let path = Path::new(way.iter().map(|n| branches.points[*n as usize]).collect());
        let shares = upto.iter().map(|u| u / length).collect();
        (length > 0.0 && path.length() > 0.0).then_some(Self { joints, shares, length, path })
    }
}

/// The joints of limbs at the shares that `shares` gives.
fn placed(limbs: &[Limb], joints: usize, shares: impl Fn(&Limb) -> Vec<f64>) -> Vec<Option<Vector3<f64>>> {
    let mut places = vec![None; joints];
    for limb in limbs {
        for (j, share) in limb.joints.iter().zip(shares(limb)) {
            places[*j as usize] = Some(limb.path.at(share));
        }
    }
    places
}

/// Both graphs, and the images of the ends.
struct Matching<'a> {
    bones: &'a Graph,
    ours: &'a Ends,
    branches: &'a Graph,
    theirs: &'a Ends,
    images: &'a Images,
}

impl Matching<'_> {
    /// Ends of the template with their images.
    fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.images.iter().enumerate().filter_map(|(i, image)| Some((i, (*image)?)))
    }

    /// Neighbors of each joint in the tree between the matched ends.
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

    /// The node of each joint where limbs meet or end.
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
                    (APART * scale * to[*other as usize] - lengths[n as usize]).max(0.0)
                };
                self.cost(b, n, scale, &spanned[b as usize]) + TOO_NEAR * known.iter().map(near).sum::<f64>()
            };
            let all = (0..self.branches.points.len() as u32).map(|n| (cost(n), n));
            let best = all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, n)| n);
            nodes[b as usize] = best;
            known.extend(best.map(|n| (b, self.branches.paths(n).length)));
        }
        nodes
    }

    /// Length on the curve by length in the template: the geometric mean over pairs of ends.
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
        let mut ways = vec![(0.0, 0.0); sides.len()];
        let (mut misfit, mut ends) = (0.0, 0.0);
        for (i, e) in self.pairs() {
            let length = self.theirs.paths[e].length[n as usize];
            misfit += (length - scale * self.ours.paths[i].length[b as usize]).abs();
            ends += 1.0;
            let side = sides.iter().position(|s| Some(*s) == self.ours.paths[i].before(b));
            if let Some(side) = side {
                ways[side] = (ways[side].0 + length, ways[side].1 + 1.0);
            }
        }
        ways.iter().filter(|w| w.1 > 0.0).map(|w| w.0 / w.1).sum::<f64>() + LENGTHS * misfit / ends
    }
}

/// Joints in a row between those where limbs meet or end; each limb once.
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
