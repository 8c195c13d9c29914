//! Forward kinematics.

use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};

use super::{Goal, Target};
use crate::character::{CharacterError, Pose, Skeleton};

/// World frames and rotations of all joints.
#[derive(Clone)]
pub(super) struct Frames {
    pub(super) world: Vec<Matrix4<f64>>,
    /// Accumulated rotation of each joint, without scale.
    pub(super) rotation: Vec<UnitQuaternion<f64>>,
    /// Length of the chain from the root to each joint.
    reach: Vec<f64>,
}

impl Frames {
    pub(super) fn of(skeleton: &Skeleton, pose: &Pose) -> Result<Self, CharacterError> {
        skeleton.globals(pose)?;
        Ok(Self::chained(skeleton, pose))
    }

    /// Without checks, for a pose known to belong to the skeleton.
    pub(super) fn chained(skeleton: &Skeleton, pose: &Pose) -> Self {
        let joints = skeleton.joint_count();
        let (mut world, mut rotation) = (vec![Matrix4::identity(); joints], vec![UnitQuaternion::identity(); joints]);
        let mut reach = vec![0.0; joints];
        for &j in skeleton.parents_first() {
            let (k, local) = (j as usize, &pose.locals[j as usize]);
            (world[k], rotation[k]) = (local.matrix(), local.rotation);
            if let Some(parent) = skeleton.joints()[k].parent.map(|p| p as usize) {
                world[k] = world[parent] * world[k];
                rotation[k] = rotation[parent] * rotation[k];
                reach[k] = reach[parent] + (origin(&world[k]) - origin(&world[parent])).norm();
            }
        }
        Self { world, rotation, reach }
    }

    /// Position of a joint.
    pub(super) fn at(&self, joint: u32) -> Point3<f64> {
        origin(&self.world[joint as usize])
    }

    /// World position of a point in a joint's frame.
    pub(super) fn point(&self, joint: u32, point: &Point3<f64>) -> Point3<f64> {
        self.world[joint as usize].transform_point(point)
    }

    /// Unit of a target's residual: for positions the length of the chain above it, 1 if that is zero; 1 rad otherwise.
    pub(super) fn scale(&self, target: &Target) -> f64 {
        let Goal::Position { point, .. } = &target.goal else { return 1.0 };
        let tip = (self.point(target.joint, point) - self.at(target.joint)).norm();
        let length = self.reach[target.joint as usize] + tip;
        if length > 0.0 { length } else { 1.0 }
    }
}

fn origin(frame: &Matrix4<f64>) -> Point3<f64> {
    Point3::from(Vector3::new(frame[(0, 3)], frame[(1, 3)], frame[(2, 3)]))
}
