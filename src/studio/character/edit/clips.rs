//! Clips: keys of rotations over time, as quaternion splines.

use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::super::document::{CharacterDocument, ClipDocument, NamedCurve, Offsets, SAME_TIME};
use super::super::files::{POSE, UNKEYED};
use super::super::message::{Edit, InterpolationKind};
use super::super::solve;
use super::{Around, Edited, joint, name, refused, rotation};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_shape::character::clip::rotations;
use plumbline_shape::character::{Curve, Interpolation, Keys, Pose, Skeleton};

/// Maximum number of clips, and of keys of a curve.
const MAX_CLIPS: usize = 1000;
const MAX_KEYS: usize = 100_000;
/// Latest time of a key, s: a day.
const MAX_TIME: f64 = 86_400.0;

pub(super) fn apply(document: &CharacterDocument, edit: Edit, around: &mut Around<'_>) -> Edited {
    match edit {
        Edit::AddClip { name: text } => add(document, &clip_name(&text)?),
        Edit::SelectClip { name } => {
            position(document, &name)?;
            Ok(Step::new(
                CharacterDocument { clip: Some(name.clone()), ..document.clone() },
                format!("Show clip {name}"),
            ))
        }
        Edit::RenameClip { name: text } => rename(document, &clip_name(&text)?),
        Edit::RemoveClip { name } => remove(document, &name),
        Edit::RunWrites { frames } => run_writes(document, frames),
        Edit::Key { joints, time } => {
            let skeleton = around.skeleton(document)?;
            let elsewhere = around.time.is_some_and(|shown| (shown - time).abs() >= SAME_TIME);
            let pose = match document.shown_clip().filter(|_| elsewhere) {
                Some(clip) => solve::clip_pose(&skeleton, clip, time)?,
                None => around.pose(&skeleton),
            };
            key(document, &joints, time, &pose, &skeleton)
        }
        Edit::KeyUnkeyed { time } => key_unkeyed(document, time, &*around.skeleton(document)?),
        Edit::DiscardUnkeyed { time } => with_clip(document, "Discard what is not keyed", |clip| {
            clip.set_unkeyed(time, Offsets::new());
            Ok(())
        }),
        Edit::SetKey { joint: j, time, rotation: q } => {
            let skeleton = around.skeleton(document)?;
            let own = joint(&skeleton, j)?;
            let value = own.rest.rotation * rotation(q)?;
            let time = checked(time)?;
            let step = with_clip(document, &format!("Key of {}", own.name), |clip| {
                with_rotations(clip, &own.name, |keys| {
                    keys.set(time, value);
                    Ok(())
                })
            })?;
            Ok(step.merged(format!("key {j} {time}")))
        }
        Edit::MoveKeys { keys, by } => {
            let skeleton = around.skeleton(document)?;
            with_clip(document, "Move keys", |clip| {
                changed(clip, &skeleton, &keys, |edited, times| edited.shift(times, by))
            })
        }
        Edit::RemoveKeys { keys } => {
            let skeleton = around.skeleton(document)?;
            with_clip(document, "Remove keys", |clip| {
                changed(clip, &skeleton, &keys, |edited, times| {
                    edited.keys.retain(|k| !times.iter().any(|t| (t - k.0).abs() < SAME_TIME));
                    Ok(())
                })
            })
        }
        Edit::Interpolation { joints, kind } => {
            let skeleton = around.skeleton(document)?;
            interpolation(document, &joints, kind, &skeleton)
        }
        other => Err(StudioError::request(format!("this edit is not possible: {other:?}"))),
    }
}

fn position(document: &CharacterDocument, name: &str) -> Result<usize, StudioError> {
    let found = document.clips.iter().position(|clip| clip.name == name);
    found.ok_or_else(|| StudioError::request(format!("there is no clip {name:?}")))
}

