//! The structure of the file.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::HandleFileError;
use super::selection::Selection;
use super::track::{Interpolation, KeyRotation, RigidKey, Track};

/// Handles of a mesh.
#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct Document {
    /// Always `plumbline.handles`.
    #[expect(dead_code, reason = "read first, by itself")]
    format: String,
    /// Always 1.
    #[expect(dead_code, reason = "read first, by itself")]
    version: u32,
    /// Named sets of vertices, for handles, the region and other sets.
    #[serde(default)]
    pub(super) sets: BTreeMap<String, Selection>,
    /// The constrained vertices.
    #[cfg_attr(feature = "schema", schemars(length(min = 1)))]
    pub(super) handles: Vec<HandleEntry>,
    /// Vertices that may move besides the handles; the others are fixed. Default: all.
    #[serde(default)]
    pub(super) region: Option<Selection>,
}

/// Vertices that are fixed, or moved by `rigid` or `positions`.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct HandleEntry {
    /// Name in messages.
    #[serde(default)]
    pub(super) name: Option<String>,
    /// Its vertices.
    pub(super) vertices: Selection,
    /// Weight of soft constraints relative to the stiffness of the mesh, above 0. Default: hard constraints.
    #[serde(default)]
    pub(super) weight: Option<f64>,
    /// Moves all vertices by a rigid motion.
    #[serde(default)]
    rigid: Option<Rigid>,
    /// Moves each vertex to given positions.
    #[serde(default)]
    positions: Option<Positions>,
}

/// A rigid motion: rotation about the pivot, then translation. Either `keys`, or `rotation` and `translation` at time 1, from rest
/// at 0.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Rigid {
    /// Center of rotation. Default: the centroid of the handle's vertices.
    #[serde(default)]
    pivot: Option<[f64; 3]>,
    #[serde(default)]
    rotation: Option<Rotation>,
    /// Translation, in units of the mesh.
    #[serde(default)]
    translation: Option<[f64; 3]>,
    /// Keyframes with ascending times.
    #[serde(default)]
    keys: Option<Vec<RigidKeyEntry>>,
    /// Interpolation between keys.
    #[serde(default)]
    interpolation: Interpolation,
}

/// A keyframe of a rigid motion.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct RigidKeyEntry {
    /// Time, in any unit.
    time: f64,
    #[serde(default)]
    rotation: Option<Rotation>,
    /// Translation from rest, in units of the mesh.
    #[serde(default)]
    translation: Option<[f64; 3]>,
}

/// A rotation from rest.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(
    rename_all = "snake_case",
    untagged,
    expecting = "{\"axis\": [x, y, z], \"angle_deg\": …} or {\"quaternion\": [w, x, y, z]}"
)]
enum Rotation {
    /// About an axis, counterclockwise seen from its tip.
    Axis(AxisAngle),
    /// A quaternion, normalized when read.
    Quaternion(Quaternion),
}

/// Axis and angle.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    /// Direction of the axis, normalized when read.
    axis: [f64; 3],
    /// Angle, degrees; not reduced to 180° between keys with the same axis.
    angle_deg: f64,
}

/// A quaternion.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Quaternion {
    /// `[w, x, y, z]`.
    quaternion: [f64; 4],
}

/// One position per vertex at time 1, from rest at 0; or keyframes.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema), schemars(untagged))]
enum Positions {
    /// Positions of the vertices, in the order of `indices` or `nearest`.
    Targets(Vec<[f64; 3]>),
    /// Keyframes.
    Keys(PositionKeys),
}

/// Told apart by its first character: a derived reader would first store every number in 32 bytes.
impl<'de> Deserialize<'de> for Positions {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Positions;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of positions [x, y, z], or {\"keys\": [{\"time\": …, \"positions\": …}]}")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Positions, A::Error> {
                Deserialize::deserialize(SeqAccessDeserializer::new(seq)).map(Positions::Targets)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Positions, A::Error> {
                Deserialize::deserialize(MapAccessDeserializer::new(map)).map(Positions::Keys)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// Keyframes of positions.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct PositionKeys {
    /// Keyframes with ascending times.
    keys: Vec<PositionKeyEntry>,
    /// Interpolation between keys.
    #[serde(default)]
    interpolation: Interpolation,
}

/// A keyframe of positions.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct PositionKeyEntry {
    /// Time, in any unit.
    time: f64,
    /// Positions of the vertices, in the order of `indices` or `nearest`.
    positions: Vec<[f64; 3]>,
}

/// The JSON schema of handle files.
#[cfg(feature = "schema")]
pub fn handle_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

/// The error of a field.
#[expect(clippy::needless_pass_by_value, reason = "numbers and words alike")]
pub(super) fn rejected(context: &str, field: &'static str, value: impl ToString, expected: &str) -> HandleFileError {
    HandleFileError::Value {
        context: context.to_owned(),
        field,
        value: value.to_string(),
        expected: expected.to_owned(),
    }
}

impl HandleEntry {
    /// Checks the fields that do not depend on the mesh.
    pub(super) fn check(&self, context: &str) -> Result<(), HandleFileError> {
        if let Some(weight) = self.weight
            && !(weight > 0.0)
        {
            return Err(rejected(context, "weight", weight, "above 0; leave it out for hard constraints"));
        }
        if self.rigid.is_some() && self.positions.is_some() {
            return Err(rejected(context, "positions", "given beside rigid", "one of them"));
        }
        if let Some(rigid) = &self.rigid {
            rigid.keys(context)?;
        }
        if self.positions.is_some() && !self.vertices.has_order() {
            let expected = "\"indices\" or \"nearest\", in the order of the positions";
            return Err(rejected(context, "vertices", "a set without order beside positions", expected));
        }
        match &self.positions {
            Some(Positions::Keys(keys)) => check_times(context, keys.keys.iter().map(|k| k.time)),
            None | Some(Positions::Targets(_)) => Ok(()),
        }
    }

