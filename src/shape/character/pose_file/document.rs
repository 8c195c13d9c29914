//! Schema of the file.

use std::collections::BTreeMap;

use nalgebra::{Point3, Quaternion, Unit, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::{TargetPose, pose_of};
use crate::character::ik::{Goal, RootMotion, Target};
use crate::character::{Character, RigFileError};

/// A pose, as joint rotations and inverse kinematics targets.
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
    /// The initial pose; default: rest.
    #[serde(default)]
    from: Option<FromClip>,
    /// Joint transforms, by joint name.
    #[serde(default)]
    joints: BTreeMap<String, JointEntry>,
    /// Inverse kinematics targets, solved together.
    #[serde(default)]
    targets: Vec<TargetEntry>,
    /// Names of joints that do not rotate for targets.
    #[serde(default)]
    locked: Vec<String>,
    /// Names of joints that keep the world position and orientation that they have in the initial pose, such as feet.
    #[serde(default)]
    pinned: Vec<String>,
    /// Motion of the root for targets; default: pinned.
    #[serde(default)]
    root: RootMotion,
    /// Morph weights, by target name.
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
    /// Time, s; the clip repeats.
    #[serde(default)]
    time: f64,
}

/// Transform of a joint. At most one of `rotation` and `turn_deg`.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct JointEntry {
    /// Rotation in the parent frame: quaternion `[w, x, y, z]` of any length.
    #[serde(default)]
    rotation: Option<[f64; 4]>,
    /// Additional rotation in the joint frame: a rotation vector, degrees.
    #[serde(default)]
    turn_deg: Option<[f64; 3]>,
    /// Additional translation in the parent frame, units of the model.
    #[serde(default, rename = "move")]
    by: Option<[f64; 3]>,
    /// Scale factors along the joint axes.
    #[serde(default)]
    scale: Option<[f64; 3]>,
}

/// A target: exactly one of `position`, `orientation`, `look_at` and `pole`.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct TargetEntry {
    /// Name of the joint.
    joint: String,
    /// World position to reach.
    #[serde(default)]
    position: Option<[f64; 3]>,
    /// The point of the joint frame that reaches `position`; default: the origin.
    #[serde(default)]
    point: Option<[f64; 3]>,
    /// World rotation to reach: quaternion `[w, x, y, z]` of any length.
    #[serde(default)]
    orientation: Option<[f64; 4]>,
    /// World position at which `axis` points.
    #[serde(default)]
    look_at: Option<[f64; 3]>,
    /// Axis of the joint frame; default: z.
    #[serde(default)]
    axis: Option<[f64; 3]>,
    /// World position toward which the chain from `root` over `middle` to the joint bends.
    #[serde(default)]
    pole: Option<[f64; 3]>,
    /// Name of the first joint of the chain.
    #[serde(default)]
    root: Option<String>,
    /// Name of the joint that bends.
    #[serde(default)]
    middle: Option<String>,
    /// Weight relative to other targets, above 0; default: 1.
    #[serde(default = "one")]
    weight: f64,
    /// Number of ancestors that may rotate; default: all.
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
    pub(super) fn of(self, character: &Character) -> Result<TargetPose, RigFileError> {
        let skeleton = &character.skeleton;
        let (mut start, mut weights) = match &self.from {
            Some(from) => pose_of(character, &from.clip, from.time)?,
            None => (skeleton.rest_pose(), character.rest_weights()),
        };
        let from = start.clone();
        for (name, entry) in &self.joints {
            entry.apply(&format!("joint {name:?}"), &mut start.locals[skeleton.named(name)? as usize])?;
        }
        for (name, &weight) in &self.morphs {
            let what = format!("morph target {name:?}");
            let Some(target) = character.targets.iter().position(|t| t.name == *name) else {
                let known = character.targets.iter().map(|t| t.name.as_str()).collect::<Vec<_>>().join(", ");
                return Err(fault(&what, format!("the character has none of this name (known: {known})")));
            };
            if !weight.is_finite() {
                return Err(fault(&what, format!("weight {weight} is not finite")));
            }
            weights[target] = weight;
        }
        let target = |(k, entry): (usize, &TargetEntry)| entry.of(&format!("target {k}"), character);
        let targets = self.targets.iter().enumerate().map(target).collect::<Result<_, _>>()?;
        let locked = self.locked.iter().map(|name| skeleton.named(name)).collect::<Result<_, _>>()?;
        let mut pose = TargetPose { from, start, targets, locked, pins: Vec::new(), root: self.root, weights };
        for name in &self.pinned {
            pose.pin(skeleton, skeleton.named(name)?)?;
        }
        Ok(pose)
    }
}

fn fault(what: &str, fault: impl std::fmt::Display) -> RigFileError {
    RigFileError::Content(format!("{what}: {fault}"))
}

fn finite<const N: usize>(what: &str, key: &str, values: [f64; N]) -> Result<[f64; N], RigFileError> {
    let told = || fault(what, format!("{key} {values:?} is not finite"));
    values.iter().all(|x| x.is_finite()).then_some(values).ok_or_else(told)
}

fn rotation(what: &str, key: &str, values: [f64; 4]) -> Result<UnitQuaternion<f64>, RigFileError> {
    let [w, x, y, z] = finite(what, key, values)?;
    let unit = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0);
    unit.ok_or_else(|| fault(what, format!("{key} {values:?} has no length; no turn is [1, 0, 0, 0]")))
}

impl JointEntry {
    fn apply(&self, what: &str, local: &mut plumbline_num::math::Trs) -> Result<(), RigFileError> {
        match (self.rotation, self.turn_deg) {
            (Some(_), Some(_)) => return Err(fault(what, "has both `rotation` and `turn_deg`; give one of them")),
            (Some(given), None) => local.rotation = rotation(what, "rotation", given)?,
            (None, Some(vector)) => {
                let vector = Vector3::from(finite(what, "turn_deg", vector)?).map(f64::to_radians);
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
    fn of(&self, what: &str, character: &Character) -> Result<Target, RigFileError> {
        let goal = match (self.position, self.orientation, self.look_at, self.pole) {
            (Some(at), None, None, None) => Goal::Position {
                point: finite(what, "point", self.point.unwrap_or([0.0; 3]))?.into(),
                at: finite(what, "position", at)?.into(),
            },
            (None, Some(given), None, None) => Goal::Orientation(rotation(what, "orientation", given)?),
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