fn add(document: &CharacterDocument, name: &str) -> Edited {
    if document.clips.len() >= MAX_CLIPS || position(document, name).is_ok() {
        return Err(StudioError::request(format!("clip {name:?} exists, or there are {MAX_CLIPS} clips")));
    }
    let mut clips = (*document.clips).clone();
    clips.push(Arc::new(ClipDocument { name: name.to_owned(), curves: Vec::new(), unkeyed: Vec::new() }));
    let clip = Some(name.to_owned());
    Ok(Step::new(CharacterDocument { clips: Arc::new(clips), clip, ..document.clone() }, format!("Add clip {name}")))
}

/// A name that a clip may have: clips in the skeleton file with others are poses.
fn clip_name(text: &str) -> Result<String, StudioError> {
    let name = name(text)?;
    if [POSE, UNKEYED].iter().any(|start| name.starts_with(start)) {
        return Err(StudioError::request(format!(
            "a clip is not named {name:?}: names with `{POSE}` and `{UNKEYED}` are those of poses"
        )));
    }
    Ok(name)
}

fn rename(document: &CharacterDocument, to: &str) -> Edited {
    if position(document, to).is_ok() {
        return Err(StudioError::request(format!("clip {to:?} exists")));
    }
    let mut step = with_clip(document, &format!("Rename the clip to {to}"), |clip| {
        to.clone_into(&mut clip.name);
        Ok(())
    })?;
    if document.clip.is_some() && document.pipeline.settings().clip == document.clip {
        step.document.pipeline = document.pipeline.with(&[("clip", to.into())])?;
    }
    step.document.clip = Some(to.to_owned());
    Ok(step)
}

fn remove(document: &CharacterDocument, name: &str) -> Edited {
    let at = position(document, name)?;
    let mut clips = (*document.clips).clone();
    clips.remove(at);
    let clip = document.clip.clone().filter(|c| c != name).or_else(|| clips.first().map(|c| c.name.clone()));
    let is_written = document.pipeline.settings().clip.as_deref() == Some(name);
    let pipeline = if is_written { document.pipeline.writing(None, 1)? } else { document.pipeline.clone() };
    let document = CharacterDocument { clips: Arc::new(clips), clip, pipeline, ..document.clone() };
    Ok(Step::new(document, format!("Remove clip {name}")))
}

/// What a run of the saved file writes: the clip that is shown, or the pose.
fn run_writes(document: &CharacterDocument, frames: Option<u32>) -> Edited {
    let (pipeline, label) = match frames {
        None => (document.pipeline.writing(None, 1)?, "A run writes the pose".to_owned()),
        Some(frames) => {
            let clip = document.shown_clip().ok_or_else(|| StudioError::request("no clip is chosen"))?;
            if clip.curves.is_empty() {
                return Err(StudioError::request(format!("clip {:?} has no keys", clip.name)));
            }
            let pipeline = document.pipeline.writing(Some(&clip.name), frames)?;
            (pipeline, format!("A run writes {frames} poses of {}", clip.name))
        }
    };
    Ok(Step::new(CharacterDocument { pipeline, ..document.clone() }, label))
}

/// What is not keyed at a time becomes keys; the same document where everything is.
fn key_unkeyed(document: &CharacterDocument, time: f64, skeleton: &Skeleton) -> Edited {
    let found = document.shown_clip().and_then(|clip| Some((clip, clip.unkeyed_at(time)?)));
    let Some((clip, unkeyed)) = found else { return Ok(Step::new(document.clone(), "Key the pose")) };
    let joints: Vec<u32> = unkeyed.joints.keys().filter_map(|name| skeleton.find(name)).collect();
    key(document, &joints, time, &solve::clip_pose(skeleton, clip, time)?, skeleton)
}

/// The document with the shown clip changed.
fn with_clip(
    document: &CharacterDocument,
    label: &str,
    change: impl FnOnce(&mut ClipDocument) -> Result<(), StudioError>,
) -> Edited {
    let name = document.clip.as_deref().ok_or_else(|| StudioError::request("no clip is chosen"))?;
    let at = position(document, name)?;
    let mut clips = (*document.clips).clone();
    change(Arc::make_mut(&mut clips[at]))?;
    Ok(Step::new(CharacterDocument { clips: Arc::new(clips), ..document.clone() }, label))
}

