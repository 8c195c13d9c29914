//! How two skeletons stand to each other at rest: rotation and scale between them, legs, and the bend that makes the rest pose of one that
//! of the other.

use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::Correspondence;
use super::names::{Part, Role, Side, roles};
use crate::character::Skeleton;
use crate::character::ik::Frames;
use plumbline_num::math::nearest_rotation;

/// A leg that ends at the ground, with the joints of the source in brackets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    /// First joint: `[source, target]`.
    pub(super) top: [u32; 2],
    /// The joint of the foot.
    pub(super) foot: [u32; 2],
    /// The next joint toward the toes.
    pub(super) toes: Option<[u32; 2]>,
    /// Lengths from the first joint to the foot.
    pub(super) length: [f64; 2],
    /// Joints of the target from the foot to the first joint.
    pub(super) chain: usize,
}

pub(super) struct Alignment {
    /// World of the target from that of the source.
    pub(super) rotation: UnitQuaternion<f64>,
    pub(super) scale: f64,
    /// Direction up in the worlds of source and target.
    pub(super) up: [Vector3<f64>; 2],
    /// The joints whose translation is the motion of the whole body, of source and target.
    pub(super) root: Option<[u32; 2]>,
    /// World rotations at rest, of source and target.
    pub(super) rest: [Vec<UnitQuaternion<f64>>; 2],
    /// World positions at rest.
    pub(super) at: [Vec<Point3<f64>>; 2],
    /// `Aⱼ`, by joint of the target.
    pub(super) bend: Vec<UnitQuaternion<f64>>,
    /// Joints of the target that belong to the trunk.
    pub(super) trunk: Vec<bool>,
    /// Displacement that stands the bent rest pose on its ground.
    pub(super) shift: Vector3<f64>,
    pub(super) legs: Vec<Leg>,
}

/// Angle within which an estimated direction is taken for the coordinate axis, rad: postures at rest tilt estimates by less, and files
/// differ by quarter turns.
const SNAP: f64 = 0.52;
/// Length of a limb, as a fraction of the extent of the skeleton, from which it bends with the rest pose and can be a leg: shorter ones are
/// fingers, heads and ears.
const LIMB: f64 = 0.3;
/// Height of a foot above the lowest joint, as a fraction of that of the root: ankles are at a tenth, knees at a half.
const FOOT_HEIGHT: f64 = 0.2;

impl Alignment {
    pub(super) fn new(source: &Skeleton, target: &Skeleton, map: &Correspondence) -> Self {
        let at = [source, target].map(Skeleton::rest_positions);
        let rest = [source, target].map(|s| Frames::chained(s, &s.rest_pose()).rotation);
        let roles = [source, target].map(roles);
        let rotation = rotation_between(&at, map);
        let up = upward(&at[0], &roles[0]);
        let trunk = trunk(target);
        let root = root(target, map);
        let mut alignment = Self {
            up: [up, rotation * up],
            scale: 1.0,
            rotation,
            root,
            rest,
            at,
            bend: Vec::new(),
            trunk: trunk.joints,
            shift: Vector3::zeros(),
            legs: Vec::new(),
        };
        alignment.legs = alignment.legs(source, target, map, &roles[1], &trunk.limb);
        alignment.scale = alignment.scale(map);
        alignment.bend = alignment.bend(target, map, &roles[1], &trunk.limb, trunk.extent);
        alignment.shift = alignment.shift(target);
        alignment
    }

