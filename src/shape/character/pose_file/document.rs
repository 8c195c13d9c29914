//! The shape of the file.

use std::collections::BTreeMap;

use nalgebra::{Point3, Quaternion, Unit, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::{PoseFileError, TargetPose, pose_of};
use crate::character::Character;
use crate::character::ik::{Goal, Target};

/// A pose, as turns of joints and places that joints seek.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Always `plumbline.pose`.
    #[expect(dead_code, reason = "checked before the rest is read")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "checked before the rest is read")]
    version: u32,
    /// The pose that it begins with; left out: rest.
    #[serde(default)]
    from: Option<FromClip>,
    /// Turns of joints, by their names.
    #[serde(default)]
    joints: BTreeMap<String, JointEntry>,
    /// What joints seek, together.
    #[serde(default)]
    targets: Vec<TargetEntry>,
    /// Joints that do not turn for targets, by their names.
    #[serde(default)]
    locked: Vec<String>,
    /// Weights of morph targets, by their names.
    #[serde(default)]
    morphs: BTreeMap<String, f64>,
}

/// A pose of a clip.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct FromClip {
    /// Name of the clip.
    clip: String,
    /// When, s; the clip repeats.
    #[serde(default)]
    time: f64,
}

/// How a joint stands. One of `rotation` and `turn_deg` at most.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct JointEntry {
    /// How it is turned in its parent: `[w, x, y, z]`, whose length does not count.
    #[serde(default)]
    rotation: Option<[f64; 4]>,
    /// How it turns in its own frame: a rotation vector, degrees.
    #[serde(default)]
    turn_deg: Option<[f64; 3]>,
    /// How far it moves in its parent's frame, units of the model.
    #[serde(default, rename = "move")]
    by: Option<[f64; 3]>,
    /// Factors along its axes.
    #[serde(default)]
    scale: Option<[f64; 3]>,
}

/// What a joint seeks: one of `position`, `orientation`, `look_at` and `pole`.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct TargetEntry {
    /// Name of the joint.
    joint: String,
    /// A place in the world where it shall be.
    #[serde(default)]
    position: Option<[f64; 3]>,
    /// The point of its own frame that shall be there; left out: its origin.
    #[serde(default)]
    point: Option<[f64; 3]>,
    /// How it shall be turned in the world: `[w, x, y, z]`, whose length does not count.
    #[serde(default)]
    orientation: Option<[f64; 4]>,
    /// A place in the world at which its `axis` shall point.
    #[serde(default)]
    look_at: Option<[f64; 3]>,
    /// An axis of its own frame; left out: z.
    #[serde(default)]
    axis: Option<[f64; 3]>,
    /// A place in the world toward which the chain from `root` over `middle` to the joint shall bend.
    #[serde(default)]
    pole: Option<[f64; 3]>,
    /// Name of the joint where the chain begins.
    #[serde(default)]
    root: Option<String>,
    /// Name of the joint where it bends.
    #[serde(default)]
    middle: Option<String>,
    /// How much it counts beside others, above 0; left out: 1.
    #[serde(default = "one")]
    weight: f64,
    /// How many joints above it turn for it; left out: all.
    #[serde(default)]
    chain: Option<usize>,
}

/// The JSON schema of pose files.
#[cfg(feature = "schema")]
pub fn pose_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

fn one() -> f64 {
    1.0
}

