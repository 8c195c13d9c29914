//! Joints made by hand.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Unit, Vector3};

use super::super::document::{
    CharacterDocument, ClipDocument, NamedCurve, Same, SkeletonSource, Template, Trained, WeightSource,
};
use super::super::files::{MAX_MODEL_BYTES, MAX_SIDE_BYTES};
use super::super::message::{Edit as Message, Limits as LimitsMessage};
use super::{Around, Edited, MAX_JOINTS, joint, name, point, refused, vector};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_num::run::Run;
use plumbline_num::spatial::Ray;
use plumbline_shape::character::edit::{Edit, Edited as Applied, Plane, RigEditor, volume_center};
use plumbline_shape::character::io::{Rig, read_rig};
use plumbline_shape::character::regression::SkinModel;
use plumbline_shape::character::{Limits, Skeleton, WeightsFile};
use plumbline_shape::mesh::ReadLimits;

pub(super) fn apply(document: &CharacterDocument, message: Message, around: &mut Around<'_>) -> Edited {
    if let Message::Import { path } = message {
        return import(document, &path, around);
    }
    let merge = match &message {
        Message::Move { joint, .. } => Some(format!("move {joint}")),
        _ => None,
    };
    let skeleton = around.rigs.skeleton(&document.skeleton);
    if skeleton.is_none() && matches!(document.skeleton, SkeletonSource::Found(_)) {
        return Err(StudioError::request("the skeleton is still being extracted"));
    }
    let (label, edits) = edits(message, skeleton.as_deref(), around)?;
    let mut editor = Editor { rig: RigEditor::new(skeleton.as_deref()), document: document.clone() };
    // Edits name joints by their numbers before the first of them.
    let mut now: Vec<Option<u32>> = (0..editor.rig.joints().len() as u32).map(Some).collect();
    for edit in edits {
        let edited = editor.apply(renumbered(edit, &now))?;
        for j in &mut now {
            *j = j.and_then(|j| edited.joint_of.get(j as usize).copied().flatten());
        }
    }
    let mut document = editor.document;
    document.skeleton = editor.rig.skeleton().map_or(SkeletonSource::None, |s| SkeletonSource::Made(Arc::new(s)));
    let step = Step::new(document, label);
    Ok(match merge {
        Some(key) => step.merged(key),
        None => step,
    })
}

/// A rig, and the rest of the document, which follows its joints.
struct Editor {
    rig: RigEditor,
    document: CharacterDocument,
}

impl Editor {
    fn apply(&mut self, edit: Edit) -> Result<Applied, StudioError> {
        let renamed = match &edit {
            Edit::Rename { joint, name } => {
                self.rig.joints().get(*joint as usize).map(|j| (j.name.clone(), name.clone()))
            }
            _ => None,
        };
        let edited = self.rig.apply(edit).map_err(refused)?;
        if self.rig.joints().len() > MAX_JOINTS {
            return Err(StudioError::request(format!("more than {MAX_JOINTS} joints")));
        }
        if let Some((from, to)) = renamed {
            rename(&mut self.document, &from, &to);
        }
        if let WeightSource::Given(weights, options) = &self.document.weights {
            if self.rig.joints().is_empty() {
                self.document.weights = WeightSource::Computed(*options);
            } else if !edited.keeps_indices() {
                let carried = edited.carried(weights).map_err(refused)?;
                self.document.weights = WeightSource::Given(Arc::new(carried), *options);
            }
        }
        Ok(edited)
    }
}

/// An edit of several joints with the numbers that they have now; unknown ones stay, and are refused.
fn renumbered(edit: Edit, now: &[Option<u32>]) -> Edit {
    let number = |j: u32| now.get(j as usize).copied().flatten().unwrap_or(j);
    match edit {
        Edit::Dissolve { joint } => Edit::Dissolve { joint: number(joint) },
        Edit::Remove { joint } => Edit::Remove { joint: number(joint) },
        other => other,
    }
}

