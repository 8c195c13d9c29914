//! Schema of the file.

use std::collections::HashMap;

use nalgebra::{Point3, Quaternion, Unit, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::super::skeleton::unknown_name;
use super::super::{CurveSkeleton, Joint, Limits, RigFileError, Skeleton};
use super::clips::ClipEntry;
use super::{KIND, SkeletonFile};
use plumbline_num::math::Trs;

/// A skeleton at rest.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Always `plumbline.skeleton`.
    format: String,
    /// Always 1.
    version: u32,
    /// The joints; a parent may come after its children.
    #[cfg_attr(feature = "schema", schemars(length(min = 1)))]
    joints: Vec<JointEntry>,
    /// How the names of joints were proposed, in words; omitted for names that someone gave.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    proposed_names: Option<String>,
    /// The curve skeleton that the joints were derived from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    curve: Option<CurveEntry>,
    /// Animations of the joints.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    clips: Vec<ClipEntry>,
}

/// A joint.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct JointEntry {
    /// Unique name.
    name: String,
    /// Name of the parent joint; omitted for a root.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    parent: Option<String>,
    /// Position in the parent frame, units of the model.
    #[serde(default, skip_serializing_if = "is_zero")]
    translation: [f64; 3],
    /// Rotation in the parent frame: quaternion `[w, x, y, z]` of any length.
    #[serde(default = "no_turn", skip_serializing_if = "is_no_turn")]
    rotation: [f64; 4],
    /// Scale factors along the joint axes.
    #[serde(default = "ones", skip_serializing_if = "is_ones")]
    scale: [f64; 3],
    /// Limits of the rotation from rest; omitted: unlimited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    limits: Option<LimitsEntry>,
}

/// Limits of the rotation from rest, in the joint frame: a twist about an axis, then a swing of the axis.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(in crate::character) struct LimitsEntry {
    /// Twist axis, of any length.
    pub(in crate::character) axis: [f64; 3],
    /// First swing axis, perpendicular to `axis`, of any length.
    pub(in crate::character) across: [f64; 3],
    /// Largest swing about `across` and about `axis × across`, degrees, 0 to 180.
    pub(in crate::character) swing_deg: [f64; 2],
    /// Smallest and largest twist, degrees, −180 to 180.
    pub(in crate::character) twist_deg: [f64; 2],
}

/// A curve skeleton.
#[derive(Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct CurveEntry {
    /// Node positions, units of the model.
    nodes: Vec<[f64; 3]>,
    /// Pairs of adjacent nodes, numbered from 0.
    edges: Vec<[u32; 2]>,
    /// Radius of the surface about each node, units of the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    radius: Vec<f64>,
    /// Node of each vertex of the surface, in the order of the mesh file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    node_of_vertex: Vec<u32>,
}

/// The JSON schema of skeleton files.
#[cfg(feature = "schema")]
pub fn skeleton_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

fn is_zero(v: &[f64; 3]) -> bool {
    *v == [0.0; 3]
}

fn ones() -> [f64; 3] {
    [1.0; 3]
}

fn is_ones(v: &[f64; 3]) -> bool {
    *v == ones()
}

fn no_turn() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

fn is_no_turn(q: &[f64; 4]) -> bool {
    *q == no_turn()
}

impl Document {
    pub(super) fn into_skeleton(self) -> Result<SkeletonFile, RigFileError> {
        let names: Vec<&str> = self.joints.iter().map(|j| j.name.as_str()).collect();
        // Of duplicate names any index will do: `Skeleton::new` rejects them.
        let number: HashMap<&str, u32> = names.iter().copied().zip(0..).collect();
        let joint = |entry: &JointEntry| {
            let parent = match &entry.parent {
                None => None,
                Some(name) => Some(*number.get(name.as_str()).ok_or_else(|| unknown_name(name, &names))?),
            };
            Ok(Joint { name: entry.name.clone(), parent, rest: entry.rest()?, limits: entry.limits()? })
        };
        let joints: Result<Vec<_>, RigFileError> = self.joints.iter().map(joint).collect();
        let skeleton = Skeleton::new(joints?)?;
        let clip = |entry: ClipEntry| entry.into_clip(&skeleton, &number);
        let clips = self.clips.into_iter().map(clip).collect::<Result<Vec<_>, _>>()?;
        let curve = self.curve.map(CurveEntry::into_curve).transpose()?;
        Ok(SkeletonFile { curve, proposed_names: self.proposed_names, clips, skeleton })
    }

    pub(super) fn of(file: &SkeletonFile) -> Self {
        let joints = file.skeleton.joints();
        let entry = |joint: &Joint| JointEntry::of(joint, joint.parent.map(|p| joints[p as usize].name.clone()));
        Self {
            format: KIND.format.to_owned(),
            version: 1,
            joints: joints.iter().map(entry).collect(),
            proposed_names: file.proposed_names.clone(),
            curve: file.curve.as_ref().map(CurveEntry::of),
            clips: file.clips.iter().map(|clip| ClipEntry::of(clip, &file.skeleton)).collect(),
        }
    }