    /// Legs: limbs whose lowest end is near the lowest joint.
    fn legs(
        &self,
        source: &Skeleton,
        target: &Skeleton,
        map: &Correspondence,
        roles: &[Option<Role>],
        limb: &[f64],
    ) -> Vec<Leg> {
        let Some([_, root]) = self.root else { return Vec::new() };
        let height = |j: u32| self.at[1][j as usize].coords.dot(&self.up[1]);
        let lowest = (0..target.joint_count() as u32).map(height).fold(f64::INFINITY, f64::min);
        let high = lowest + FOOT_HEIGHT * (height(root) - lowest);
        let extent = limb.iter().copied().fold(0.0, f64::max);
        let mut legs: Vec<Leg> = Vec::new();
        let leaves = (0..target.joint_count() as u32).filter(|j| target.children(*j).is_empty());
        for leaf in leaves.filter(|leaf| height(*leaf) < high) {
            let upward = std::iter::once(leaf).chain(target.ancestors(leaf));
            let mut chain: Vec<u32> = upward.take_while(|j| !self.trunk[*j as usize]).collect();
            chain.reverse();
            let tail = chain.iter().any(|j| matches!(roles[*j as usize], Some((Part::Tail, ..))));
            let long = chain.first().is_some_and(|j| limb[*j as usize] >= LIMB * extent);
            if tail || !long {
                continue;
            }
            let keeps = |j: &&u32| matches!(roles[**j as usize], Some((Part::Clavicle, ..)));
            let mapped = |j: &&u32| map.source_of[**j as usize].is_some();
            let Some(top) = chain.iter().position(|j| mapped(&j) && !keeps(&j)) else { continue };
            let Some(foot) = (top + 1..chain.len()).find(|k| height(chain[*k]) < high && mapped(&&chain[*k])) else {
                continue;
            };
            let pair = |j: u32| map.source_of[j as usize].map(|i| [i, j]);
            let toes = chain[foot + 1..].iter().find(mapped).and_then(|j| pair(*j));
            let (Some(top_pair), Some(foot_pair)) = (pair(chain[top]), pair(chain[foot])) else { continue };
            let length = [
                length(source, &self.at[0], top_pair[0], foot_pair[0]),
                length(target, &self.at[1], chain[top], chain[foot]),
            ];
            let known = legs.iter().any(|leg| leg.foot == foot_pair);
            if !known && length.iter().all(|l| *l > 0.0) {
                legs.push(Leg { top: top_pair, foot: foot_pair, toes, length, chain: foot - top });
            }
        }
        legs
    }

    /// Ratio of leg lengths; of the spread of the joints where there are no legs.
    fn scale(&self, map: &Correspondence) -> f64 {
        let lengths = |of: usize| self.legs.iter().map(|leg| leg.length[of]).sum::<f64>();
        let [ours, theirs] = if self.legs.is_empty() { spread(&self.at, map) } else { [lengths(0), lengths(1)] };
        let scale = theirs / ours;
        if scale > 0.0 && scale.is_finite() { scale } else { 1.0 }
    }

    /// `Aⱼ`: bends the rest pose of the target into that of the source.
    fn bend(
        &self,
        target: &Skeleton,
        map: &Correspondence,
        roles: &[Option<Role>],
        limb: &[f64],
        extent: f64,
    ) -> Vec<UnitQuaternion<f64>> {
        let below = mapped_below(target, map);
        let mut bend = vec![UnitQuaternion::identity(); target.joint_count()];
        for &j in target.parents_first() {
            let k = j as usize;
            let above = target.joints()[k].parent.map_or_else(UnitQuaternion::identity, |p| bend[p as usize]);
            let keeps = self.trunk[k]
                || limb[k] < LIMB * extent
                || matches!(roles[k], Some((Part::Hips | Part::Trunk | Part::Neck | Part::Head | Part::Clavicle, ..)));
            bend[k] = match map.source_of[k] {
                _ if let Some(leg) = self.legs.iter().find(|leg| leg.foot[1] == j) => self.heading(leg),
                Some(i) if !keeps && !below[k].is_empty() => {
                    let along = |of: usize, from: u32, to: u32| {
                        let direction = self.at[of][to as usize] - self.at[of][from as usize];
                        direction.try_normalize(0.0).unwrap_or_else(Vector3::zeros)
                    };
                    let theirs: Vector3<f64> = below[k].iter().map(|[_, c]| along(1, j, *c)).sum();
                    let ours: Vector3<f64> = below[k].iter().map(|[c, _]| along(0, i, *c)).sum();
                    let rotation = UnitQuaternion::rotation_between(&(above * theirs), &(self.rotation * ours));
                    rotation.unwrap_or_else(UnitQuaternion::identity) * above
                }
                _ => above,
            };
        }
        bend
    }

