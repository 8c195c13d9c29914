//! What a skeleton is doing.

use plumbline_num::math::Trs;

/// The frame of every joint in its parent's (`parent_from_joint`), in the order of the skeleton's joints.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// One per joint.
    pub locals: Vec<Trs>,
}