/// Everything that names a joint follows its name.
fn rename(document: &mut CharacterDocument, from: &str, to: &str) {
    let new = |name: &mut String| {
        if name == from {
            to.clone_into(name);
        }
    };
    let moved = |offsets: &mut super::super::document::Offsets| {
        if let Some(offset) = offsets.remove(from) {
            offsets.insert(to.to_owned(), offset);
        }
    };
    let pose = Arc::make_mut(&mut document.pose);
    moved(&mut pose.joints);
    pose.locked.iter_mut().for_each(new);
    for target in &mut pose.targets {
        new(&mut target.joint);
        target.pole.iter_mut().flatten().for_each(new);
    }
    for pose in Arc::make_mut(&mut document.poses).values_mut() {
        moved(Arc::make_mut(pose));
    }
    for clip in Arc::make_mut(&mut document.clips) {
        if clip.curves.iter().any(|c| c.joint == from) || clip.unkeyed.iter().any(|p| p.joints.contains_key(from)) {
            let clip = Arc::make_mut(clip);
            clip.curves.iter_mut().for_each(|c| new(&mut Arc::make_mut(c).joint));
            clip.unkeyed.iter_mut().for_each(|pose| moved(&mut pose.joints));
        }
    }
}

/// The library's edits of a message, and what the history says.
fn edits(
    message: Message,
    skeleton: Option<&Skeleton>,
    around: &Around<'_>,
) -> Result<(String, Vec<Edit>), StudioError> {
    let named = |j: u32| match skeleton {
        Some(skeleton) => joint(skeleton, j).map(|j| j.name.clone()),
        None => Err(StudioError::request("there is no skeleton yet")),
    };
    let one = |label: String, edit: Edit| Ok((label, vec![edit]));
    match message {
        Message::AddAlong { origin, direction, parent } => {
            let direction = Unit::try_new(vector(direction)?, 0.0);
            let direction = direction.ok_or_else(|| StudioError::request("the ray has no direction"))?;
            let ray = Ray::new(&point(origin)?, &direction);
            let at = volume_center(around.mesh, &ray);
            let at = at.ok_or_else(|| StudioError::request("the ray does not go through the surface"))?;
            let name = free_name(skeleton, "joint");
            one(format!("Add {name}"), Edit::Add { name, parent, at })
        }
        Message::Add { at, parent, name: given } => {
            let name = given.map_or_else(|| Ok(free_name(skeleton, "joint")), |n| name(&n))?;
            one(format!("Add {name}"), Edit::Add { name, parent, at: point(at)? })
        }
        Message::Extrude { joint, at, name: given } => {
            named(joint)?;
            let name = given.map_or_else(|| Ok(free_name(skeleton, "joint")), |n| name(&n))?;
            one(format!("Extrude {name}"), Edit::Extrude { joint, name, at: point(at)? })
        }
        Message::Split { joint, fraction } => {
            let name = free_name(skeleton, &named(joint)?);
            one(format!("Split: {name}"), Edit::Split { joint, fraction, name })
        }
        Message::Dissolve { joints } => several("Dissolve", &joints, &named, |joint| Edit::Dissolve { joint }),
        Message::Remove { joints } => {
            // What is below one that goes as well goes with it.
            let joints: Vec<u32> = joints.iter().copied().filter(|j| !is_below(skeleton, *j, &joints)).collect();
            several("Delete", &joints, &named, |joint| Edit::Remove { joint })
        }
        Message::Reparent { joints, parent } => {
            let edits = joints.iter().map(|&joint| Edit::Reparent { joint, parent }).collect();
            let names = joints.iter().map(|j| named(*j)).collect::<Result<Vec<_>, _>>()?;
            Ok((format!("Parent of {}", names.join(", ")), edits))
        }
        Message::Rename { joint, name: to } => {
            let from = named(joint)?;
            let name = name(&to)?;
            one(format!("Rename {from} to {name}"), Edit::Rename { joint, name })
        }
        Message::Mirror { joint } => {
            let label = format!("Mirror {}", named(joint)?);
            one(label, Edit::Mirror { joint, plane: sagittal(around) })
        }
        Message::Move { joint, to, with_children } => {
            one(format!("Move {}", named(joint)?), Edit::Move { joint, to: point(to)?, with_children })
        }
        Message::Roll { joint, angle } if angle.is_finite() => {
            one(format!("Roll {}", named(joint)?), Edit::Roll { joint, angle })
        }
        Message::Limit { joint, limits } => {
            let limits = limits.map(|l| library_limits(&l)).transpose()?;
            one(format!("Limits of {}", named(joint)?), Edit::Limit { joint, limits })
        }
        other => Err(StudioError::request(format!("this edit is not possible: {other:?}"))),
    }
}

