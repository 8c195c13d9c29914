//! The shape of the file.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitQuaternion, Vector3};
use serde::Deserialize;

use super::HandleFileError;
use super::selection::Selection;
use super::track::{Interpolation, RigidKey, Track, Turn};

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
    /// Sets of vertices, by names that handles, the region and other sets may use.
    #[serde(default)]
    pub(super) sets: BTreeMap<String, Selection>,
    /// What is held or moved.
    #[cfg_attr(feature = "schema", schemars(length(min = 1)))]
    pub(super) handles: Vec<HandleEntry>,
    /// What may move besides the handles; all that lies outside is held still. Left out: everything.
    #[serde(default)]
    pub(super) region: Option<Selection>,
}

/// Vertices that are held still, or moved by `rigid` or `positions`.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct HandleEntry {
    /// What messages call it.
    #[serde(default)]
    pub(super) name: Option<String>,
    /// Its vertices.
    pub(super) vertices: Selection,
    /// How strongly the vertices are drawn to their targets, above 0; left out, they are there exactly.
    #[serde(default)]
    pub(super) weight: Option<f64>,
    /// Moves all vertices as one body.
    #[serde(default)]
    rigid: Option<Rigid>,
    /// Moves each vertex by itself.
    #[serde(default)]
    positions: Option<Positions>,
}

/// A rigid motion: turn about the pivot, then move. Either `keys`, or `rotation` and `translation` at time 1, from rest at 0.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Rigid {
    /// About what it turns; the middle of the handle's vertices if left out.
    #[serde(default)]
    pivot: Option<[f64; 3]>,
    #[serde(default)]
    rotation: Option<Rotation>,
    /// By how much it moves.
    #[serde(default)]
    translation: Option<[f64; 3]>,
    /// Motions at times, which ascend.
    #[serde(default)]
    keys: Option<Vec<RigidKeyEntry>>,
    /// What happens between keys.
    #[serde(default)]
    interpolation: Interpolation,
}

/// A rigid motion at a time.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct RigidKeyEntry {
    /// When, in units of your choice.
    time: f64,
    #[serde(default)]
    rotation: Option<Rotation>,
    /// By how much it moves from rest.
    #[serde(default)]
    translation: Option<[f64; 3]>,
}

/// A turn from rest.
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
    /// A quaternion; its length does not count.
    Quaternion(Quaternion),
}

/// Axis and angle.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct AxisAngle {
    /// Direction of the axis; its length does not count.
    axis: [f64; 3],
    /// Angle, degrees; turns of more than half a circle go all the way where the axis stays the same from key to key.
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

/// One place per vertex at time 1, from rest at 0; or keys.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged, expecting = "a list of places [x, y, z], or {\"keys\": [{\"time\": …, \"positions\": …}]}")]
enum Positions {
    /// Places of the vertices, in the order of `indices` or `nearest`.
    Places(Vec<[f64; 3]>),
    /// Places at times.
    Keys(PositionKeys),
}

/// Places at times.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct PositionKeys {
    /// Places at times, which ascend.
    keys: Vec<PositionKeyEntry>,
    /// What happens between keys.
    #[serde(default)]
    interpolation: Interpolation,
}

/// Places at a time.
#[derive(Clone, Debug, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct PositionKeyEntry {
    /// When, in units of your choice.
    time: f64,
    /// Places of the vertices, in the order of `indices` or `nearest`.
    positions: Vec<[f64; 3]>,
}

/// The JSON schema of handle files.
#[cfg(feature = "schema")]
pub fn handle_file_schema() -> schemars::Schema {
    schemars::schema_for!(Document)
}

/// A refusal of a field.
#[expect(clippy::needless_pass_by_value, reason = "numbers and words alike")]
pub(super) fn refused(place: &str, field: &'static str, value: impl ToString, expected: &str) -> HandleFileError {
    HandleFileError::Value { place: place.to_owned(), field, value: value.to_string(), expected: expected.to_owned() }
}

impl HandleEntry {
    /// Refuses what no mesh could make good.
    pub(super) fn check(&self, place: &str) -> Result<(), HandleFileError> {
        if let Some(weight) = self.weight
            && !(weight > 0.0)
        {
            return Err(refused(place, "weight", weight, "above 0; left out, vertices are held exactly"));
        }
        if self.rigid.is_some() && self.positions.is_some() {
            return Err(refused(place, "positions", "given beside rigid", "one of both"));
        }
        if let Some(rigid) = &self.rigid {
            rigid.keys(place)?;
        }
        if self.positions.is_some() && !self.vertices.has_order() {
            let expected = "\"indices\" or \"nearest\", whose order tells which place is whose";
            return Err(refused(place, "vertices", "a set without order beside positions", expected));
        }
        match &self.positions {
            Some(Positions::Keys(keys)) => check_times(place, keys.keys.iter().map(|k| k.time)),
            None | Some(Positions::Places(_)) => Ok(()),
        }
    }

