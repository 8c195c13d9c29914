//! Rotations and translations of the target, sample by sample.

use nalgebra::{Point3, UnitQuaternion, Vector3};

use super::alignment::Alignment;
use super::sampling::Motion;
use super::{Correspondence, names};
use crate::character::ik::within_limits;
use crate::character::{CharacterError, Pose, Skeleton};
use plumbline_num::run::Run;

/// How a joint of the target takes its world rotation from rest `Δ = W W⁰⁻¹`.
enum Follows {
    /// A joint of the source.
    Joint(u32),
    /// Its parent.
    Parent,
    /// Two joints of the trunk, at a fraction of the way from the first to the second.
    Between { joints: [u32; 2], fraction: f64 },
    /// The first of two joints, and a fraction of the twist of the second about the axis between them.
    Twist { joints: [u32; 2], axis: Vector3<f64>, fraction: f64 },
}

/// Poses of the target, and the largest rotation by which limits changed one, rad.
pub(super) fn poses(
    source: &Skeleton,
    motion: &Motion,
    target: &Skeleton,
    map: &Correspondence,
    alignment: &Alignment,
    run: &Run,
) -> Result<(Vec<Pose>, f64), CharacterError> {
    let follows = follows(target, map, alignment);
    let stretches = stretching(source, motion, map, alignment);
    let limited = target.joints().iter().any(|j| j.limits.is_some());
    let (mut poses, mut largest) = (Vec::with_capacity(motion.rotations.len()), 0.0_f64);
    for sample in 0..motion.rotations.len() {
        run.check()?;
        let mut pose = rotated(target, &follows, alignment, &motion.rotations[sample]);
        for &[i, j] in &stretches {
            let stretch =
                motion.locals[sample].locals[i as usize].translation - source.joints()[i as usize].rest.translation;
            let above = |of: usize, skeleton: &Skeleton, joint: u32| {
                let parent = skeleton.joints()[joint as usize].parent;
                parent.map_or_else(UnitQuaternion::identity, |p| alignment.rest[of][p as usize])
            };
            let world = alignment.rotation * (above(0, source, i) * stretch) * alignment.scale;
            pose.locals[j as usize].translation += above(1, target, j).inverse() * world;
        }
        if limited {
            let allowed = within_limits(target, &pose);
            for (a, b) in allowed.locals.iter().zip(&pose.locals) {
                largest = largest.max(a.rotation.angle_to(&b.rotation));
            }
            pose = allowed;
        }
        if let Some([i, j]) = alignment.root {
            let moved = motion.positions[sample][i as usize] - alignment.at[0][i as usize];
            let at = alignment.at[1][j as usize] + alignment.shift + alignment.rotation * moved * alignment.scale;
            place(target, &mut pose, j, &at)?;
        }
        poses.push(pose);
    }
    Ok((poses, largest))
}

/// Translates a joint to a world position.
pub(super) fn place(skeleton: &Skeleton, pose: &mut Pose, joint: u32, at: &Point3<f64>) -> Result<(), CharacterError> {
    let local = match skeleton.joints()[joint as usize].parent {
        None => at.coords,
        Some(parent) => {
            let above = skeleton.globals(pose)?[parent as usize];
            let back = above.try_inverse();
            let back = back.ok_or_else(|| CharacterError::flat_joint(&skeleton.joints()[parent as usize].name))?;
            back.transform_point(at).coords
        }
    };
    pose.locals[joint as usize].translation = local;
    Ok(())
}

