//! Forward kinematics.

use nalgebra::{Matrix4, Point3, UnitQuaternion, Vector3};

use super::{Goal, Target};
use crate::character::{CharacterError, Pose, Skeleton};

/// World frames and rotations of all joints.
#[derive(Clone)]
pub(in crate::character) struct Frames {
    pub(super) world: Vec<Matrix4<f64>>,
    /// Accumulated rotation of each joint, without scale.
    pub(in crate::character) rotation: Vec<UnitQuaternion<f64>>,
    /// Length of the chain from the root to each joint.
    reach: Vec<f64>,
}

/// Unit of the residual of a position where no chain has a length.
const NO_LENGTH: f64 = 1.0;

impl Frames {
    pub(in crate::character) fn of(skeleton: &Skeleton, pose: &Pose) -> Result<Self, CharacterError> {
        skeleton.globals(pose)?;
        Ok(Self::chained(skeleton, pose))
    }

    /// Without checks, for a pose known to belong to the skeleton.
    pub(in crate::character) fn chained(skeleton: &Skeleton, pose: &Pose) -> Self {
        let joints = skeleton.joint_count();
        let (world, rotation) = (vec![Matrix4::identity(); joints], vec![UnitQuaternion::identity(); joints]);
        let mut frames = Self { world, rotation, reach: vec![0.0; joints] };
        frames.chain(skeleton, pose);
        frames
    }

    /// The frames of another pose of the same skeleton.
    pub(super) fn chain(&mut self, skeleton: &Skeleton, pose: &Pose) {
        let Self { world, rotation, reach } = self;
        for &j in skeleton.parents_first() {
            let (k, local) = (j as usize, &pose.locals[j as usize]);
            (world[k], rotation[k]) = (local.matrix(), local.rotation);
            if let Some(parent) = skeleton.joints()[k].parent.map(|p| p as usize) {
                world[k] = world[parent] * world[k];
                rotation[k] = rotation[parent] * rotation[k];
                reach[k] = reach[parent] + (origin(&world[k]) - origin(&world[parent])).norm();
            }
        }
    }

    /// Position of a joint.
    pub(super) fn at(&self, joint: u32) -> Point3<f64> {
        origin(&self.world[joint as usize])
    }

    /// Positions of all joints.
    pub(in crate::character) fn positions(&self) -> Vec<Point3<f64>> {
        self.world.iter().map(origin).collect()
    }

    /// World position of a point in a joint's frame.
    pub(super) fn point(&self, joint: u32, point: &Point3<f64>) -> Point3<f64> {
        self.world[joint as usize].transform_point(point)
    }

    /// Length of the longest chain; 1 if all are of length zero.
    pub(super) fn size(&self) -> f64 {
        let longest = self.reach.iter().copied().fold(0.0, f64::max);
        if longest > 0.0 { longest } else { NO_LENGTH }
    }

    /// Unit of a target's residual: for positions the length of the chain above it, that of the longest chain for a root; 1 rad otherwise.
    pub(super) fn scale(&self, target: &Target) -> f64 {
        let Goal::Position { point, .. } = &target.goal else { return 1.0 };
        let tip = (self.point(target.joint, point) - self.at(target.joint)).norm();
        let length = self.reach[target.joint as usize] + tip;
        if length > 0.0 { length } else { self.size() }
    }
}

fn origin(frame: &Matrix4<f64>) -> Point3<f64> {
    Point3::from(Vector3::new(frame[(0, 3)], frame[(1, 3)], frame[(2, 3)]))
}
