//! Edits of motions: drags, typed numbers, keys over time.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};

use super::{Gesture, Surface};
use crate::error::StudioError;
use crate::mesh::document::{Handle, MeshDocument};
use crate::mesh::keys::{self, Motion, checked_time};
use crate::mesh::message::{Edit, KeyId};
use crate::workspace::Step;
use plumbline_shape::surface::handle_file::{Interpolation, KeyRotation, MeshHandle, RigidKey, Track};

pub(super) fn drag(
    mut next: MeshDocument,
    (handle, number, time): (usize, u32, f64),
    motion: &Motion,
    surface: &Surface<'_>,
    gesture: &mut Option<Gesture>,
) -> Result<Step<MeshDocument>, StudioError> {
    let base = began(&next, number, gesture).get(handle).cloned();
    let base = base.ok_or_else(|| StudioError::request(format!("there is no handle {handle}")))?;
    let of = next.handle_mut(handle)?;
    if base.mesh.vertices != of.mesh.vertices {
        return Err(StudioError::request("the handle has changed since the drag began"));
    }
    of.mesh.track = keys::dragged(&base.mesh, &of.mesh.track, surface.rest, time, motion)?;
    let label = format!("Move {}", of.mesh.name);
    Ok(Step::new(next, label).merged(format!("drag {handle} {number}")))
}

/// The handles as they were when a gesture began: now, if it is a new one.
fn began<'a>(document: &MeshDocument, number: u32, gesture: &'a mut Option<Gesture>) -> &'a [Arc<Handle>] {
    if gesture.as_ref().is_none_or(|g| g.number != number) {
        *gesture = None;
    }
    &gesture.get_or_insert_with(|| Gesture { number, handles: document.handles.clone() }).handles
}

pub(super) fn set_key(
    mut next: MeshDocument,
    edit: &Edit,
    surface: &Surface<'_>,
) -> Result<Step<MeshDocument>, StudioError> {
    let (handle, label) = match *edit {
        Edit::Place { handle, time, translation, axis, angle_deg } => {
            let of = &mut next.handle_mut(handle)?.mesh;
            let key = keys::rigid_key(&of.track, checked_time(time)?);
            let key = key.ok_or_else(|| StudioError::request(format!("{} does not move rigidly", of.name)))?;
            of.track = keys::with_rigid_key(&of.track, placed(key, translation, axis, angle_deg)?)?;
            return Ok(Step::new(next, "Type numbers").merged(format!("place {handle}")));
        }
        Edit::Reset { handle, time } => {
            let time = checked_time(time)?;
            let of = &mut next.handle_mut(handle)?.mesh;
            of.track = at_rest(of, surface.rest, time)?;
            (handle, "Back to rest")
        }
        Edit::AddKey { handle, time } => {
            let time = checked_time(time)?;
            let of = &mut next.handle_mut(handle)?.mesh;
            of.track = keys::with_key(of, surface.rest, time)?;
            (handle, "Add key of")
        }
        Edit::SetInterpolation { handle, smooth } => {
            let how = if smooth { Interpolation::Smooth } else { Interpolation::Linear };
            let of = &mut next.handle_mut(handle)?.mesh;
            of.track = keys::interpolated(&of.track, how);
            (handle, if smooth { "Smooth keys of" } else { "Linear keys of" })
        }
        _ => return Err(StudioError::request("not an edit of a key")),
    };
    let label = format!("{label} {}", next.handle(handle)?.mesh.name);
    Ok(Step::new(next, label))
}

/// A key with the numbers that were typed.
fn placed(
    key: RigidKey,
    translation: Option<[f64; 3]>,
    axis: Option<[f64; 3]>,
    angle_deg: Option<f64>,
) -> Result<RigidKey, StudioError> {
    let mut key = key;
    if let Some(translation) = translation {
        key.translation = Motion::new(translation, [1.0, 0.0, 0.0, 0.0], [1.0; 3])?.translation;
    }
    if let (Some(axis), Some(angle)) = (axis, angle_deg) {
        let axis = UnitVector3::try_new(Vector3::from(axis), 1e-100).filter(|a| a.iter().all(|c| c.is_finite()));
        let axis =
            axis.ok_or_else(|| StudioError::request("the axis is no direction: give a vector that is not zero"))?;
        if !(angle.abs() <= 36_000.0) {
            return Err(StudioError::request(format!("the angle {angle}° is invalid (expected −36000 to 36000)")));
        }
        key.rotation = KeyRotation::AxisAngle(axis.into_inner() * angle.to_radians());
    }
    Ok(key)
}

/// The track with its key at `time` at rest.
fn at_rest(handle: &MeshHandle, rest: &[Point3<f64>], time: f64) -> Result<Track, StudioError> {
    match &handle.track {
        Track::Still => Ok(Track::Still),
        track @ Track::Rigid { .. } => {
            let key = RigidKey { time, rotation: KeyRotation::default(), translation: Vector3::zeros() };
            keys::with_rigid_key(track, key)
        }
        Track::Free { .. } => {
            let Track::Free { mut keys, interpolation } = keys::with_key(handle, rest, time)? else {
                return Ok(handle.track.clone());
            };
            for (_, positions) in keys.iter_mut().filter(|k| keys::same_time(k.0, time)) {
                *positions = handle.vertices.iter().map(|v| rest[*v as usize]).collect();
            }
            Ok(Track::Free { keys, interpolation })
        }
    }
}

pub(super) fn delete_keys(mut next: MeshDocument, ids: &[KeyId]) -> Result<Step<MeshDocument>, StudioError> {
    for handle in 0..next.handles.len() {
        let times: Vec<f64> = ids.iter().filter(|k| k.handle == handle).map(|k| k.time).collect();
        if !times.is_empty() {
            let of = &mut next.handle_mut(handle)?.mesh;
            of.track = keys::without_keys(&of.track, &times)?;
        }
    }
    let label = if ids.len() == 1 { "Delete key".to_owned() } else { format!("Delete {} keys", ids.len()) };
    Ok(Step::new(next, label))
}

pub(super) fn move_keys(
    mut next: MeshDocument,
    ids: &[KeyId],
    by: f64,
    number: u32,
    gesture: &mut Option<Gesture>,
) -> Result<Step<MeshDocument>, StudioError> {
    let base = began(&next, number, gesture).to_vec();
    if base.len() != next.handles.len() {
        return Err(StudioError::request("the handles have changed since the drag began"));
    }
    for (handle, start) in base.iter().enumerate() {
        let times: Vec<f64> = ids.iter().filter(|k| k.handle == handle).map(|k| k.time).collect();
        if !times.is_empty() {
            let moved = |t: f64| Some(if times.iter().any(|k| keys::same_time(*k, t)) { t + by } else { t });
            next.handle_mut(handle)?.mesh.track = keys::retimed(&start.mesh.track, moved)?;
        }
    }
    let label = if ids.len() == 1 { "Move key".to_owned() } else { format!("Move {} keys", ids.len()) };
    Ok(Step::new(next, label).merged(format!("keys {number}")))
}