    /// Its motion: `listed` are its vertices in the order of the file, `vertices` the same, ascending.
    pub(super) fn track(
        &self,
        place: &str,
        listed: &[u32],
        vertices: &[u32],
        rest: &[Point3<f64>],
    ) -> Result<Track, HandleFileError> {
        if let Some(rigid) = &self.rigid {
            let middle = || {
                let first = rest[vertices[0] as usize];
                let sum: Vector3<f64> = vertices.iter().map(|v| rest[*v as usize] - first).sum();
                first + sum / vertices.len() as f64
            };
            let pivot = rigid.pivot.map_or_else(middle, Point3::from);
            return Ok(Track::Rigid { pivot, keys: rigid.keys(place)?, interpolation: rigid.interpolation });
        }
        let at_rest = || vertices.iter().map(|v| rest[*v as usize]).collect();
        match &self.positions {
            None => Ok(Track::Still),
            Some(Positions::Places(places)) => {
                let keys = vec![(0.0, at_rest()), (1.0, ordered(place, listed, vertices, places)?)];
                Ok(Track::Free { keys, interpolation: Interpolation::Linear })
            }
            Some(Positions::Keys(given)) => {
                let one = |k: &PositionKeyEntry| Ok((k.time, ordered(place, listed, vertices, &k.positions)?));
                let keys: Result<Vec<_>, HandleFileError> = given.keys.iter().map(one).collect();
                Ok(Track::Free { keys: keys?, interpolation: given.interpolation })
            }
        }
    }
}

/// Places in the ascending order of the vertices.
fn ordered(
    place: &str,
    listed: &[u32],
    vertices: &[u32],
    places: &[[f64; 3]],
) -> Result<Vec<Point3<f64>>, HandleFileError> {
    if places.len() != listed.len() || listed.len() != vertices.len() {
        let expected = if listed.len() == vertices.len() {
            format!("{}, one per vertex", listed.len())
        } else {
            "one per vertex, and no vertex twice".to_owned()
        };
        return Err(refused(place, "positions", format!("a list of {}", places.len()), &expected));
    }
    let mut order: Vec<usize> = (0..listed.len()).collect();
    order.sort_unstable_by_key(|i| listed[*i]);
    Ok(order.into_iter().map(|i| Point3::from(places[i])).collect())
}

impl Rigid {
    fn keys(&self, place: &str) -> Result<Vec<RigidKey>, HandleFileError> {
        let alone = self.rotation.is_some() || self.translation.is_some();
        match &self.keys {
            Some(_) if alone => Err(refused(place, "keys", "given beside rotation or translation", "one of both")),
            Some(keys) => {
                check_times(place, keys.iter().map(|k| k.time))?;
                let one = |k: &RigidKeyEntry| key(place, k.time, k.rotation.as_ref(), k.translation);
                keys.iter().map(one).collect()
            }
            None if !alone => Err(refused(place, "rigid", "empty", "rotation, translation or keys")),
            None => Ok(vec![
                RigidKey { time: 0.0, turn: Turn::default(), translation: Vector3::zeros() },
                key(place, 1.0, self.rotation.as_ref(), self.translation)?,
            ]),
        }
    }
}

fn key(
    place: &str,
    time: f64,
    rotation: Option<&Rotation>,
    translation: Option<[f64; 3]>,
) -> Result<RigidKey, HandleFileError> {
    let turn = match rotation {
        None => Turn::default(),
        Some(Rotation::Axis(AxisAngle { axis, angle_deg })) => {
            let direction = Vector3::from(*axis).try_normalize(0.0);
            let direction = direction.filter(|d| d.iter().all(|c| c.is_finite()));
            let missing = || refused(place, "axis", format!("{axis:?}"), "a direction: not all zeros");
            Turn::About(direction.ok_or_else(missing)? * angle_deg.to_radians())
        }
        Some(Rotation::Quaternion(Quaternion { quaternion: [w, x, y, z] })) => {
            let q = nalgebra::Quaternion::new(*w, *x, *y, *z);
            let value = || format!("[{w}, {x}, {y}, {z}]");
            let turn = UnitQuaternion::try_new(q, 0.0).filter(|q| q.coords.iter().all(|c| c.is_finite()));
            Turn::To(turn.ok_or_else(|| refused(place, "quaternion", value(), "not all zeros"))?)
        }
    };
    Ok(RigidKey { time, turn, translation: translation.map_or_else(Vector3::zeros, Vector3::from) })
}

fn check_times(place: &str, times: impl Iterator<Item = f64> + Clone) -> Result<(), HandleFileError> {
    let count = times.clone().count();
    if count == 0 {
        return Err(refused(place, "keys", "an empty list", "one key at least"));
    }
    let next = times.clone().skip(1);
    match times.zip(next).find(|(a, b)| !(a < b)) {
        Some((a, b)) => Err(refused(place, "time", format!("{b} after {a}"), "times that ascend from key to key")),
        None => Ok(()),
    }
}
