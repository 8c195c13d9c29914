//! Edits: from a document to another one.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Point3, UnitVector3, Vector3};
use serde_json::{Value, json};

use super::document::{Handle, MAX_HANDLES, MAX_NAME, MAX_SETS, MeshDocument, NamedSet, Region};
use super::keys::{self, Motion, checked_time};
use super::message::{Edit, HandleKind, KeyId};
use super::vertices::{self, Combine, Follow};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_shape::mesh::VertexGraph;
use plumbline_shape::surface::SolvableMesh;
use plumbline_shape::surface::handle_file::{Interpolation, KeyRotation, MeshHandle, RigidKey, Track};

/// What edits are made on.
pub struct Surface<'a> {
    /// Positions of the vertices of the file.
    pub rest: &'a [Point3<f64>],
    /// The surface that is solved for.
    pub solvable: &'a SolvableMesh,
    /// Its edges.
    pub graph: &'a VertexGraph,
}

/// The handle as it was when a drag began.
#[derive(Debug)]
pub struct Gesture {
    number: u32,
    handles: Vec<Arc<Handle>>,
}

/// The document after an edit.
///
/// # Errors
/// [`StudioError::Request`] where it does not fit.
pub fn apply(
    document: &MeshDocument,
    edit: Edit,
    surface: &Surface<'_>,
    gesture: &mut Option<Gesture>,
) -> Result<Step<MeshDocument>, StudioError> {
    let next = document.clone();
    match edit {
        Edit::Select { .. }
        | Edit::SelectAll
        | Edit::SelectNone
        | Edit::SelectInverse
        | Edit::SelectConnected
        | Edit::SelectRings { .. }
        | Edit::SelectHalfSpace { .. }
        | Edit::SelectSet { .. }
        | Edit::SelectHandle { .. } => select(next, edit, surface),
        Edit::NameSelection { .. } | Edit::RenameSet { .. } | Edit::DeleteSet { .. } => sets(next, edit),
        Edit::AddHandle { kind, name } => add_handle(next, kind, name, surface),
        Edit::Activate { .. }
        | Edit::RenameHandle { .. }
        | Edit::DeleteHandles { .. }
        | Edit::ReorderHandle { .. }
        | Edit::SetVertices { .. }
        | Edit::SetKind { .. }
        | Edit::SetWeight { .. }
        | Edit::SetPivot { .. } => change_handle(next, edit, surface),
        Edit::Drag { handle, gesture: number, time, translation, rotation, scale } => {
            let motion = Motion::new(translation, rotation, scale)?;
            drag(next, (handle, number, checked_time(time)?), &motion, surface, gesture)
        }
        Edit::Place { .. } | Edit::Reset { .. } | Edit::AddKey { .. } | Edit::SetInterpolation { .. } => {
            set_key(next, edit, surface)
        }
        Edit::DeleteKeys { keys } => delete_keys(next, &keys),
        Edit::MoveKeys { keys, by, gesture: number } => move_keys(next, &keys, by, number, gesture),
        Edit::PaintRegion { .. } | Edit::RegionFromSelection | Edit::ClearRegion => region(next, edit, surface),
        Edit::SetOption { name, value } => set_option(next, &name, &value),
        Edit::SetFrames { frames, seconds } => {
            let pipeline = next.pipeline.with_frames(frames, seconds)?;
            Ok(Step::new(MeshDocument { pipeline, ..next }, format!("{frames} frames")))
        }
        Edit::SetOutput { name } => {
            let pipeline = next.pipeline.with_output(&name)?;
            Ok(Step::new(MeshDocument { pipeline, ..next }, format!("Write {name}")))
        }
    }
}

