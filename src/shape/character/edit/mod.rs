//! Rig editing: changes of the joints of a skeleton, with undo and redo.
//!
//! A rejected edit changes nothing. Positions are world positions at rest. [`Edited::joint_of`] maps old to new joint indices, so that
//! weights and clips can follow.
//!
//! ```text
//! add         a joint with axis-aligned frame                  extrude     a child with the frame of its parent
//! split       a joint at a fraction of a bone                  dissolve    remove a joint, its children go to its parent
//! remove      a joint and its descendants                      re-parent   change the parent, keep the world frame
//! mirror      copy a joint and its descendants                 move        to a position, with or without descendants
//! roll        rotate the frame about the bone                  rename, limits
//! ```

mod mirror;
mod operations;
mod pick;
#[cfg(test)]
mod tests;

use nalgebra::Point3;

use super::{CharacterError, Influence, Joint, Limits, Skeleton, SkinWeights};

pub use mirror::{Plane, other_side};
pub use pick::volume_center;

/// An edit of a rig.
#[derive(Clone, Debug, PartialEq)]
pub enum Edit {
    /// Adds a joint with an axis-aligned frame.
    Add {
        /// Name of the joint.
        name: String,
        /// Its parent; `None` for a root.
        parent: Option<u32>,
        /// Its position.
        at: Point3<f64>,
    },
    /// Adds a child with the frame of its parent.
    Extrude {
        /// The parent.
        joint: u32,
        /// Name of the child.
        name: String,
        /// Position of the child.
        at: Point3<f64>,
    },
    /// Inserts a joint between a joint and its parent.
    Split {
        /// The joint at the end of the bone.
        joint: u32,
        /// Position of the new joint as a fraction of the bone from the parent, above 0 and below 1.
        fraction: f64,
        /// Name of the new joint.
        name: String,
    },
    /// Removes a joint; its children become children of its parent and keep their world frames.
    Dissolve {
        /// The joint.
        joint: u32,
    },
    /// Removes a joint and its descendants.
    Remove {
        /// The joint.
        joint: u32,
    },
    /// Changes the parent of a joint (`None`: makes it a root); its world frame is kept.
    Reparent {
        /// The joint.
        joint: u32,
        /// The new parent.
        parent: Option<u32>,
    },
    /// Mirrors a joint and its descendants; existing joints with the mirrored names are moved instead of added.
    Mirror {
        /// The joint.
        joint: u32,
        /// The mirror plane.
        plane: Plane,
    },
    /// Moves a joint.
    Move {
        /// The joint.
        joint: u32,
        /// Its new position.
        to: Point3<f64>,
        /// Whether its descendants move along.
        with_children: bool,
    },
    /// Rotates a joint's frame about the bone to its only child, or else the bone from its parent; its descendants keep their world
    /// frames.
    Roll {
        /// The joint.
        joint: u32,
        /// Rotation angle, rad.
        angle: f64,
    },
    /// Renames a joint.
    Rename {
        /// The joint.
        joint: u32,
        /// The new name.
        name: String,
    },
    /// Sets the limits of a joint.
    Limit {
        /// The joint.
        joint: u32,
        /// The limits; `None`: unlimited.
        limits: Option<Limits>,
    },
}

/// Effect of an edit on joint indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Edited {
    /// New index of each old joint; for a removed joint the index of the joint that replaces it, if any.
    pub joint_of: Vec<Option<u32>>,
    /// Indices of added joints.
    pub added: Vec<u32>,
}

impl Edited {
    /// Number of joints after the edit.
    pub fn joint_count(&self) -> usize {
        self.joint_of.iter().flatten().chain(&self.added).max().map_or(0, |last| *last as usize + 1)
    }

    /// Whether every joint has the index that it had, and none was added.
    pub fn keeps_indices(&self) -> bool {
        self.added.is_empty() && (0..).zip(&self.joint_of).all(|(j, of)| *of == Some(j))
    }

    /// Weights of the joints after the edit: those of a removed joint go to the joint that replaces it, added joints have none. Vertices
    /// that followed joints without a replacement alone follow the first joint.
    ///
    /// # Errors
    /// [`CharacterError::Input`] for weights of another number of joints, or without joints after the edit.
    ///
    /// ```
    /// use plumbline_shape::character::edit::{Edit, RigEditor};
    /// use plumbline_shape::character::humanoid::humanoid;
    ///
    /// let person = humanoid(0.1)?;
    /// let mut rig = RigEditor::new(Some(&person.skeleton));
    /// let (arm, chest) = (person.skeleton.named("arm.L")?, person.skeleton.named("chest")?);
    /// let before = person.skin.weights();
    /// let edited = rig.apply(Edit::Remove { joint: arm })?;
    /// let after = edited.carried(before)?;
    /// let chest_now = edited.joint_of[chest as usize].expect("it stays");
    /// assert_eq!(after.joint_count(), rig.joints().len());
    /// assert!((0..after.vertex_count()).all(|v| after.weight(v, chest_now) >= before.weight(v, arm) - 1e-12));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn carried(&self, weights: &SkinWeights) -> Result<SkinWeights, CharacterError> {
        CharacterError::check_matrices(self.joint_of.len(), weights.joint_count())?;
        let row = |row: &[Influence]| -> Vec<(u32, f64)> {
            row.iter().filter_map(|i| Some((self.joint_of[i.joint as usize]?, i.weight))).collect()
        };
        let rows: Vec<_> = weights.rows().map(row).collect();
        Ok(SkinWeights::normalized(self.joint_count(), rows, Some(0))?.0)
    }
}

/// A rig with its edit history.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigEditor {
    joints: Vec<Joint>,
    /// Applied edits, each with the joints before it.
    done: Vec<(Edit, Vec<Joint>)>,
    /// Undone edits, each with the joints after it; the last is redone first.
    undone: Vec<(Edit, Vec<Joint>)>,
}

impl RigEditor {
    /// Starts from a skeleton, or without joints.
    pub fn new(skeleton: Option<&Skeleton>) -> Self {
        let joints = skeleton.map_or_else(Vec::new, |s| s.joints().to_vec());
        Self { joints, ..Self::default() }
    }

    /// The current joints.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The skeleton; `None` without joints.
    pub fn skeleton(&self) -> Option<Skeleton> {
        Skeleton::new(self.joints.clone()).ok()
    }

    /// Applies an edit and clears the redo history.
    ///
    /// # Errors
    /// [`CharacterError::Input`]; the rig is unchanged then.
    pub fn apply(&mut self, edit: Edit) -> Result<Edited, CharacterError> {
        let (joints, edited) = operations::apply(&self.joints, &edit)?;
        let before = std::mem::replace(&mut self.joints, joints);
        self.done.push((edit, before));
        self.undone.clear();
        Ok(edited)
    }

    /// Undoes the last edit and returns it.
    pub fn undo(&mut self) -> Option<&Edit> {
        let (edit, before) = self.done.pop()?;
        let after = std::mem::replace(&mut self.joints, before);
        self.undone.push((edit, after));
        self.undone.last().map(|(edit, _)| edit)
    }

    /// Redoes the edit that was undone last and returns it.
    pub fn redo(&mut self) -> Option<&Edit> {
        let (edit, after) = self.undone.pop()?;
        let before = std::mem::replace(&mut self.joints, after);
        self.done.push((edit, before));
        self.done.last().map(|(edit, _)| edit)
    }

    /// Applied edits, the oldest first.
    pub fn history(&self) -> impl ExactSizeIterator<Item = &Edit> {
        self.done.iter().map(|(edit, _)| edit)
    }
}
