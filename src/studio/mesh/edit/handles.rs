//! Edits of handles: which vertices they have, and how they move.

use std::sync::Arc;

use super::{Surface, checked_name};
use crate::error::StudioError;
use crate::mesh::document::{Handle, MAX_HANDLES, MeshDocument};
use crate::mesh::keys::{self, Motion};
use crate::mesh::message::{Edit, HandleKind};
use crate::workspace::Step;
use plumbline_shape::surface::handle_file::{MeshHandle, Track};

pub(super) fn add(
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
    // One of more names than there are handles is free.
    let mut names = (1..=document.handles.len() + 1).map(|k| format!("{stem} {k}"));
    names.find(|name| !taken(name)).unwrap_or_else(|| stem.to_owned())
}

pub(super) fn change(
    mut next: MeshDocument,
    edit: Edit,
    surface: &Surface<'_>,
) -> Result<Step<MeshDocument>, StudioError> {
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