fn select(mut next: MeshDocument, edit: Edit, surface: &Surface<'_>) -> Result<Step<MeshDocument>, StudioError> {
    let count = surface.rest.len();
    let follow = |how| vertices::followed(&next.selection, how, surface.solvable, surface.graph);
    let (set, how, label, stroke) = match edit {
        Edit::Select { vertices, how, stroke } => {
            let set = vertices::checked(vertices, count)?;
            let n = set.len();
            let what = if n == 1 { "1 vertex".to_owned() } else { format!("{n} vertices") };
            let stroke = stroke == Some(true);
            let label = if stroke { "Select by brush".to_owned() } else { format!("Select {what}") };
            (set, how, label, stroke)
        }
        Edit::SelectAll => ((0..count as u32).collect(), Combine::Replace, "Select all".to_owned(), false),
        Edit::SelectInverse => {
            (vertices::inverted(&next.selection, count), Combine::Replace, "Invert selection".to_owned(), false)
        }
        Edit::SelectConnected => (follow(Follow::Component), Combine::Replace, "Select connected".to_owned(), false),
        Edit::SelectRings { rings } => {
            let how =
                if rings < 0 { Follow::Shrink(rings.unsigned_abs() as usize) } else { Follow::Grow(rings as usize) };
            let label = if rings < 0 { "Shrink selection" } else { "Grow selection" };
            (follow(how), Combine::Replace, label.to_owned(), false)
        }
        Edit::SelectHalfSpace { point, normal, how } => {
            (vertices::half_space(surface.rest, point, normal)?, how, "Select half-space".to_owned(), false)
        }
        Edit::SelectSet { name, how } => {
            let set = next.sets.get(&name).ok_or_else(|| no_set(&name))?;
            (set.vertices.clone(), how, format!("Select {name}"), false)
        }
        Edit::SelectHandle { handle, how } => {
            let of = &next.handle(handle)?.mesh;
            (of.vertices.clone(), how, format!("Select {}", of.name), false)
        }
        _ => (Vec::new(), Combine::Replace, "Select nothing".to_owned(), false),
    };
    next.selection = vertices::combined(&next.selection, set, how).into();
    let step = Step::new(next, label);
    Ok(if stroke { step.merged("select") } else { step })
}

fn no_set(name: &str) -> StudioError {
    StudioError::request(format!("there is no set {name:?}"))
}

fn checked_name(name: &str) -> Result<String, StudioError> {
    let name = name.trim();
    if name.is_empty() || name.len() > MAX_NAME {
        return Err(StudioError::request(format!("a name has 1 to {MAX_NAME} characters")));
    }
    Ok(name.to_owned())
}

fn sets(mut next: MeshDocument, edit: Edit) -> Result<Step<MeshDocument>, StudioError> {
    let mut sets: BTreeMap<String, Arc<NamedSet>> = (*next.sets).clone();
    let label = match edit {
        Edit::NameSelection { name } => {
            let name = checked_name(&name)?;
            if next.selection.is_empty() {
                return Err(StudioError::request("nothing is selected: select vertices first"));
            }
            if sets.len() >= MAX_SETS {
                return Err(StudioError::request(format!("at most {MAX_SETS} sets")));
            }
            let label = format!("Name {} vertices {name}", next.selection.len());
            sets.insert(name, Arc::new(NamedSet { vertices: next.selection.to_vec(), described: None }));
            label
        }
        Edit::RenameSet { from, to } => {
            let to = checked_name(&to)?;
            if sets.contains_key(&to) {
                return Err(StudioError::request(format!("there is a set {to:?} already")));
            }
            let set = sets.remove(&from).ok_or_else(|| no_set(&from))?;
            let label = format!("Rename {from} to {to}");
            sets.insert(to, set);
            label
        }
        Edit::DeleteSet { name } => {
            sets.remove(&name).ok_or_else(|| no_set(&name))?;
            format!("Delete set {name}")
        }
        _ => return Err(StudioError::request("not an edit of sets")),
    };
    // What the file described may refer to a set by its name.
    for set in sets.values_mut().filter(|set| set.described.is_some()) {
        Arc::make_mut(set).described = None;
    }
    for handle in next.handles.iter_mut().filter(|h| h.described.is_some()) {
        Arc::make_mut(handle).described = None;
    }
    next.region = Arc::new(Region { described: None, ..(*next.region).clone() });
    next.sets = Arc::new(sets);
    Ok(Step::new(next, label))
}

fn add_handle(
    mut next: MeshDocument,
    kind: HandleKind,
    name: Option<String>,
    surface: &Surface<'_>,
) -> Result<Step<MeshDocument>, StudioError> {
    if next.handles.len() >= MAX_HANDLES {
        return Err(StudioError::request(format!("at most {MAX_HANDLES} handles")));
    }
    let vertices = unclaimed(&next, None, surface)?;
    let name = match name {
        Some(name) => checked_name(&name)?,
        None => free_name(&next, kind),
    };
    let label = format!("Make {name} of {} vertices", vertices.len());
    let track = track_of(kind, &vertices, surface);
    let mesh = MeshHandle { name, vertices, weight: None, track };
    next.handles.push(Arc::new(Handle { mesh, described: None }));
    next.active = Some(next.handles.len() - 1);
    next.selection = Arc::default();
    Ok(Step::new(next, label))
}

