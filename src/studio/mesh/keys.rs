//! Motions of handles: keys set, moved and removed; frames of gizmos.

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use crate::error::StudioError;
use plumbline_shape::surface::handle_file::{Interpolation, KeyRotation, MeshHandle, RigidKey, Track};

/// Keys nearer than this fraction of their time are one.
const SAME_TIME: f64 = 1e-9;
/// Maximum number of keys of a handle.
pub const MAX_KEYS: usize = 10_000;
/// Latest time of a key, either way.
pub const MAX_TIME: f64 = 1e6;

/// Whether two times are those of one key.
pub fn same_time(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME_TIME * (1.0 + a.abs().max(b.abs()))
}

/// A time in its range.
///
/// # Errors
/// [`StudioError::Request`].
pub fn checked_time(time: f64) -> Result<f64, StudioError> {
    if time.abs() <= MAX_TIME {
        return Ok(time);
    }
    Err(StudioError::request(format!("the time {time} is invalid (expected −{MAX_TIME} to {MAX_TIME})")))
}

/// A change of a handle since a drag began: scaled and rotated about the frame of the handle, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Units of the mesh.
    pub translation: Vector3<f64>,
    /// Applied after the scale.
    pub rotation: UnitQuaternion<f64>,
    /// Along the axes of the mesh.
    pub scale: Vector3<f64>,
}

impl Motion {
    /// The motion that a page described; the rotation is `[w, x, y, z]`.
    ///
    /// # Errors
    /// [`StudioError::Request`] for numbers that are not finite, a rotation without direction.
    pub fn new(translation: [f64; 3], rotation: [f64; 4], scale: [f64; 3]) -> Result<Self, StudioError> {
        let finite = |all: &[f64]| all.iter().all(|c| c.is_finite() && c.abs() < 1e100);
        let [w, x, y, z] = rotation;
        let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-12);
        match rotation {
            Some(rotation) if finite(&translation) && finite(rotation.coords.as_slice()) && finite(&scale) => {
                Ok(Self { translation: translation.into(), rotation, scale: scale.into() })
            }
            _ => Err(StudioError::request(
                "the motion is invalid (expected finite numbers, and a rotation that is not zero)",
            )),
        }
    }

    fn scales(&self) -> bool {
        self.scale != Vector3::repeat(1.0)
    }
}

/// Centroid of the vertices: the pivot of a new rigid handle.
pub fn centroid(points: impl ExactSizeIterator<Item = Point3<f64>> + Clone) -> Point3<f64> {
    let Some(first) = points.clone().next() else { return Point3::origin() };
    let count = points.len() as f64;
    first + points.map(|p| p - first).sum::<Vector3<f64>>() / count
}

/// The motion of a handle that begins to move rigidly: at rest at 0 and at 1.
pub fn rigid(vertices: &[u32], rest: &[Point3<f64>]) -> Track {
    let key = |time| RigidKey { time, rotation: KeyRotation::default(), translation: Vector3::zeros() };
    let pivot = centroid(vertices.iter().map(|v| rest[*v as usize]));
    Track::Rigid { pivot, keys: vec![key(0.0), key(1.0)], interpolation: Interpolation::Linear }
}

/// The motion of a handle whose vertices begin to move each by itself.
pub fn free(vertices: &[u32], rest: &[Point3<f64>]) -> Track {
    let positions: Vec<_> = vertices.iter().map(|v| rest[*v as usize]).collect();
    Track::Free { keys: vec![(0.0, positions.clone()), (1.0, positions)], interpolation: Interpolation::Linear }
}

/// The same motion with a position of each vertex at every key; between keys, rotations become straight lines.
pub fn freed(handle: &MeshHandle, rest: &[Point3<f64>]) -> Track {
    let times = times(&handle.track);
    if times.is_empty() {
        return free(&handle.vertices, rest);
    }
    let key = |time: f64| (time, handle.track.positions(&handle.vertices, rest, time));
    Track::Free { keys: times.into_iter().map(key).collect(), interpolation: interpolation(&handle.track) }
}

/// Times of the keys.
pub fn times(track: &Track) -> Vec<f64> {
    match track {
        Track::Still => Vec::new(),
        Track::Rigid { keys, .. } => keys.iter().map(|k| k.time).collect(),
        Track::Free { keys, .. } => keys.iter().map(|k| k.0).collect(),
    }
}