/// A pose becomes keys of rotations, and of translations where a joint has moved or has such keys.
fn key(document: &CharacterDocument, joints: &[u32], time: f64, pose: &Pose, skeleton: &Skeleton) -> Edited {
    let time = checked(time)?;
    let with = if document.clip.is_some() { document.clone() } else { add(document, "clip 1")?.document };
    let label =
        if joints.len() == 1 { format!("Key {}", joint(skeleton, joints[0])?.name) } else { "Key the pose".to_owned() };
    with_clip(&with, &label, |clip| {
        let mut left = clip.unkeyed_at(time).map(|pose| pose.joints.clone()).unwrap_or_default();
        for &j in joints {
            let own = joint(skeleton, j)?;
            let local = pose.locals[j as usize];
            with_rotations(clip, &own.name, |keys| {
                keys.set(time, local.rotation);
                Ok(())
            })?;
            let is_keyed = |c: &Arc<NamedCurve>| c.joint == own.name && matches!(c.curve, Curve::Translation(_));
            if local.translation != own.rest.translation || clip.curves.iter().any(is_keyed) {
                set_translation(clip, &own.name, time, local.translation, own.rest.translation)?;
            }
            left.remove(&own.name);
        }
        clip.set_unkeyed(time, left);
        Ok(())
    })
}

fn checked(time: f64) -> Result<f64, StudioError> {
    if (0.0..=MAX_TIME).contains(&time) {
        Ok(time)
    } else {
        Err(StudioError::request(format!("time {time} s is not within 0 to {MAX_TIME}")))
    }
}

/// The keys of a joint's rotation, as they are edited.
struct RotationEdit {
    keys: Vec<(f64, UnitQuaternion<f64>)>,
    interpolation: Interpolation<4>,
}

/// Changes the keys of a joint's rotation. Without keys there is no curve.
fn with_rotations(
    clip: &mut ClipDocument,
    joint: &str,
    change: impl FnOnce(&mut RotationEdit) -> Result<(), StudioError>,
) -> Result<(), StudioError> {
    let is_own = |c: &Arc<NamedCurve>| c.joint == joint && matches!(c.curve, Curve::Rotation(_));
    let known = clip.curves.iter().find(|c| is_own(c)).map(|c| c.curve.clone());
    let mut edited = RotationEdit::of(known.as_ref());
    change(&mut edited)?;
    if edited.keys.len() > MAX_KEYS {
        return Err(StudioError::request(format!("{joint} would have more than {MAX_KEYS} keys")));
    }
    clip.curves.retain(|c| !is_own(c));
    let (times, values): (Vec<f64>, Vec<_>) = edited.keys.into_iter().unzip();
    if !times.is_empty() {
        let curve = Curve::Rotation(rotations(times, &values, edited.interpolation).map_err(refused)?);
        clip.curves.push(Arc::new(NamedCurve { joint: joint.to_owned(), curve }));
    }
    Ok(())
}

impl RotationEdit {
    fn of(curve: Option<&Curve>) -> Self {
        let Some(Curve::Rotation(curve)) = curve else {
            return Self { keys: Vec::new(), interpolation: Interpolation::Smooth };
        };
        let keys = curve.keys().times().iter().enumerate().map(|(k, t)| (*t, curve.key(k))).collect();
        // Tangents of a file hold for its keys: edited curves are splines through theirs.
        let interpolation = match curve.keys().interpolation() {
            Interpolation::Step => Interpolation::Step,
            Interpolation::Linear => Interpolation::Linear,
            Interpolation::Smooth | Interpolation::Cubic { .. } => Interpolation::Smooth,
        };
        Self { keys, interpolation }
    }

    fn set(&mut self, time: f64, value: UnitQuaternion<f64>) {
        self.keys.retain(|k| (k.0 - time).abs() >= SAME_TIME);
        let at = self.keys.partition_point(|k| k.0 < time);
        self.keys.insert(at, (time, value));
    }