    /// Rotation of a foot about the vertical, to the heading of its counterpart.
    fn heading(&self, leg: &Leg) -> UnitQuaternion<f64> {
        let Some(toes) = leg.toes else { return UnitQuaternion::identity() };
        let flat = |v: Vector3<f64>| v - self.up[1] * self.up[1].dot(&v);
        let along = |of: usize| self.at[of][toes[of] as usize] - self.at[of][leg.foot[of] as usize];
        let (ours, theirs) = (flat(self.rotation * along(0)), flat(along(1)));
        UnitQuaternion::rotation_between(&theirs, &ours).unwrap_or_else(UnitQuaternion::identity)
    }

    /// Mean height that the feet lose as the rest pose bends.
    fn shift(&self, target: &Skeleton) -> Vector3<f64> {
        let mut pose = target.rest_pose();
        let world: Vec<_> = self.bend.iter().zip(&self.rest[1]).map(|(bend, rest)| bend * rest).collect();
        for (k, joint) in target.joints().iter().enumerate() {
            let above = joint.parent.map_or_else(UnitQuaternion::identity, |p| world[p as usize]);
            pose.locals[k].rotation = above.inverse() * world[k];
        }
        let bent = Frames::chained(target, &pose).positions();
        let lost = |leg: &Leg| {
            let foot = leg.foot[1] as usize;
            (self.at[1][foot] - bent[foot]).dot(&self.up[1])
        };
        if self.legs.is_empty() {
            return Vector3::zeros();
        }
        self.up[1] * (self.legs.iter().map(lost).sum::<f64>() / self.legs.len() as f64)
    }
}

/// The rotation that best maps the joints of the source onto those that follow them, about their means.
fn rotation_between(at: &[Vec<Point3<f64>>; 2], map: &Correspondence) -> UnitQuaternion<f64> {
    let pairs = || map.source_of.iter().zip(&at[1]).filter_map(|(i, q)| Some((at[0][(*i)? as usize], *q)));
    let count = pairs().count().max(1) as f64;
    let (p0, q0) = pairs().fold((Vector3::zeros(), Vector3::zeros()), |(a, b), (p, q)| (a + p.coords, b + q.coords));
    let (p0, q0) = (p0 / count, q0 / count);
    let covariance: Matrix3<f64> = pairs().map(|(p, q)| (q.coords - q0) * (p.coords - p0).transpose()).sum();
    // Joints in a row leave the rotation about it open: the smallest is taken.
    let estimate = nearest_rotation(&(covariance + Matrix3::identity() * (1e-6 * covariance.norm())));
    let axes = estimate.map(|x| if x.abs() > 0.75 { x.signum() } else { 0.0 });
    let exact =
        (0..3).all(|k| axes.row(k).abs().sum() == 1.0 && axes.column(k).abs().sum() == 1.0) && axes.determinant() > 0.0;
    let estimate = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(estimate));
    if exact {
        let axes = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        if axes.angle_to(&estimate) < SNAP {
            return axes;
        }
    }
    estimate
}

/// Direction from the feet to the hips, taken for the coordinate axis that is near; y where no names tell.
fn upward(at: &[Point3<f64>], roles: &[Option<Role>]) -> Vector3<f64> {
    let mean = |wanted: &dyn Fn(&Role) -> bool| {
        let found: Vec<_> =
            roles.iter().zip(at).filter(|(role, _)| role.as_ref().is_some_and(wanted)).map(|(_, p)| p.coords).collect();
        (!found.is_empty()).then(|| found.iter().sum::<Vector3<f64>>() / found.len() as f64)
    };
    let side = |role: &Role| role.1 != Side::Middle && role.2 == 0;
    let top = mean(&|role| role.0 == Part::Thigh && side(role));
    let end =
        mean(&|role| role.0 == Part::Foot && side(role)).or_else(|| mean(&|role| role.0 == Part::Shin && side(role)));
    let Some(up) = top.zip(end).and_then(|(top, end)| (top - end).try_normalize(0.0)) else { return Vector3::y() };
    let axis = Vector3::ith(up.iamax(), up[up.iamax()].signum());
    if axis.dot(&up) > SNAP.cos() { axis } else { up }
}