/// Several edits of one kind, from the last joint to the first.
fn several(
    what: &str,
    joints: &[u32],
    named: &impl Fn(u32) -> Result<String, StudioError>,
    edit: impl Fn(u32) -> Edit,
) -> Result<(String, Vec<Edit>), StudioError> {
    let mut sorted = joints.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let names = sorted.iter().map(|j| named(*j)).collect::<Result<Vec<_>, _>>()?;
    let label = match names.as_slice() {
        [] => return Err(StudioError::request("no joint is chosen")),
        [name] => format!("{what} {name}"),
        _ => format!("{what} {} joints", names.len()),
    };
    Ok((label, sorted.into_iter().rev().map(edit).collect()))
}

fn is_below(skeleton: Option<&Skeleton>, joint: u32, others: &[u32]) -> bool {
    let Some(skeleton) = skeleton else { return false };
    let parent = |j: u32| skeleton.joints().get(j as usize).and_then(|j| j.parent);
    std::iter::successors(parent(joint), |j| parent(*j)).any(|above| others.contains(&above))
}

/// A name that no joint has: `base`, `base 2`, …
fn free_name(skeleton: Option<&Skeleton>, base: &str) -> String {
    let is_free = |name: &String| skeleton.is_none_or(|s| s.find(name).is_none());
    let mut names = (1..).map(|n| if n == 1 { base.to_owned() } else { format!("{base} {n}") });
    names.find(is_free).unwrap_or_default()
}

/// The plane between left and right: through the center of the mesh, across x.
pub(super) fn sagittal(around: &Around<'_>) -> Plane {
    let (low, high) = around.mesh.bounding_box().unwrap_or_default();
    Plane { point: nalgebra::center(&low, &high), normal: Vector3::x_axis() }
}

pub(in super::super) fn library_limits(l: &LimitsMessage) -> Result<Limits, StudioError> {
    let unit = |v: [f64; 3]| {
        Unit::try_new(vector(v)?, 1e-12).ok_or_else(|| StudioError::request(format!("{v:?} is no direction")))
    };
    let axis = unit(l.axis)?;
    // Perpendicular up to rounding, as the library asks.
    let across = unit(l.across)?;
    let across = Unit::try_new(across.into_inner() - axis.into_inner() * axis.dot(&across), 1e-6);
    let across = across.ok_or_else(|| StudioError::request("`across` is along `axis`"))?;
    Ok(Limits { axis, across, swing: l.swing, twist: l.twist })
}

/// Skeleton and movements of a file, weights, or a trained skin: what it is shows its ending, and of JSON its text.
fn import(document: &CharacterDocument, path: &str, around: &Around<'_>) -> Edited {
    let path = around.files.confined(Path::new(path))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    if is("skin") {
        return import_model(document, &path, name, around);
    }
    if is("json") {
        let text = around.files.read(&path, MAX_SIDE_BYTES)?.unwrap_or_default();
        if let Ok(weights) = WeightsFile::parse(&String::from_utf8_lossy(&text)) {
            return import_weights(document, &weights, &path, around);
        }
    }
    import_rig(document, &path, &name, around)
}

