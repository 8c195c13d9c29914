//! Rigs by hand: each edit changes the joints of a skeleton, and can be undone.
//!
//! Edits that are refused change nothing. Places are in the world at rest. What an edit takes away or adds is told by
//! [`Edited::joint_of`], so that weights and clips can follow.
//!
//! ```text
//! add         a joint at a place, turned as the world          extrude     the same, with the frame of its parent
//! split       a joint at a share of the way to a child         dissolve    a joint goes, its children hang on its parent
//! remove      a joint goes with all below it                   re-parent   a joint hangs on another, and stays where it is
//! mirror      all below a joint again on the other side        move        to a place, with or without its children
//! roll        the frame turns about the bone                   rename, limits
//! ```

mod error;
mod mirror;
mod operations;
mod pick;
#[cfg(test)]
mod tests;

use nalgebra::Point3;

use super::{Joint, Limits, Skeleton};

pub use error::EditError;
pub use mirror::{Plane, other_side};
pub use pick::volume_center;

/// One change of a rig.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// A joint, turned as the world.
    Add {
        /// Its name.
        name: String,
        /// The joint it hangs on; none for a root.
        parent: Option<u32>,
        /// Where it is.
        at: Point3<f64>,
    },
    /// A child, turned as the joint.
    Extrude {
        /// The joint.
        joint: u32,
        /// Name of the child.
        name: String,
        /// Where the child is.
        at: Point3<f64>,
    },
    /// A joint between another and its parent.
    Split {
        /// The joint at the end of the bone.
        joint: u32,
        /// How far from the parent, as a share of the bone, above 0 and below 1.
        share: f64,
        /// Name of the new joint.
        name: String,
    },
    /// Takes a joint away; its children hang on its parent and stay where they are.
    Dissolve {
        /// The joint.
        joint: u32,
    },
    /// Takes a joint away with all below it.
    Remove {
        /// The joint.
        joint: u32,
    },
    /// Hangs a joint on another (none: it becomes a root); it stays where it is.
    Reparent {
        /// The joint.
        joint: u32,
        /// The new parent.
        parent: Option<u32>,
    },
    /// Repeats a joint and all below it on the other side; joints there that have the mirrored names already are moved instead.
    Mirror {
        /// The joint.
        joint: u32,
        /// Between the sides.
        plane: Plane,
    },
    /// Moves a joint.
    Move {
        /// The joint.
        joint: u32,
        /// Where to.
        to: Point3<f64>,
        /// All below it moves along; stays where it is otherwise.
        with_children: bool,
    },
    /// Turns a joint's frame about the bone to its only child (about the bone from its parent without one); all below stays where
    /// it is.
    Roll {
        /// The joint.
        joint: u32,
        /// By how much, rad.
        angle: f64,
    },
    /// Gives a joint another name.
    Rename {
        /// The joint.
        joint: u32,
        /// The name.
        name: String,
    },
    /// Says how far a joint may turn.
    Limit {
        /// The joint.
        joint: u32,
        /// Its limits; none: as far as it likes.
        limits: Option<Limits>,
    },
}

/// What an edit did to the numbers of joints.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edited {
    /// For each joint before the edit its number now; for those that went the joint that takes their part, if any.
    pub joint_of: Vec<Option<u32>>,
    /// Joints that were added.
    pub added: Vec<u32>,
}

/// A rig with the edits that led to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigEditor {
    joints: Vec<Joint>,
    /// What was done, with the joints before it.
    done: Vec<(Edit, Vec<Joint>)>,
    /// What was undone, with the joints after it; the last is redone first.
    undone: Vec<(Edit, Vec<Joint>)>,
}

impl RigEditor {
    /// Begins with a skeleton; without any joint for none.
    pub fn new(skeleton: Option<&Skeleton>) -> Self {
        let joints = skeleton.map_or_else(Vec::new, |s| s.joints().to_vec());
        Self { joints, ..Self::default() }
    }

    /// The joints as they are.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The skeleton; none without any joint.
    pub fn skeleton(&self) -> Option<Skeleton> {
        Skeleton::new(self.joints.clone()).ok()
    }

    /// Does an edit. What was undone before can no longer be redone.
    ///
    /// # Errors
    /// [`EditError`]; nothing is changed then.
    pub fn apply(&mut self, edit: Edit) -> Result<Edited, EditError> {
        let (joints, edited) = operations::apply(&self.joints, &edit)?;
        let before = std::mem::replace(&mut self.joints, joints);
        self.done.push((edit, before));
        self.undone.clear();
        Ok(edited)
    }

    /// Takes the last edit back; which it was.
    pub fn undo(&mut self) -> Option<&Edit> {
        let (edit, before) = self.done.pop()?;
        let after = std::mem::replace(&mut self.joints, before);
        self.undone.push((edit, after));
        self.undone.last().map(|(edit, _)| edit)
    }

    /// Does the edit again that was taken back last; which it was.
    pub fn redo(&mut self) -> Option<&Edit> {
        let (edit, after) = self.undone.pop()?;
        let before = std::mem::replace(&mut self.joints, after);
        self.done.push((edit, before));
        self.done.last().map(|(edit, _)| edit)
    }

    /// Edits that can be taken back, the first first.
    pub fn history(&self) -> impl ExactSizeIterator<Item = &Edit> {
        self.done.iter().map(|(edit, _)| edit)
    }
}
