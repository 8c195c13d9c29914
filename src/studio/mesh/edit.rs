//! Edits: from a document to another one.

mod handles;
mod motion;
mod selection;

use std::sync::Arc;

use nalgebra::Point3;
use serde_json::{Value, json};

use super::document::{Handle, MAX_NAME, MeshDocument, Region};
use super::keys::{Motion, checked_time};
use super::message::Edit;
use super::vertices::{self, Combine};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_shape::mesh::VertexGraph;
use plumbline_shape::surface::SolvableMesh;

pub use handles::kind_of;

/// What edits are made on.
#[derive(Clone, Copy, Debug)]
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
        | Edit::SelectHandle { .. } => selection::select(next, edit, surface),
        Edit::NameSelection { .. } | Edit::RenameSet { .. } | Edit::DeleteSet { .. } => selection::sets(next, edit),
        Edit::AddHandle { kind, name } => handles::add(next, kind, name, surface),
        Edit::Activate { .. }
        | Edit::RenameHandle { .. }
        | Edit::DeleteHandles { .. }
        | Edit::ReorderHandle { .. }
        | Edit::SetVertices { .. }
        | Edit::SetKind { .. }
        | Edit::SetWeight { .. }
        | Edit::SetPivot { .. } => handles::change(next, edit, surface),
        Edit::Drag { handle, gesture: number, time, translation, rotation, scale } => {
            let motion = Motion::new(translation, rotation, scale)?;
            motion::drag(next, (handle, number, checked_time(time)?), &motion, surface, gesture)
        }
        Edit::Place { .. } | Edit::Reset { .. } | Edit::AddKey { .. } | Edit::SetInterpolation { .. } => {
            motion::set_key(next, &edit, surface)
        }
        Edit::DeleteKeys { keys } => motion::delete_keys(next, &keys),
        Edit::MoveKeys { keys, by, gesture: number } => motion::move_keys(next, &keys, by, number, gesture),
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

fn checked_name(name: &str) -> Result<String, StudioError> {
    let name = name.trim();
    if name.is_empty() || name.len() > MAX_NAME {
        return Err(StudioError::request(format!("a name has 1 to {MAX_NAME} characters")));
    }
    Ok(name.to_owned())
}