/// Skeleton and movements: the movements alone where the skeleton has all their joints.
fn import_rig(document: &CharacterDocument, path: &Path, name: &str, around: &Around<'_>) -> Edited {
    let rig = read_rig(path, &ReadLimits::default(), &Run::default()).map_err(|e| unreadable(path, &e))?;
    let current = around.rigs.skeleton(&document.skeleton);
    let known = |s: &Arc<Skeleton>| rig.skeleton.joints().iter().all(|j| s.find(&j.name).is_some());
    let mut document = document.clone();
    let label = if !rig.clips.is_empty() && current.as_ref().is_some_and(known) {
        format!("Movements of {name}")
    } else {
        document.skeleton = SkeletonSource::Made(Arc::new(rig.skeleton.clone()));
        document.weights = WeightSource::Computed(*document.weights.options());
        format!("Skeleton of {name}")
    };
    add_clips(&mut document, &rig);
    Ok(Step::new(document, label))
}

/// The skeleton of a file as a template, fitted to the surface.
pub(super) fn template_file(document: &CharacterDocument, path: &str, around: &Around<'_>) -> Edited {
    let path = around.files.confined(Path::new(path))?;
    let rig = read_rig(&path, &ReadLimits::default(), &Run::default()).map_err(|e| unreadable(&path, &e))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(super::fitted(document, Template { name, skeleton: rig.skeleton }))
}

fn import_weights(document: &CharacterDocument, file: &WeightsFile, path: &Path, around: &Around<'_>) -> Edited {
    let weights = file.for_skeleton(&*around.skeleton(document)?).map_err(|e| unreadable(path, &e))?;
    let (rows, vertices) = (weights.vertex_count(), around.mesh.vertex_count());
    if rows != vertices {
        return Err(unreadable(path, &format!("has weights of {rows} vertices, and the mesh has {vertices}")));
    }
    let weights = WeightSource::Given(Arc::new(weights), *document.weights.options());
    Ok(Step::new(CharacterDocument { weights, ..document.clone() }, "Import weights"))
}

/// A trained skin, where it is of this mesh and skeleton.
fn import_model(document: &CharacterDocument, path: &Path, name: String, around: &Around<'_>) -> Edited {
    let skeleton = around.skeleton(document)?;
    let bytes = around.files.read(path, MAX_MODEL_BYTES)?.unwrap_or_default();
    let model = SkinModel::from_bytes(&bytes).map_err(|e| unreadable(path, &e))?;
    model.check(around.mesh, &skeleton).map_err(|e| unreadable(path, &e))?;
    let label = format!("Import the trained skin {name}");
    let model = Some(Same(Arc::new(Trained { file: None, name, model })));
    Ok(Step::new(CharacterDocument { model, ..document.clone() }, label))
}

/// A chosen file is in a folder that the user does not know: its name says which it is.
fn unreadable(path: &Path, why: &dyn std::fmt::Display) -> StudioError {
    let (whole, name) = (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
    let why = why.to_string();
    let why = why.strip_prefix(&format!("{whole}: ")).unwrap_or(&why);
    StudioError::Request(format!("{name}: {why}"))
}

/// Adds the clips of a rig; the last one is shown.
pub(in super::super) fn add_clips(document: &mut CharacterDocument, rig: &Rig) {
    let clips = Arc::make_mut(&mut document.clips);
    for clip in &rig.clips {
        let taken = |name: &str| clips.iter().any(|c| c.name == name);
        let base = if clip.name().is_empty() { "clip" } else { clip.name() };
        let mut names = (1..).map(|n| if n == 1 { base.to_owned() } else { format!("{base} {n}") });
        let name = names.find(|name| !taken(name)).unwrap_or_default();
        let curve = |track: &plumbline_shape::character::Track| {
            let joint = rig.skeleton.joints()[track.joint as usize].name.clone();
            Arc::new(NamedCurve { joint, curve: track.curve.clone() })
        };
        let curves = clip.tracks().iter().map(curve).collect();
        document.clip = Some(name.clone());
        clips.push(Arc::new(ClipDocument { name, curves, unkeyed: Vec::new() }));
    }
}