/// The joint from which the parts that follow the source branch, or the nearest above it that follows; else the first that follows.
fn root(target: &Skeleton, map: &Correspondence) -> Option<[u32; 2]> {
    let below = mapped_below(target, map);
    let pair = |j: u32| map.source_of[j as usize].map(|i| [i, j]);
    let first = target.parents_first().iter().copied().find_map(pair)?;
    let mut at = first;
    while let [only] = below[at[1] as usize].as_slice() {
        at = *only;
    }
    // A chain without branches is moved by its first joint.
    Some(if below[at[1] as usize].is_empty() { first } else { at })
}

/// For each joint of the target the pairs that are nearest below it.
pub(super) fn mapped_below(target: &Skeleton, map: &Correspondence) -> Vec<Vec<[u32; 2]>> {
    let mut below: Vec<Vec<[u32; 2]>> = vec![Vec::new(); target.joint_count()];
    let mut nearest: Vec<Option<u32>> = vec![None; target.joint_count()];
    for &j in target.parents_first() {
        let Some(parent) = target.joints()[j as usize].parent else { continue };
        let above = if map.source_of[parent as usize].is_some() { Some(parent) } else { nearest[parent as usize] };
        nearest[j as usize] = above;
        if let (Some(above), Some(i)) = (above, map.source_of[j as usize]) {
            below[above as usize].push([i, j]);
        }
    }
    below
}

struct Trunk {
    /// Joints of the trunk.
    joints: Vec<bool>,
    /// Length of the limb that each joint is in, from the trunk to its farthest end.
    limb: Vec<f64>,
    /// Longest path from a root.
    extent: f64,
}

/// The trunk: joints from which two long limbs go, and all above them.
fn trunk(skeleton: &Skeleton) -> Trunk {
    let at = skeleton.rest_positions();
    let count = skeleton.joint_count();
    let bone = |j: u32| {
        skeleton.joints()[j as usize].parent.map_or(0.0, |p| nalgebra::distance(&at[j as usize], &at[p as usize]))
    };
    let mut below = vec![0.0_f64; count];
    for &j in skeleton.parents_first().iter().rev() {
        if let Some(parent) = skeleton.joints()[j as usize].parent {
            below[parent as usize] = below[parent as usize].max(below[j as usize] + bone(j));
        }
    }
    let extent = skeleton.roots().map(|j| below[j as usize]).fold(0.0, f64::max);
    let mut joints = vec![false; count];
    for &j in skeleton.parents_first().iter().rev() {
        let children = skeleton.children(j);
        let long = children.iter().filter(|c| below[**c as usize] + bone(**c) >= LIMB * extent).count();
        joints[j as usize] = long >= 2 || children.iter().any(|c| joints[*c as usize]);
    }
    let mut limb = vec![0.0; count];
    for &j in skeleton.parents_first() {
        let parent = skeleton.joints()[j as usize].parent;
        limb[j as usize] = match parent {
            Some(p) if !joints[p as usize] => limb[p as usize],
            _ => below[j as usize] + bone(j),
        };
    }
    Trunk { joints, limb, extent }
}

/// Length of the bones from an ancestor to a joint.
fn length(skeleton: &Skeleton, at: &[Point3<f64>], top: u32, end: u32) -> f64 {
    let chain = std::iter::once(end).chain(skeleton.ancestors(end)).take_while(|j| *j != top);
    let bone = |j: u32| {
        skeleton.joints()[j as usize].parent.map_or(0.0, |p| nalgebra::distance(&at[j as usize], &at[p as usize]))
    };
    chain.map(bone).sum()
}

/// Root mean square distances of corresponding joints from their means.
fn spread(at: &[Vec<Point3<f64>>; 2], map: &Correspondence) -> [f64; 2] {
    let pairs = || map.source_of.iter().enumerate().filter_map(|(j, i)| Some([(*i)? as usize, j]));
    let count = pairs().count().max(1) as f64;
    [0, 1].map(|of| {
        let mean = pairs().map(|pair| at[of][pair[of]].coords).sum::<Vector3<f64>>() / count;
        (pairs().map(|pair| (at[of][pair[of]].coords - mean).norm_squared()).sum::<f64>() / count).sqrt()
    })
}