    /// Its motion; `listed` are its vertices in the order of the file, `vertices` the same in ascending order.
    pub(super) fn track(
        &self,
        context: &str,
        listed: &[u32],
        vertices: &[u32],
        rest: &[Point3<f64>],
    ) -> Result<Track, HandleFileError> {
        if let Some(rigid) = &self.rigid {
            let centroid = || {
                let first = rest[vertices[0] as usize];
                let sum: Vector3<f64> = vertices.iter().map(|v| rest[*v as usize] - first).sum();
                first + sum / vertices.len() as f64
            };
            let pivot = rigid.pivot.map_or_else(centroid, Point3::from);
            return Ok(Track::Rigid { pivot, keys: rigid.keys(context)?, interpolation: rigid.interpolation });
        }
        let at_rest = || vertices.iter().map(|v| rest[*v as usize]).collect();
        match &self.positions {
            None => Ok(Track::Still),
            Some(Positions::Targets(positions)) => {
                let keys = vec![(0.0, at_rest()), (1.0, ordered(context, listed, vertices, positions)?)];
                Ok(Track::Free { keys, interpolation: Interpolation::Linear })
            }
            Some(Positions::Keys(given)) => {
                let one = |k: &PositionKeyEntry| Ok((k.time, ordered(context, listed, vertices, &k.positions)?));
                let keys: Result<Vec<_>, HandleFileError> = given.keys.iter().map(one).collect();
                Ok(Track::Free { keys: keys?, interpolation: given.interpolation })
            }
        }
    }
}

/// Positions in the ascending order of the vertices.
fn ordered(
    context: &str,
    listed: &[u32],
    vertices: &[u32],
    positions: &[[f64; 3]],
) -> Result<Vec<Point3<f64>>, HandleFileError> {
    if positions.len() != listed.len() || listed.len() != vertices.len() {
        let expected = if listed.len() == vertices.len() {
            format!("{}, one per vertex", listed.len())
        } else {
            "one per vertex, and no vertex twice".to_owned()
        };
        return Err(rejected(context, "positions", format!("a list of {}", positions.len()), &expected));
    }
    let mut order: Vec<usize> = (0..listed.len()).collect();
    order.sort_unstable_by_key(|i| listed[*i]);
    Ok(order.into_iter().map(|i| Point3::from(positions[i])).collect())
}

impl Rigid {
    fn keys(&self, context: &str) -> Result<Vec<RigidKey>, HandleFileError> {
        let single = self.rotation.is_some() || self.translation.is_some();
        match &self.keys {
            Some(_) if single => Err(rejected(context, "keys", "given beside rotation or translation", "one of them")),
            Some(keys) => {
                check_times(context, keys.iter().map(|k| k.time))?;
                let one = |k: &RigidKeyEntry| key(context, k.time, k.rotation.as_ref(), k.translation);
                keys.iter().map(one).collect()
            }
            None if !single => Err(rejected(context, "rigid", "empty", "rotation, translation or keys")),
            None => Ok(vec![
                RigidKey { time: 0.0, rotation: KeyRotation::default(), translation: Vector3::zeros() },
                key(context, 1.0, self.rotation.as_ref(), self.translation)?,
            ]),
        }
    }
}

fn key(
    context: &str,
    time: f64,
    rotation: Option<&Rotation>,
    translation: Option<[f64; 3]>,
) -> Result<RigidKey, HandleFileError> {
    let rotation = match rotation {
        None => KeyRotation::default(),
        Some(Rotation::Axis(AxisAngle { axis, angle_deg })) => {
            let direction = Vector3::from(*axis).try_normalize(0.0);
            let direction = direction.filter(|d| d.iter().all(|c| c.is_finite()));
            let missing = || rejected(context, "axis", format!("{axis:?}"), "a direction: not all zeros");
            KeyRotation::AxisAngle(direction.ok_or_else(missing)? * angle_deg.to_radians())
        }
        Some(Rotation::Quaternion(Quaternion { quaternion: [w, x, y, z] })) => {
            let q = nalgebra::Quaternion::new(*w, *x, *y, *z);
            let value = || format!("[{w}, {x}, {y}, {z}]");
            let q = UnitQuaternion::try_new(q, 0.0).filter(|q| q.coords.iter().all(|c| c.is_finite()));
            KeyRotation::Quaternion(q.ok_or_else(|| rejected(context, "quaternion", value(), "not all zeros"))?)
        }
    };
    Ok(RigidKey { time, rotation, translation: translation.map_or_else(Vector3::zeros, Vector3::from) })
}

fn check_times(context: &str, times: impl Iterator<Item = f64> + Clone) -> Result<(), HandleFileError> {
    let count = times.clone().count();
    if count == 0 {
        return Err(rejected(context, "keys", "an empty list", "at least one key"));
    }
    let next = times.clone().skip(1);
    match times.zip(next).find(|(a, b)| !(a < b)) {
        Some((a, b)) => Err(rejected(context, "time", format!("{b} after {a}"), "ascending times")),
        None => Ok(()),
    }
}