/// The pose of the target with the rotations of a sample.
fn rotated(target: &Skeleton, follows: &[Follows], alignment: &Alignment, world_s: &[UnitQuaternion<f64>]) -> Pose {
    let r = alignment.rotation;
    let own = |k: usize, i: u32| {
        let delta = world_s[i as usize] * alignment.rest[0][i as usize].inverse();
        r * delta * r.inverse() * alignment.bend[k]
    };
    let of = |j: u32| {
        if let Follows::Joint(i) = follows[j as usize] { own(j as usize, i) } else { UnitQuaternion::identity() }
    };
    let mut delta = vec![UnitQuaternion::identity(); target.joint_count()];
    let mut pose = target.rest_pose();
    for &j in target.parents_first() {
        let k = j as usize;
        let parent = target.joints()[k].parent.map(|p| p as usize);
        let above = parent.map_or_else(UnitQuaternion::identity, |p| delta[p]);
        delta[k] = match &follows[k] {
            Follows::Joint(i) => own(k, *i),
            Follows::Parent => above,
            Follows::Between { joints: [a, b], fraction } => {
                let (a, b) = (of(*a), of(*b));
                a * UnitQuaternion::from_scaled_axis((a.inverse() * b).scaled_axis() * *fraction)
            }
            Follows::Twist { joints: [a, b], axis, fraction } => {
                let (a, b) = (of(*a), of(*b));
                let relative = a.inverse() * b;
                let twist = 2.0 * relative.imag().dot(axis).atan2(relative.w);
                let twist = (twist + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
                a * UnitQuaternion::from_scaled_axis(axis * (twist * fraction))
            }
        };
        let world = delta[k] * alignment.rest[1][k];
        let above = parent.map_or_else(UnitQuaternion::identity, |p| delta[p] * alignment.rest[1][p]);
        pose.locals[k].rotation = UnitQuaternion::new_normalize((above.inverse() * world).into_inner());
    }
    pose
}

/// Distance of a joint from the axis of a limb bone within which it spreads the bone's twist, as a fraction of the bone.
const ON_BONE: f64 = 0.05;

fn follows(target: &Skeleton, map: &Correspondence, alignment: &Alignment) -> Vec<Follows> {
    let below = super::alignment::mapped_below(target, map);
    let at = &alignment.at[1];
    let parent = |j: u32| target.joints()[j as usize].parent;
    let each = |j: u32| {
        if let Some(i) = map.source_of[j as usize] {
            return Follows::Joint(i);
        }
        let Some(a) = target.ancestors(j).find(|p| map.source_of[*p as usize].is_some()) else {
            return Follows::Parent;
        };
        let ancestor = |c: u32| target.ancestors(c).take_while(|p| *p != a).any(|p| p == j);
        if alignment.trunk[j as usize] {
            // The next joint of the trunk, or of a limb that goes on from it.
            let next = below[a as usize].iter().map(|pair| pair[1]).filter(|c| ancestor(*c));
            let Some(b) = next.max_by_key(|c| (alignment.trunk[*c as usize], std::cmp::Reverse(*c))) else {
                return Follows::Parent;
            };
            return Follows::Between { joints: [a, b], fraction: along(at, a, j, b).0 };
        }
        // A joint in the chain, or a helper beside it.
        let helper = names::spreads_twist(&target.joints()[j as usize].name) && parent(j) == Some(a);
        let next = below[a as usize]
            .iter()
            .map(|pair| pair[1])
            .find(|c| ancestor(*c) || helper && below[a as usize].len() == 1);
        let Some(b) = next else { return Follows::Parent };
        let (fraction, off) = along(at, a, j, b);
        let axis = (at[b as usize] - at[a as usize]).try_normalize(0.0);
        match axis {
            Some(axis) if off < ON_BONE => Follows::Twist { joints: [a, b], axis, fraction },
            _ => Follows::Parent,
        }
    };
    (0..target.joint_count() as u32).map(each).collect()
}

/// Position of `j` along the segment from `a` to `b`, 0 to 1, and its distance from it as a fraction of its length.
fn along(at: &[Point3<f64>], a: u32, j: u32, b: u32) -> (f64, f64) {
    let (axis, own) = (at[b as usize] - at[a as usize], at[j as usize] - at[a as usize]);
    let length = axis.norm_squared();
    if !(length > 0.0) {
        return (0.0, f64::INFINITY);
    }
    let fraction = own.dot(&axis) / length;
    (fraction.clamp(0.0, 1.0), (own - axis * fraction).norm() / length.sqrt())
}

/// Joints other than the root that the motion translates, with those that follow them.
fn stretching(source: &Skeleton, motion: &Motion, map: &Correspondence, alignment: &Alignment) -> Vec<[u32; 2]> {
    let root = alignment.root.map(|pair| pair[0]);
    let above_root = |i: u32| root.is_some_and(|root| root == i || source.ancestors(root).any(|j| j == i));
    let moves = |i: u32| {
        let rest = source.joints()[i as usize].rest.translation;
        motion.locals.iter().any(|pose| (pose.locals[i as usize].translation - rest).norm() > 1e-9 * rest.norm())
    };
    let pairs = map.source_of.iter().zip(0..).filter_map(|(i, j)| Some([(*i)?, j]));
    pairs.filter(|[i, _]| !above_root(*i) && moves(*i)).collect()
}
