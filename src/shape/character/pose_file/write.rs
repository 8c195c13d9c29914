//! Poses as the text of a file.

use serde_json::{Map, Value, json};

use super::{KIND, TargetPose};
use crate::character::ik::{Goal, Target};
use crate::character::{CharacterError, Skeleton};
use nalgebra::UnitQuaternion;
use plumbline_num::math::Trs;

impl TargetPose {
    /// The text of a file that gives this pose for a character with the same skeleton: joints that differ from rest, the targets,
    /// locked joints. Pins are written as targets, since the file pins joints at the frames of its initial pose. Morph weights are not written. Numbers are exact but for the rounding of a sum and of a unit length.
    ///
    /// ```
    /// use plumbline_shape::character::humanoid::humanoid;
    /// use plumbline_shape::character::ik::Target;
    /// use plumbline_shape::character::pose_file::TargetPose;
    ///
    /// let person = humanoid(0.1)?;
    /// let start = person.skeleton.rest_pose();
    /// let targets = vec![Target::position(3, [0.1, 1.0, 0.2].into())];
    /// let (from, weights) = (start.clone(), person.rest_weights());
    /// let pose = TargetPose { from, start, targets, locked: vec![0], weights, ..TargetPose::default() };
    /// assert_eq!(TargetPose::parse(&pose.to_json(&person.skeleton)?, &person)?, pose);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`CharacterError::Input`] for a pose or targets of another skeleton.
    pub fn to_json(&self, skeleton: &Skeleton) -> Result<String, CharacterError> {
        CharacterError::check_pose(self.start.locals.len(), skeleton.joint_count())?;
        let name = |joint: u32| -> Result<&str, CharacterError> {
            let found = skeleton.joints().get(joint as usize).map(|j| j.name.as_str());
            found.ok_or_else(|| CharacterError::Input(format!("there is no joint {joint}")))
        };
        let mut joints = Map::new();
        for (joint, local) in skeleton.joints().iter().zip(&self.start.locals) {
            let entry = entry(&joint.rest, local);
            if !entry.is_empty() {
                joints.insert(joint.name.clone(), entry.into());
            }
        }
        let targets = self.all_targets().iter().map(|t| target(t, name)).collect::<Result<Vec<_>, _>>()?;
        let locked = self.locked.iter().map(|j| name(*j)).collect::<Result<Vec<_>, _>>()?;
        let document = json!({
            "format": KIND.format, "version": 1, "joints": joints, "targets": targets, "locked": locked,
            "root": self.root,
        });
        Ok(format!("{document:#}\n"))
    }
}

/// What differs from rest.
fn entry(rest: &Trs, local: &Trs) -> Map<String, Value> {
    let mut entry = Map::new();
    if local.rotation != rest.rotation {
        entry.insert("rotation".into(), quaternion(&local.rotation));
    }
    if local.translation != rest.translation {
        entry.insert("move".into(), (local.translation - rest.translation).as_slice().into());
    }
    if local.scale != rest.scale {
        entry.insert("scale".into(), local.scale.as_slice().into());
    }
    entry
}

fn target<'a>(target: &Target, name: impl Fn(u32) -> Result<&'a str, CharacterError>) -> Result<Value, CharacterError> {
    let mut entry = match &target.goal {
        Goal::Position { point, at } => json!({ "position": at.coords.as_slice(), "point": point.coords.as_slice() }),
        Goal::Orientation(rotation) => json!({ "orientation": quaternion(rotation) }),
        Goal::LookAt { axis, at } => json!({ "look_at": at.coords.as_slice(), "axis": axis.as_slice() }),
        Goal::Pole { root, middle, at } => {
            json!({ "pole": at.coords.as_slice(), "root": name(*root)?, "middle": name(*middle)? })
        }
    };
    entry["joint"] = name(target.joint)?.into();
    entry["weight"] = target.weight.into();
    if let Some(chain) = target.chain {
        entry["chain"] = chain.into();
    }
    Ok(entry)
}

fn quaternion(q: &UnitQuaternion<f64>) -> Value {
    json!([q.w, q.i, q.j, q.k])
}