fn track_of(kind: HandleKind, vertices: &[u32], surface: &Surface<'_>) -> Track {
    match kind {
        HandleKind::Fixed => Track::Still,
        HandleKind::Rigid => keys::rigid(vertices, surface.rest),
        HandleKind::Free => keys::free(vertices, surface.rest),
    }
}

/// The selected vertices that are on the surface and in no handle but `except`.
fn unclaimed(document: &MeshDocument, except: Option<usize>, surface: &Surface<'_>) -> Result<Vec<u32>, StudioError> {
    if document.selection.is_empty() {
        return Err(StudioError::request("nothing is selected: select vertices first"));
    }
    let at = &surface.solvable.vertex_of_source;
    let mut free = vec![true; surface.solvable.mesh.vertex_count()];
    let others = document.handles.iter().enumerate().filter(|(k, _)| Some(*k) != except);
    for v in others.flat_map(|(_, h)| &h.mesh.vertices) {
        at[*v as usize].into_iter().for_each(|v| free[v as usize] = false);
    }
    let usable = |v: &u32| at[*v as usize].is_some_and(|v| free[v as usize]);
    let vertices: Vec<u32> = document.selection.iter().copied().filter(usable).collect();
    if vertices.is_empty() {
        return Err(StudioError::request("every selected vertex is in another handle, or on no triangle"));
    }
    Ok(vertices)
}

fn free_name(document: &MeshDocument, kind: HandleKind) -> String {
    let stem = match kind {
        HandleKind::Fixed => "fixed",
        HandleKind::Rigid => "grip",
        HandleKind::Free => "free",
    };
    let taken = |name: &String| document.handles.iter().any(|h| h.mesh.name == *name);
    (1..).map(|k| format!("{stem} {k}")).find(|name| !taken(name)).unwrap_or_else(|| stem.to_owned())
}

fn change_handle(mut next: MeshDocument, edit: Edit, surface: &Surface<'_>) -> Result<Step<MeshDocument>, StudioError> {
    let label = match edit {
        Edit::Activate { handle } => {
            let name = handle.map(|h| next.handle(h).map(|h| h.mesh.name.clone())).transpose()?;
            next.active = handle;
            return Ok(Step::new(next, name.map_or("No handle".to_owned(), |n| format!("Edit {n}"))).merged("activate"));
        }
        Edit::RenameHandle { handle, name } => {
            next.handle_mut(handle)?.mesh.name = checked_name(&name)?;
            format!("Rename handle to {}", name.trim())
        }
        Edit::DeleteHandles { handles } => return delete_handles(next, &handles),
        Edit::ReorderHandle { handle, to } => {
            next.handle(handle)?;
            next.handle(to)?;
            let moved = next.handles.remove(handle);
            let label = format!("Move {} in the list", moved.mesh.name);
            next.handles.insert(to, moved);
            next.active = Some(to);
            label
        }
        Edit::SetVertices { handle } => {
            let vertices = unclaimed(&next, Some(handle), surface)?;
            let of = next.handle_mut(handle)?;
            let kind = kind_of(&of.mesh.track);
            of.mesh.track = match (&of.mesh.track, kind) {
                // A rigid motion is one of whatever vertices.
                (track, HandleKind::Rigid | HandleKind::Fixed) => track.clone(),
                _ => track_of(kind, &vertices, surface),
            };
            of.mesh.vertices = vertices;
            of.described = None;
            format!("Vertices of {}", of.mesh.name)
        }
        Edit::SetKind { handle, kind } => {
            let of = next.handle_mut(handle)?;
            of.mesh.track = match (&of.mesh.track, kind) {
                (track, kind) if kind_of(track) == kind => track.clone(),
                (Track::Rigid { .. }, HandleKind::Free) => keys::freed(&of.mesh, surface.rest),
                _ => track_of(kind, &of.mesh.vertices, surface),
            };
            let word = match kind {
                HandleKind::Fixed => "fixed",
                HandleKind::Rigid => "rigid",
                HandleKind::Free => "free",
            };
            format!("{} is {word}", of.mesh.name)
        }
        Edit::SetWeight { handle, weight } => {
            if let Some(weight) = weight.filter(|w| !(*w > 0.0 && *w <= 1e12)) {
                return Err(StudioError::request(format!(
                    "the weight {weight} is invalid (expected above 0, up to 1e12)"
                )));
            }
            let of = next.handle_mut(handle)?;
            of.mesh.weight = weight;
            let of = &of.mesh.name;
            weight.map_or_else(|| format!("{of} is a hard constraint"), |w| format!("{of} has weight {w}"))
        }
        Edit::SetPivot { handle, pivot } => {
            let pivot = Motion::new(pivot, [1.0, 0.0, 0.0, 0.0], [1.0; 3])?.translation;
            let of = next.handle_mut(handle)?;
            let track = keys::pivoted(&of.mesh.track, pivot.into());
            of.mesh.track = track.ok_or_else(|| StudioError::request("only rigid handles have a pivot"))?;
            format!("Pivot of {}", of.mesh.name)
        }
        _ => return Err(StudioError::request("not an edit of a handle")),
    };
    Ok(Step::new(next, label))
}

