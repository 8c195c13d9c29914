//! The movable joints and the coordinates of their rotations.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::{IkOptions, Target};
use crate::character::{Limits, Pose, Skeleton, SwingTwist};

/// Distance from a limit at which it is active, rad: above the rounding of a projection.
const ACTIVE_TOLERANCE: f64 = 1e-9;

/// Movable joints, with three coordinates each.
pub(super) struct Variables {
    pub(super) joints: Vec<u32>,
    /// For each target the variables (indices into `joints`) that affect it.
    pub(super) of_target: Vec<Vec<usize>>,
}

impl Variables {
    pub(super) fn of(skeleton: &Skeleton, targets: &[Target], options: &IkOptions) -> Self {
        let parent = |j: u32| skeleton.joints()[j as usize].parent;
        let mut moves = vec![false; skeleton.joint_count()];
        for target in targets {
            let chain = std::iter::successors(Some(target.joint), |&j| parent(j));
            let count = target.chain.map_or(usize::MAX, |n| n.saturating_add(1));
            chain.take(count).for_each(|j| moves[j as usize] = true);
        }
        let movable = |j: &u32| moves[*j as usize] && !options.locked.contains(j);
        let joints: Vec<u32> = skeleton.parents_first().iter().copied().filter(movable).collect();
        let above = |target: &Target| {
            let chain: Vec<u32> = std::iter::successors(Some(target.joint), |&j| parent(j)).collect();
            (0..joints.len()).filter(|&k| chain.contains(&joints[k])).collect()
        };
        let of_target = targets.iter().map(above).collect();
        Self { joints, of_target }
    }

    /// The pose with every movable joint rotated by `angle` within its limits; the axes differ from joint to joint to avoid symmetry.
    pub(super) fn bent(&self, skeleton: &Skeleton, pose: &Pose, angle: f64) -> Pose {
        let mut pose = pose.clone();
        for (k, &j) in self.joints.iter().enumerate() {
            let k = k as f64;
            let axis = Vector3::new(1.0, 0.3 * (k + 1.0).sin(), 0.7 * (2.0 * k + 0.5).cos()).normalize();
            let local = &mut pose.locals[j as usize];
            local.rotation *= UnitQuaternion::from_scaled_axis(axis * angle);
        }
        super::within_limits(skeleton, &pose)
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