    fn shift(&mut self, times: &[f64], by: f64) -> Result<(), StudioError> {
        let is_moved = |t: f64| times.iter().any(|m| (m - t).abs() < SAME_TIME);
        let (moved, stay): (Vec<_>, Vec<_>) = self.keys.drain(..).partition(|k| is_moved(k.0));
        self.keys = stay;
        for (time, value) in moved {
            self.set(checked((time + by).max(0.0))?, value);
        }
        Ok(())
    }
}

fn set_translation(
    clip: &mut ClipDocument,
    joint: &str,
    time: f64,
    value: Vector3<f64>,
    rest: Vector3<f64>,
) -> Result<(), StudioError> {
    let is_own = |c: &Arc<NamedCurve>| c.joint == joint && matches!(c.curve, Curve::Translation(_));
    let known = clip.curves.iter().find(|c| is_own(c)).cloned();
    let mut keys: Vec<(f64, [f64; 3])> = match known.as_ref().map(|c| &c.curve) {
        Some(Curve::Translation(keys)) => keys.times().iter().copied().zip(keys.values().iter().copied()).collect(),
        // The first key that moves: at rest until then.
        _ if time > 0.0 => vec![(0.0, rest.into())],
        _ => Vec::new(),
    };
    keys.retain(|k| (k.0 - time).abs() >= SAME_TIME);
    keys.insert(keys.partition_point(|k| k.0 < time), (time, value.into()));
    let (times, values): (Vec<f64>, Vec<[f64; 3]>) = keys.into_iter().unzip();
    let curve = Keys::new(times, values, Interpolation::Smooth).map_err(refused)?;
    clip.curves.retain(|c| !is_own(c));
    clip.curves.push(Arc::new(NamedCurve { joint: joint.to_owned(), curve: Curve::Translation(curve) }));
    Ok(())
}

/// Changes the curves of keys that are named by joint and time.
fn changed(
    clip: &mut ClipDocument,
    skeleton: &Skeleton,
    keys: &[(u32, f64)],
    change: impl Fn(&mut RotationEdit, &[f64]) -> Result<(), StudioError>,
) -> Result<(), StudioError> {
    let mut joints: Vec<u32> = keys.iter().map(|k| k.0).collect();
    joints.sort_unstable();
    joints.dedup();
    for j in joints {
        let times: Vec<f64> = keys.iter().filter(|k| k.0 == j).map(|k| k.1).collect();
        with_rotations(clip, &joint(skeleton, j)?.name, |edited| change(edited, &times))?;
    }
    Ok(())
}

fn interpolation(document: &CharacterDocument, joints: &[u32], kind: InterpolationKind, skeleton: &Skeleton) -> Edited {
    let kind = match kind {
        InterpolationKind::Step => Interpolation::Step,
        InterpolationKind::Linear => Interpolation::Linear,
        InterpolationKind::Spline => Interpolation::Smooth,
    };
    let names = joints.iter().map(|j| joint(skeleton, *j).map(|j| j.name.clone())).collect::<Result<Vec<_>, _>>()?;
    with_clip(document, "Interpolation of keys", |clip| {
        let keyed = clip.curves.iter().filter(|c| matches!(c.curve, Curve::Rotation(_))).map(|c| c.joint.clone());
        let chosen: Vec<String> = keyed.filter(|name| names.is_empty() || names.contains(name)).collect();
        for name in chosen {
            with_rotations(clip, &name, |edited| {
                edited.interpolation = kind.clone();
                Ok(())
            })?;
        }
        Ok(())
    })
}

/// A rotation from rest as the page has it.
pub(in super::super) fn from_rest(rest: &UnitQuaternion<f64>, value: &UnitQuaternion<f64>) -> [f64; 4] {
    let q: Quaternion<f64> = (rest.inverse() * value).into_inner();
    [q.i, q.j, q.k, q.w]
}