impl Document {
    pub(super) fn of(self, character: &Character) -> Result<TargetPose, PoseFileError> {
        let skeleton = &character.skeleton;
        let (mut start, mut weights) = match &self.from {
            Some(from) => pose_of(character, &from.clip, from.time)?,
            None => (skeleton.rest_pose(), character.rest_weights()),
        };
        for (name, entry) in &self.joints {
            entry.apply(&format!("joint {name:?}"), &mut start.locals[skeleton.named(name)? as usize])?;
        }
        for (name, &weight) in &self.morphs {
            let what = || format!("morph target {name:?}");
            let target = character.targets.iter().position(|t| t.name == *name);
            let known = || character.targets.iter().map(|t| t.name.as_str()).collect::<Vec<_>>().join(", ");
            let target = target
                .ok_or_else(|| fault(what(), format!("the character has none of this name (known: {})", known())))?;
            if !weight.is_finite() {
                return Err(fault(what(), format!("weight {weight} is not finite")));
            }
            weights[target] = weight;
        }
        let target = |(k, entry): (usize, &TargetEntry)| entry.of(&format!("target {k}"), character);
        let targets = self.targets.iter().enumerate().map(target).collect::<Result<_, _>>()?;
        let locked = self.locked.iter().map(|name| skeleton.named(name)).collect::<Result<_, _>>()?;
        Ok(TargetPose { start, targets, locked, weights })
    }
}

fn fault(what: impl Into<String>, fault: impl Into<String>) -> PoseFileError {
    PoseFileError::Entry { what: what.into(), fault: fault.into() }
}

fn finite<const N: usize>(what: &str, key: &str, values: [f64; N]) -> Result<[f64; N], PoseFileError> {
    let told = || fault(what, format!("{key} {values:?} is not finite"));
    values.iter().all(|x| x.is_finite()).then_some(values).ok_or_else(told)
}

fn rotation(what: &str, key: &str, values: [f64; 4]) -> Result<UnitQuaternion<f64>, PoseFileError> {
    let [w, x, y, z] = finite(what, key, values)?;
    let turn = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0);
    turn.ok_or_else(|| fault(what, format!("{key} {values:?} has no length; no turn is [1, 0, 0, 0]")))
}

impl JointEntry {
    fn apply(&self, what: &str, local: &mut plumbline_num::math::Trs) -> Result<(), PoseFileError> {
        match (self.rotation, self.turn_deg) {
            (Some(_), Some(_)) => return Err(fault(what, "has both `rotation` and `turn_deg`; give one of them")),
            (Some(turn), None) => local.rotation = rotation(what, "rotation", turn)?,
            (None, Some(turn)) => {
                let vector = Vector3::from(finite(what, "turn_deg", turn)?).map(f64::to_radians);
                local.rotation *= UnitQuaternion::from_scaled_axis(vector);
            }
            (None, None) => {}
        }
        if let Some(by) = self.by {
            local.translation += Vector3::from(finite(what, "move", by)?);
        }
        if let Some(scale) = self.scale {
            local.scale = Vector3::from(finite(what, "scale", scale)?);
        }
        Ok(())
    }
}

impl TargetEntry {
    fn of(&self, what: &str, character: &Character) -> Result<Target, PoseFileError> {
        let goal = match (self.position, self.orientation, self.look_at, self.pole) {
            (Some(at), None, None, None) => Goal::Position {
                point: finite(what, "point", self.point.unwrap_or([0.0; 3]))?.into(),
                at: finite(what, "position", at)?.into(),
            },
            (None, Some(turn), None, None) => Goal::Orientation(rotation(what, "orientation", turn)?),
            (None, None, Some(at), None) => {
                let axis = Vector3::from(finite(what, "axis", self.axis.unwrap_or([0.0, 0.0, 1.0]))?);
                let axis = Unit::try_new(axis, 0.0).ok_or_else(|| fault(what, "`axis` has no length"))?;
                Goal::LookAt { axis, at: Point3::from(finite(what, "look_at", at)?) }
            }
            (None, None, None, Some(at)) => {
                let named = |name: &Option<String>, key: &str| match name {
                    Some(name) => Ok(character.skeleton.named(name)?),
                    None => Err(fault(what, format!("a pole needs `{key}`, a joint of its chain"))),
                };
                let (root, middle) = (named(&self.root, "root")?, named(&self.middle, "middle")?);
                Goal::Pole { root, middle, at: finite(what, "pole", at)?.into() }
            }
            _ => return Err(fault(what, "needs exactly one of `position`, `orientation`, `look_at` and `pole`")),
        };
        let joint = character.skeleton.named(&self.joint)?;
        Ok(Target { joint, goal, weight: self.weight, chain: self.chain })
    }
}