/// Interpolation between the keys.
pub fn interpolation(track: &Track) -> Interpolation {
    match track {
        Track::Still => Interpolation::Linear,
        Track::Rigid { interpolation, .. } | Track::Free { interpolation, .. } => *interpolation,
    }
}

/// The key of a rigid motion at a time, there or interpolated.
pub fn rigid_key(track: &Track, time: f64) -> Option<RigidKey> {
    let Track::Rigid { pivot, keys, .. } = track else { return None };
    if let Some(key) = keys.iter().find(|k| same_time(k.time, time)) {
        return Some(*key);
    }
    let rotation = track.rotation(time)?;
    // Where the pivot goes is the translation.
    let moved = track.positions(&[0], &[*pivot], time);
    let translation = moved.first()? - pivot;
    Some(RigidKey { time, rotation: KeyRotation::AxisAngle(rotation.scaled_axis()), translation })
}

/// Position and orientation of a handle at a time: of its gizmo.
pub fn frame(handle: &MeshHandle, rest: &[Point3<f64>], time: f64) -> (Point3<f64>, UnitQuaternion<f64>) {
    if let (Track::Rigid { pivot, .. }, Some(key)) = (&handle.track, rigid_key(&handle.track, time)) {
        return (pivot + key.translation, key.rotation.rotation());
    }
    let positions = handle.track.positions(&handle.vertices, rest, time);
    (centroid(positions.iter().copied()), UnitQuaternion::identity())
}

/// The track after a drag that began with `base` and is now `latest`: the key at `time` is set.
///
/// # Errors
/// [`StudioError::Request`] for a handle that is fixed.
pub fn dragged(
    base: &MeshHandle,
    latest: &Track,
    rest: &[Point3<f64>],
    time: f64,
    motion: &Motion,
) -> Result<Track, StudioError> {
    let mut base = base.clone();
    if motion.scales() && matches!(base.track, Track::Rigid { .. }) {
        base.track = freed(&base, rest);
    }
    match &base.track {
        Track::Still => Err(StudioError::request(format!("handle {:?} is fixed: let it move first", base.name))),
        Track::Rigid { .. } => {
            let from = rigid_key(&base.track, time).ok_or_else(|| StudioError::request("the handle has no motion"))?;
            let turned = motion.rotation * from.rotation.rotation();
            let near = rigid_key(latest, time).map_or(from.rotation, |k| k.rotation);
            let key = RigidKey {
                time,
                rotation: KeyRotation::AxisAngle(nearest_vector(turned, scaled_axis(near))),
                translation: from.translation + motion.translation,
            };
            with_rigid_key(&base.track, key)
        }
        Track::Free { keys, interpolation } => {
            let from = base.track.positions(&base.vertices, rest, time);
            let center = centroid(from.iter().copied());
            let moved = |p: &Point3<f64>| {
                center + motion.rotation * (p - center).component_mul(&motion.scale) + motion.translation
            };
            let mut keys = keys.clone();
            insert(&mut keys, (time, from.iter().map(moved).collect()), |k| k.0)?;
            Ok(Track::Free { keys, interpolation: *interpolation })
        }
    }
}

fn scaled_axis(rotation: KeyRotation) -> Vector3<f64> {
    match rotation {
        KeyRotation::AxisAngle(vector) => vector,
        KeyRotation::Quaternion(rotation) => rotation.scaled_axis(),
    }
}

/// The rotation vector of a rotation that is nearest to another one: a hand that turns on passes half a rotation.
fn nearest_vector(rotation: UnitQuaternion<f64>, near: Vector3<f64>) -> Vector3<f64> {
    use std::f64::consts::TAU;
    let Some((axis, angle)) = rotation.axis_angle() else {
        // A whole number of rotations about the axis that it had.
        let turns = (near.norm() / TAU).round();
        return near.try_normalize(1e-12).map_or(Vector3::zeros(), |axis| axis * turns * TAU);
    };
    let along = near.dot(&axis);
    axis.into_inner() * (angle + TAU * ((along - angle) / TAU).round())
}

/// The track with this key, in the position of one at the same time.
///
/// # Errors
/// [`StudioError::Request`] for a motion that is not rigid, or too many keys.
pub fn with_rigid_key(track: &Track, key: RigidKey) -> Result<Track, StudioError> {
    let Track::Rigid { pivot, keys, interpolation } = track else {
        return Err(StudioError::request("the handle does not move rigidly"));
    };
    let mut keys = keys.clone();
    insert(&mut keys, key, |k| k.time)?;
    Ok(Track::Rigid { pivot: *pivot, keys, interpolation: *interpolation })
}

