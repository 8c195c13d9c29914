//! The movable joints and their coordinates.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::{Goal, IkOptions, RootMotion, Target, body_roots, moves_root};
use crate::character::{Limits, Pose, Skeleton, SwingTwist};
use plumbline_num::math::Trs;

/// Distance from a limit at which it is active, rad: above the rounding of a projection.
const ACTIVE_TOLERANCE: f64 = 1e-9;

/// Three coordinates of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// Its rotation.
    Rotation(u32),
    /// Its translation: of a root that a position is sought for.
    Translation(u32),
}

impl Motion {
    pub(super) fn joint(self) -> u32 {
        let (Self::Rotation(joint) | Self::Translation(joint)) = self;
        joint
    }

    /// The coordinates in a pose.
    pub(super) fn at<'a>(self, skeleton: &'a Skeleton, pose: &Pose) -> At<'a> {
        match self {
            Self::Rotation(joint) => At::Rotation(Coordinates::of(skeleton, pose, joint)),
            Self::Translation(joint) => At::Translation(pose.locals[joint as usize].translation),
        }
    }
}

/// What can move, with three coordinates each.
pub(super) struct Variables {
    pub(super) motions: Vec<Motion>,
    /// For each target the variables (indices into `motions`) that affect it.
    pub(super) of_target: Vec<Vec<usize>>,
    /// Unit of translations, so that they compare to angles: the length of the longest chain, units of the model.
    pub(super) unit: f64,
}

impl Variables {
    pub(super) fn of(skeleton: &Skeleton, targets: &[Target], options: &IkOptions, unit: f64) -> Self {
        let chain = |target: &Target| std::iter::once(target.joint).chain(skeleton.ancestors(target.joint));
        let mut rotates = vec![false; skeleton.joint_count()];
        for target in targets {
            let count = target.chain.map_or(usize::MAX, |n| n.saturating_add(1));
            chain(target).take(count).for_each(|j| rotates[j as usize] = true);
        }
        let mut translates = vec![false; skeleton.joint_count()];
        if options.root == RootMotion::Pinned {
            for root in body_roots(skeleton) {
                rotates[root as usize] = targets.iter().any(|t| moves_root(skeleton, root, t));
                let sought = |t: &Target| t.joint == root && matches!(t.goal, Goal::Position { .. });
                translates[root as usize] = targets.iter().any(sought);
            }
        }
        for &joint in &options.locked {
            if let Some(rotates) = rotates.get_mut(joint as usize) {
                (*rotates, translates[joint as usize]) = (false, false);
            }
        }
        let (mut motions, mut of_joint) = (Vec::new(), vec![0..0; skeleton.joint_count()]);
        for &j in skeleton.parents_first() {
            let first = motions.len();
            motions.extend(rotates[j as usize].then_some(Motion::Rotation(j)));
            motions.extend(translates[j as usize].then_some(Motion::Translation(j)));
            of_joint[j as usize] = first..motions.len();
        }
        let of_target = targets.iter().map(|t| chain(t).flat_map(|j| of_joint[j as usize].clone()).collect()).collect();
        Self { motions, of_target, unit }
    }

    /// The pose with every rotating joint rotated by `angle` within its limits; the axes differ from joint to joint to avoid symmetry.
    pub(super) fn bent(&self, skeleton: &Skeleton, pose: &Pose, angle: f64) -> Pose {
        let mut pose = pose.clone();
        for (k, motion) in self.motions.iter().enumerate() {
            let Motion::Rotation(j) = motion else { continue };
            let k = k as f64;
            let axis = Vector3::new(1.0, 0.3 * (k + 1.0).sin(), 0.7 * (2.0 * k + 0.5).cos()).normalize();
            let local = &mut pose.locals[*j as usize];
            local.rotation *= UnitQuaternion::from_scaled_axis(axis * angle);
        }
        super::within_limits(skeleton, &pose)
    }
}

/// The coordinates of a motion in a pose.
pub(super) enum At<'a> {
    Rotation(Coordinates<'a>),
    Translation(Vector3<f64>),
}

impl At<'_> {
    /// Angular velocities, in the parent's frame, of the three coordinates, as columns; zero for a translation.
    pub(super) fn velocities(&self) -> Matrix3<f64> {
        if let Self::Rotation(coordinates) = self { coordinates.velocities() } else { Matrix3::zeros() }
    }

    /// Takes a step, projected onto the limits, and returns the step actually taken.
    pub(super) fn stepped(&self, step: Vector3<f64>, unit: f64, local: &mut Trs) -> Vector3<f64> {
        match self {
            Self::Translation(from) => {
                local.translation = from + step * unit;
                step
            }
            Self::Rotation(coordinates) => {
                let (rotation, taken) = coordinates.stepped(step);
                local.rotation = rotation;
                taken
            }
        }
    }

    /// Normals of the active limits against which the gradient pushes.
    pub(super) fn blocked(&self, push: &Vector3<f64>) -> Vec<Vector3<f64>> {
        if let Self::Rotation(coordinates) = self { coordinates.blocked(push) } else { Vec::new() }
    }

    /// Rotation from rest in coordinates, and its derivative in ours; zero for a translation, which nothing draws to rest.
    pub(super) fn rotation_from_rest(&self) -> (Vector3<f64>, Matrix3<f64>) {
        if let Self::Rotation(coordinates) = self {
            coordinates.rotation_from_rest()
        } else {
            (Vector3::zeros(), Matrix3::zeros())
        }
    }
}

