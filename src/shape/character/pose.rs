//! Poses of a skeleton.

use plumbline_num::math::Trs;

/// `parent_from_joint` of every joint, in the order of the skeleton's joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// One per joint.
    pub locals: Vec<Trs>,
}