fn insert<K>(keys: &mut Vec<K>, key: K, time: impl Fn(&K) -> f64) -> Result<(), StudioError> {
    let at = time(&key);
    if let Some(same) = keys.iter().position(|k| same_time(time(k), at)) {
        keys[same] = key;
        return Ok(());
    }
    if keys.len() >= MAX_KEYS {
        return Err(StudioError::request(format!("a handle has at most {MAX_KEYS} keys")));
    }
    let after = keys.partition_point(|k| time(k) < at);
    keys.insert(after, key);
    Ok(())
}

/// The track with a key at a time that changes nothing there.
///
/// # Errors
/// [`StudioError::Request`] for a handle that is fixed.
pub fn with_key(handle: &MeshHandle, rest: &[Point3<f64>], time: f64) -> Result<Track, StudioError> {
    let nothing =
        Motion { translation: Vector3::zeros(), rotation: UnitQuaternion::identity(), scale: Vector3::repeat(1.0) };
    dragged(handle, &handle.track, rest, time, &nothing)
}

/// The track without the keys at these times.
///
/// # Errors
/// [`StudioError::Request`] where none would be left.
pub fn without_keys(track: &Track, removed: &[f64]) -> Result<Track, StudioError> {
    retimed(track, |time| (!removed.iter().any(|r| same_time(*r, time))).then_some(time))
}

/// The track with keys at other times; `None` removes a key. A key that comes to another's time takes its place.
///
/// # Errors
/// [`StudioError::Request`] where no key would be left, or for a time out of its range.
pub fn retimed(track: &Track, time: impl Fn(f64) -> Option<f64>) -> Result<Track, StudioError> {
    match track {
        Track::Still => Ok(Track::Still),
        Track::Rigid { pivot, keys, interpolation } => {
            let moved =
                keys.iter().map(|k| (k.time, time(k.time), RigidKey { time: time(k.time).unwrap_or(0.0), ..*k }));
            let keys = settled(moved.collect(), |k: &RigidKey| k.time)?;
            Ok(Track::Rigid { pivot: *pivot, keys, interpolation: *interpolation })
        }
        Track::Free { keys, interpolation } => {
            let moved = keys.iter().map(|(t, p)| (*t, time(*t), (time(*t).unwrap_or(0.0), p.clone())));
            let keys = settled(moved.collect(), |k: &(f64, Vec<Point3<f64>>)| k.0)?;
            Ok(Track::Free { keys, interpolation: *interpolation })
        }
    }
}

/// Keys after they were moved: those that stayed first, so that the moved ones take their place.
fn settled<K>(moved: Vec<(f64, Option<f64>, K)>, time: impl Fn(&K) -> f64) -> Result<Vec<K>, StudioError> {
    let mut kept = Vec::with_capacity(moved.len());
    let (still, moving): (Vec<_>, Vec<_>) = moved
        .into_iter()
        .filter(|m| m.1.is_some())
        .partition(|(from, to, _)| to.is_some_and(|to| same_time(*from, to)));
    for (_, to, key) in still.into_iter().chain(moving) {
        checked_time(to.unwrap_or(0.0))?;
        insert(&mut kept, key, &time)?;
    }
    if kept.is_empty() {
        return Err(StudioError::request("a handle that moves has at least one key; make it fixed instead"));
    }
    Ok(kept)
}

/// The track with another interpolation.
pub fn interpolated(track: &Track, how: Interpolation) -> Track {
    match track.clone() {
        Track::Still => Track::Still,
        Track::Rigid { pivot, keys, .. } => Track::Rigid { pivot, keys, interpolation: how },
        Track::Free { keys, .. } => Track::Free { keys, interpolation: how },
    }
}

/// The rigid motion about another center: every key moves the handle as before.
pub fn pivoted(track: &Track, to: Point3<f64>) -> Option<Track> {
    let Track::Rigid { pivot, keys, interpolation } = track else { return None };
    let key = |k: &RigidKey| {
        let offset = to - pivot;
        RigidKey { translation: k.translation + k.rotation.rotation() * offset - offset, ..*k }
    };
    Some(Track::Rigid { pivot: to, keys: keys.iter().map(key).collect(), interpolation: *interpolation })
}