    /// One joint per line and one clip per line, for readable diffs.
    pub(super) fn to_json(&self) -> String {
        let line = |j: &JointEntry| format!("    {}", serde_json::to_string(j).expect("strings and numbers"));
        let joints: Vec<String> = self.joints.iter().map(line).collect();
        let proposed = match &self.proposed_names {
            None => String::new(),
            Some(how) => format!("  \"proposed_names\": {},\n", serde_json::to_string(how).expect("a string")),
        };
        let curve = match &self.curve {
            None => String::new(),
            Some(c) => format!(",\n  \"curve\": {}", serde_json::to_string(c).expect("numbers")),
        };
        let line = |c: &ClipEntry| format!("    {}", serde_json::to_string(c).expect("strings and numbers"));
        let clips: Vec<String> = self.clips.iter().map(line).collect();
        let clips =
            if clips.is_empty() { String::new() } else { format!(",\n  \"clips\": [\n{}\n  ]", clips.join(",\n")) };
        format!(
            "{{\n  \"format\": \"{}\",\n  \"version\": 1,\n{proposed}  \"joints\": [\n{}\n  ]{curve}{clips}\n}}\n",
            KIND.format,
            joints.join(",\n")
        )
    }
}

/// Reports an invalid value of a joint or of the curve.
fn refused(item: &str, field: &str, value: &str, expected: &str) -> RigFileError {
    RigFileError::Content(format!("{item}: {field} is {value} (expected {expected})"))
}

impl JointEntry {
    fn of(joint: &Joint, parent: Option<String>) -> Self {
        let q = joint.rest.rotation;
        Self {
            name: joint.name.clone(),
            parent,
            translation: joint.rest.translation.into(),
            rotation: [q.w, q.i, q.j, q.k],
            scale: joint.rest.scale.into(),
            limits: joint.limits.as_ref().map(LimitsEntry::of),
        }
    }

    fn item(&self) -> String {
        format!("joint {:?}", self.name)
    }

    fn rest(&self) -> Result<Trs, RigFileError> {
        let [w, x, y, z] = self.rotation;
        let q = Quaternion::new(w, x, y, z);
        // A unit quaternion keeps its bits, so that a round trip is exact.
        let unit = if (q.norm_squared() - 1.0).abs() < 1e-15 {
            Some(UnitQuaternion::new_unchecked(q))
        } else {
            UnitQuaternion::try_new(q, 0.0).filter(|q| q.coords.iter().all(|c| c.is_finite()))
        };
        let missing =
            || refused(&self.item(), "rotation", &format!("{:?}", self.rotation), "a quaternion, not all zeros");
        Ok(Trs { translation: self.translation.into(), rotation: unit.ok_or_else(missing)?, scale: self.scale.into() })
    }

    fn limits(&self) -> Result<Option<Limits>, RigFileError> {
        let Some(entry) = &self.limits else { return Ok(None) };
        let direction = |field, v: [f64; 3]| {
            let unit = Unit::try_new(Vector3::from(v), 0.0).filter(|d| d.iter().all(|c| c.is_finite()));
            unit.ok_or_else(|| refused(&self.item(), field, &format!("{v:?}"), "a direction, not all zeros"))
        };
        let (axis, across) = (direction("axis", entry.axis)?, direction("across", entry.across)?);
        let radians = |v: [f64; 2]| v.map(f64::to_radians);
        Ok(Some(Limits { axis, across, swing: radians(entry.swing_deg), twist: radians(entry.twist_deg) }))
    }
}

impl LimitsEntry {
    pub(in crate::character) fn of(limits: &Limits) -> Self {
        let degrees = |v: [f64; 2]| v.map(f64::to_degrees);
        Self {
            axis: limits.axis.into_inner().into(),
            across: limits.across.into_inner().into(),
            swing_deg: degrees(limits.swing),
            twist_deg: degrees(limits.twist),
        }
    }
}

impl CurveEntry {
    fn of(curve: &CurveSkeleton) -> Self {
        Self {
            nodes: curve.nodes.iter().map(|p| p.coords.into()).collect(),
            edges: curve.edges.clone(),
            radius: curve.radius.clone(),
            node_of_vertex: curve.node_of_vertex.clone(),
        }
    }

    fn into_curve(self) -> Result<CurveSkeleton, RigFileError> {
        let count = self.nodes.len();
        let beyond = |n: &&u32| **n as usize >= count;
        if let Some(n) = self.edges.iter().flatten().find(beyond) {
            return Err(refused("curve", "an end in edges", &n.to_string(), "a number of a node, from 0"));
        }
        if let Some(n) = self.node_of_vertex.iter().find(beyond) {
            return Err(refused("curve", "an entry of node_of_vertex", &n.to_string(), "a number of a node, from 0"));
        }
        if !self.radius.is_empty() && self.radius.len() != count {
            let value = format!("a list of {}", self.radius.len());
            return Err(refused("curve", "radius", &value, "one number per node"));
        }
        Ok(CurveSkeleton {
            nodes: self.nodes.into_iter().map(Point3::from).collect(),
            edges: self.edges,
            radius: self.radius,
            node_of_vertex: self.node_of_vertex,
        })
    }
}