/// The local coordinates of a joint's rotation: swing and twist from rest for a joint with limits, for others a rotation vector from the
/// current rotation, in the joint's own frame.
pub(super) struct Coordinates<'a> {
    rest: UnitQuaternion<f64>,
    rotation: UnitQuaternion<f64>,
    limited: Option<(&'a Limits, SwingTwist)>,
}

impl<'a> Coordinates<'a> {
    pub(super) fn of(skeleton: &'a Skeleton, pose: &Pose, joint: u32) -> Self {
        let described = &skeleton.joints()[joint as usize];
        let (rest, rotation) = (described.rest.rotation, pose.locals[joint as usize].rotation);
        let limited = described.limits.as_ref().map(|limits| (limits, limits.split(&(rest.inverse() * rotation))));
        Self { rest, rotation, limited }
    }

    /// Angular velocities, in the parent's frame, of the three coordinates, as columns.
    pub(super) fn velocities(&self) -> Matrix3<f64> {
        let Some((limits, at)) = &self.limited else { return self.rotation.to_rotation_matrix().into_inner() };
        let (e1, e2) = (limits.across.into_inner(), limits.second().into_inner());
        let swing = e1 * at.swing.x + e2 * at.swing.y;
        let left = left_jacobian(&swing);
        let twist = UnitQuaternion::from_scaled_axis(swing) * limits.axis.into_inner();
        self.rest.to_rotation_matrix().into_inner() * Matrix3::from_columns(&[left * e1, left * e2, twist])
    }

    /// The rotation after a step and projection onto the limits, and the step actually taken.
    pub(super) fn stepped(&self, step: Vector3<f64>) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let Some((limits, at)) = &self.limited else {
            return (self.rotation * UnitQuaternion::from_scaled_axis(step), step);
        };
        let there = limits.nearest(&SwingTwist { swing: at.swing + step.xy(), twist: at.twist + step.z });
        let swing = there.swing - at.swing;
        (self.rest * limits.rotation(&there), Vector3::new(swing.x, swing.y, there.twist - at.twist))
    }

    /// Normals of the active limits against which the gradient pushes.
    pub(super) fn blocked(&self, push: &Vector3<f64>) -> Vec<Vector3<f64>> {
        let Some((limits, at)) = &self.limited else { return Vec::new() };
        let mut blocked = Vec::new();
        let [a, b] = limits.swing;
        for (half, axis) in [(a, Vector3::x()), (b, Vector3::y())] {
            if half == 0.0 {
                blocked.push(axis);
            }
        }
        if a > 0.0 && b > 0.0 {
            let measure = (at.swing.x / a).hypot(at.swing.y / b);
            let outward = Vector3::new(at.swing.x / (a * a), at.swing.y / (b * b), 0.0);
            if measure >= 1.0 - ACTIVE_TOLERANCE && push.dot(&outward) > 0.0 {
                blocked.push(outward.normalize());
            }
        } else {
            // One swing axis is left, between −a and a.
            for (half, value, axis) in [(a, at.swing.x, Vector3::x()), (b, at.swing.y, Vector3::y())] {
                if half > 0.0 && value.abs() >= half - ACTIVE_TOLERANCE && push.dot(&axis) * value > 0.0 {
                    blocked.push(axis);
                }
            }
        }
        let [least, largest] = limits.twist;
        let (low, high) = (at.twist <= least + ACTIVE_TOLERANCE, at.twist >= largest - ACTIVE_TOLERANCE);
        if low && push.z < 0.0 || high && push.z > 0.0 {
            blocked.push(Vector3::z());
        }
        blocked
    }

    /// Rotation from rest in coordinates, and its derivative in ours.
    pub(super) fn rotation_from_rest(&self) -> (Vector3<f64>, Matrix3<f64>) {
        if let Some((_, at)) = &self.limited {
            return (Vector3::new(at.swing.x, at.swing.y, at.twist), Matrix3::identity());
        }
        let vector = (self.rest.inverse() * self.rotation).scaled_axis();
        // log(R exp δ) = log R + J_r⁻¹ δ, and J_r(v) = J_l(−v).
        (vector, left_jacobian(&-vector).try_inverse().unwrap_or_else(Matrix3::identity))
    }
}

/// Left Jacobian `J_l` of the exponential map: its angular velocity per change of the rotation vector.
pub(super) fn left_jacobian(vector: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (vector.norm(), vector.cross_matrix());
    let (b, c) = if angle < 1e-4 {
        // Taylor series below 1e-4, where the closed form loses half its digits.
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        ((1.0 - angle.cos()) / (angle * angle), (angle - angle.sin()) / angle.powi(3))
    };
    Matrix3::identity() + cross * b + cross * cross * c
}
