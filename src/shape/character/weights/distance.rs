//! Weights by Euclidean distance:
//!
//! ```text
//! wⱼ ∝ dⱼ⁻⁴       dⱼ the distance to the nearest bone of joint j, for the four nearest joints
//! ```
//!
//! With the fourth power half the distance means sixteen times the weight.

use nalgebra::Point3;

use super::super::Bone;
use super::Row;
use super::bone_distance::nearest;
use plumbline_num::run::{Run, Stopped};

/// Influences per row: as many as most engines read.
const MAX_JOINTS: usize = 4;

/// One row per vertex.
pub(super) fn rows(positions: &[Point3<f64>], bones: &[Bone], run: &Run) -> Result<Vec<Row>, Stopped> {
    positions.iter().map(|p| run.check().map(|()| row(p, bones))).collect()
}

fn row(p: &Point3<f64>, bones: &[Bone]) -> Row {
    // Squared distance to each joint; bones of one joint are adjacent in the list.
    let mut joints: Vec<(u32, f64)> = Vec::with_capacity(bones.len());
    for bone in bones {
        let (_, d2, _) = nearest(bone, p);
        match joints.last_mut() {
            Some((joint, least)) if *joint == bone.joint => *least = least.min(d2),
            _ => joints.push((bone.joint, d2)),
        }
    }
    joints.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    joints.truncate(MAX_JOINTS);
    let least = joints[0].1;
    if !(least > 0.0) {
        return vec![(joints[0].0, 1.0)];
    }
    joints.iter().map(|&(j, d2)| (j, (least / d2).powi(2))).collect()
}
