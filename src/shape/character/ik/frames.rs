//! Where joints are in a pose.

use nalgebra::{Matrix3, Matrix4, Point3, UnitQuaternion, Vector3};

use super::{Goal, Target};
use crate::character::{CharacterError, Pose, Skeleton};

/// Frames and turns of all joints in the world.
#[derive(Clone)]
pub(super) struct Frames {
    pub(super) world: Vec<Matrix4<f64>>,
    /// The turn alone: of all joints above and the joint itself.
    pub(super) turn: Vec<UnitQuaternion<f64>>,
    /// Length of the chain from each joint up to its root.
    reach: Vec<f64>,
}

impl Frames {
    pub(super) fn of(skeleton: &Skeleton, pose: &Pose) -> Result<Self, CharacterError> {
        skeleton.globals(pose)?;
        Ok(Self::chained(skeleton, pose))
    }

    /// Of a pose that is known to be one of the skeleton.
    pub(super) fn chained(skeleton: &Skeleton, pose: &Pose) -> Self {
        let joints = skeleton.joint_count();
        let (mut world, mut turn) = (vec![Matrix4::identity(); joints], vec![UnitQuaternion::identity(); joints]);
        let mut reach = vec![0.0; joints];
        for &j in skeleton.parents_first() {
            let (k, local) = (j as usize, &pose.locals[j as usize]);
            (world[k], turn[k]) = (local.matrix(), local.rotation);
            if let Some(parent) = skeleton.joints()[k].parent.map(|p| p as usize) {
                world[k] = world[parent] * world[k];
                turn[k] = turn[parent] * turn[k];
                reach[k] = reach[parent] + (origin(&world[k]) - origin(&world[parent])).norm();
            }
        }
        Self { world, turn, reach }
    }

    /// Origin of a joint.
    pub(super) fn at(&self, joint: u32) -> Point3<f64> {
        origin(&self.world[joint as usize])
    }

    /// A point of a joint's frame.
    pub(super) fn point(&self, joint: u32, point: &Point3<f64>) -> Point3<f64> {
        self.world[joint as usize].transform_point(point)
    }

    /// What a unit of a target's residual means: a length for positions, a radian otherwise.
    pub(super) fn scale(&self, target: &Target) -> f64 {
        match target.goal {
            Goal::Position { .. } => self.length(target),
            _ => 1.0,
        }
    }

    /// Length of the chain above a target; 1 where it has none.
    fn length(&self, target: &Target) -> f64 {
        let Goal::Position { point, .. } = &target.goal else { return 1.0 };
        let tip = (self.point(target.joint, point) - self.at(target.joint)).norm();
        let length = self.reach[target.joint as usize] + tip;
        if length > 0.0 { length } else { 1.0 }
    }
}

/// Turn and stretch of the frame that a joint hangs in.
pub(super) fn linear_above(skeleton: &Skeleton, frames: &Frames, joint: u32) -> Matrix3<f64> {
    let parent = skeleton.joints()[joint as usize].parent;
    parent.map_or_else(Matrix3::identity, |p| frames.world[p as usize].fixed_view::<3, 3>(0, 0).into_owned())
}

fn origin(frame: &Matrix4<f64>) -> Point3<f64> {
    Point3::from(Vector3::new(frame[(0, 3)], frame[(1, 3)], frame[(2, 3)]))
}
