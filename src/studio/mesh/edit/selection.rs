//! Edits of the selection and of named sets.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Surface, checked_name};
use crate::error::StudioError;
use crate::mesh::document::{MAX_SETS, MeshDocument, NamedSet, Region};
use crate::mesh::message::Edit;
use crate::mesh::vertices::{self, Combine, Follow};
use crate::workspace::Step;

/// More rings than any mesh has at once.
const MAX_RINGS: u32 = 10_000;

pub(super) fn select(
    mut next: MeshDocument,
    edit: Edit,
    surface: &Surface<'_>,
) -> Result<Step<MeshDocument>, StudioError> {
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
            let count = rings.unsigned_abs().min(MAX_RINGS) as usize;
            let how = if rings < 0 { Follow::Shrink(count) } else { Follow::Grow(count) };
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

pub(super) fn sets(mut next: MeshDocument, edit: Edit) -> Result<Step<MeshDocument>, StudioError> {
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