/// How a track moves.
pub fn kind_of(track: &Track) -> HandleKind {
    match track {
        Track::Still => HandleKind::Fixed,
        Track::Rigid { .. } => HandleKind::Rigid,
        Track::Free { .. } => HandleKind::Free,
    }
}

fn delete_handles(mut next: MeshDocument, handles: &[usize]) -> Result<Step<MeshDocument>, StudioError> {
    let names: Result<Vec<String>, StudioError> =
        handles.iter().map(|h| Ok(next.handle(*h)?.mesh.name.clone())).collect();
    let label = match names?.as_slice() {
        [] => return Err(StudioError::request("no handle is named")),
        [one] => format!("Delete {one}"),
        many => format!("Delete {} handles", many.len()),
    };
    let kept = next.handles.iter().enumerate().filter(|(k, _)| !handles.contains(k));
    next.handles = kept.map(|(_, h)| h.clone()).collect();
    next.active = next.handles.len().checked_sub(1).map(|last| next.active.unwrap_or(0).min(last));
    Ok(Step::new(next, label))
}

fn drag(
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

fn set_key(mut next: MeshDocument, edit: Edit, surface: &Surface<'_>) -> Result<Step<MeshDocument>, StudioError> {
    let (handle, label) = match edit {
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

fn delete_keys(mut next: MeshDocument, ids: &[KeyId]) -> Result<Step<MeshDocument>, StudioError> {
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

fn move_keys(
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
    for handle in 0..next.handles.len() {
        let times: Vec<f64> = ids.iter().filter(|k| k.handle == handle).map(|k| k.time).collect();
        if !times.is_empty() {
            let moved = |t: f64| Some(if times.iter().any(|k| keys::same_time(*k, t)) { t + by } else { t });
            next.handle_mut(handle)?.mesh.track = keys::retimed(&base[handle].mesh.track, moved)?;
        }
    }
    let label = if ids.len() == 1 { "Move key".to_owned() } else { format!("Move {} keys", ids.len()) };
    Ok(Step::new(next, label).merged(format!("keys {number}")))
}

fn region(mut next: MeshDocument, edit: Edit, surface: &Surface<'_>) -> Result<Step<MeshDocument>, StudioError> {
    let count = surface.rest.len();
    let mut painted = false;
    let (outside, label) = match edit {
        Edit::PaintRegion { vertices, inside, stroke } => {
            painted = stroke == Some(true);
            let set = vertices::checked(vertices, count)?;
            let how = if inside { Combine::Remove } else { Combine::Add };
            (vertices::combined(&next.region.outside, set, how), "Paint region")
        }
        Edit::RegionFromSelection => {
            if next.selection.is_empty() {
                return Err(StudioError::request("nothing is selected: select the vertices that may move"));
            }
            (vertices::inverted(&next.selection, count), "Region from selection")
        }
        _ => (Vec::new(), "Region: everything"),
    };
    next.region = Arc::new(Region { outside, described: None });
    let step = Step::new(next, label);
    Ok(if painted { step.merged("region") } else { step })
}

fn set_option(next: MeshDocument, name: &str, value: &Value) -> Result<Step<MeshDocument>, StudioError> {
    let pipeline = next.pipeline.with_setting(name, value)?;
    let shown = if value.is_null() { json!("default") } else { value.clone() };
    let shown = shown.as_str().map_or_else(|| shown.to_string(), str::to_owned);
    Ok(Step::new(MeshDocument { pipeline, ..next }, format!("{name}: {shown}")))
}
