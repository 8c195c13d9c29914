//! The pose: forward and inverse kinematics, targets, the library.
//!
//! A drag solves from the pose that is shown and keeps what it finds as the pose before targets, so that forward and inverse kinematics
//! go on from each other and the saved pose is the one that was seen. Where a clip is shown, what differs from its keys is kept with the
//! clip at the time that is shown, until it is keyed or discarded.

use std::sync::Arc;

use nalgebra::{Point3, Unit, UnitQuaternion, Vector3};

use super::super::document::{CharacterDocument, NamedTarget, PoseDocument, differing, offsets, pose_of};
use super::super::files::rigged;
use super::super::message::{Edit, Target as TargetMessage, TargetKind};
use super::super::solve::{keyed_pose, options, targets};
use super::{Around, Edited, joint, name, point, refused, rotation, vector};
use crate::error::StudioError;
use crate::workspace::Step;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;
use plumbline_shape::character::ik::{Goal, MAX_TARGETS, Target, limb_chain, solve, within_limits};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::{Pose, Skeleton};

/// Maximum number of poses in the library.
const MAX_POSES: usize = 1000;

pub(super) fn apply(document: &CharacterDocument, edit: Edit, around: &mut Around<'_>) -> Edited {
    let skeleton = around.skeleton(document)?;
    let at = Posing { document, skeleton: &skeleton, shown: around.pose(&skeleton), time: around.time };
    match edit {
        Edit::Rotate { joint, rotation: q } => at.rotate(joint, rotation(q)?),
        Edit::Translate { joint, translation } => at.translate(joint, vector(translation)?),
        Edit::Drag { joint, point: p, to } => at.drag(joint, point(p)?, point(to)?),
        Edit::Pin { joint, orientation } => at.pin(joint, orientation),
        Edit::AddTarget { target } => at.with_targets("Add a target", |all| {
            all.push(NamedTarget::of(at.skeleton, at.target(&target)?));
            Ok(())
        }),
        Edit::SetTarget { index, target } => at.set_target(index, &target),
        Edit::RemoveTarget { index } => at.with_targets("Remove a target", |all| {
            let known = index < all.len();
            known.then(|| all.remove(index)).map(drop).ok_or_else(|| no_target(index))
        }),
        Edit::ResetPose { joints } => at.reset(joints.as_deref()),
        Edit::MirrorPose => at.posed(&at.mirrored(&at.shown)?, "Mirror the pose"),
        Edit::PastePose { text, mirrored, joints } => {
            let character = rigged(document, around.model, &skeleton)?;
            let pasted = TargetPose::parse(&text, &character).map_err(|e| StudioError::request(e.to_string()))?;
            let pose = if mirrored { at.mirrored(&pasted.start)? } else { pasted.start };
            at.paste(&pose, joints.as_deref(), if mirrored { "Paste the mirrored pose" } else { "Paste the pose" })
        }
        Edit::TakePose => Posing { time: None, ..at }.taken("Take the pose of the clip"),
        Edit::Lock { joints, locked } => at.lock(&joints, locked),
        Edit::BakePose => at.with_targets("Bake the pose", |all| {
            all.clear();
            Ok(())
        }),
        Edit::StorePose { name: text } => at.store(&name(&text)?),
        Edit::ApplyPose { name } => {
            let joints = document.poses.get(&name).ok_or_else(|| no_pose(&name))?;
            at.posed(&pose_of(&skeleton, joints), format!("Apply pose {name}"))
        }
        Edit::RemovePose { name } => {
            let mut poses = (*document.poses).clone();
            poses.remove(&name).ok_or_else(|| no_pose(&name))?;
            Ok(Step::new(
                CharacterDocument { poses: Arc::new(poses), ..document.clone() },
                format!("Remove pose {name}"),
            ))
        }
        other => Err(StudioError::request(format!("this edit is not possible: {other:?}"))),
    }
}

fn no_target(index: usize) -> StudioError {
    StudioError::request(format!("there is no target {index}"))
}

fn no_pose(name: &str) -> StudioError {
    StudioError::request(format!("the library has no pose {name:?}"))
}

fn with_pose(document: &CharacterDocument, pose: PoseDocument) -> CharacterDocument {
    CharacterDocument { pose: Arc::new(pose), ..document.clone() }
}

/// The document, its skeleton and the pose that is shown.
struct Posing<'a> {
    document: &'a CharacterDocument,
    skeleton: &'a Arc<Skeleton>,
    shown: Pose,
    /// The time in the clip, where the pose of one is shown.
    time: Option<f64>,
}

impl Posing<'_> {
    /// The document with this pose: of the clip at the time that is shown, else before its targets.
    fn posed(&self, pose: &Pose, label: impl Into<String>) -> Edited {
        let (Some(time), Some(clip)) = (self.time, self.document.shown_clip()) else {
            let joints = offsets(self.skeleton, pose);
            let pose = PoseDocument { joints, ..(*self.document.pose).clone() };
            return Ok(Step::new(with_pose(self.document, pose), label));
        };
        let unkeyed = differing(self.skeleton, pose, &keyed_pose(self.skeleton, clip, time)?);
        let mut clips = (*self.document.clips).clone();
        for clip in clips.iter_mut().filter(|c| Some(&c.name) == self.document.clip.as_ref()) {
            Arc::make_mut(clip).set_unkeyed(time, unkeyed.clone());
        }
        Ok(Step::new(CharacterDocument { clips: Arc::new(clips), ..self.document.clone() }, label))
    }

    /// The key of steps that are one: of the same joint, at the same time.
    fn key(&self, what: &str, j: u32) -> String {
        self.time.map_or_else(|| format!("{what} {j}"), |time| format!("{what} {j} at {time}"))
    }

    /// The pose that is shown becomes the one before targets.
    fn taken(&self, label: &str) -> Edited {
        self.posed(&self.shown, label)
    }

    /// Left and right exchanged, across the x axis.
    fn mirrored(&self, pose: &Pose) -> Result<Pose, StudioError> {
        pose.mirrored(self.skeleton, &Vector3::x_axis()).map_err(refused)
    }

    /// The transforms of some joints, or all, of another pose.
    fn paste(&self, pose: &Pose, joints: Option<&[u32]>, label: &str) -> Edited {
        let Some(joints) = joints else { return self.posed(&within_limits(self.skeleton, pose), label) };
        let mut mixed = self.shown.clone();
        for &j in joints {
            joint(self.skeleton, j)?;
            mixed.locals[j as usize] = pose.locals[j as usize];
        }
        self.posed(&within_limits(self.skeleton, &mixed), format!("{label} for {} joints", joints.len()))
    }

    fn lock(&self, joints: &[u32], locked: bool) -> Edited {
        let names = joints.iter().map(|j| self.name(*j)).collect::<Result<Vec<_>, _>>()?;
        let label = match names.as_slice() {
            [] => return Err(StudioError::request("no joint is chosen")),
            [name] => format!("{} {name}", if locked { "Lock" } else { "Unlock" }),
            _ => format!("{} {} joints", if locked { "Lock" } else { "Unlock" }, names.len()),
        };
        let mut pose = (*self.document.pose).clone();
        pose.locked.retain(|name| !names.contains(&name.as_str()));
        if locked {
            pose.locked.extend(names.iter().map(|name| (*name).to_owned()));
        }
        Ok(Step::new(with_pose(self.document, pose), label))
    }

    fn name(&self, j: u32) -> Result<&str, StudioError> {
        joint(self.skeleton, j).map(|j| j.name.as_str())
    }

    fn changed(&self, j: u32, change: impl Fn(&mut Trs)) -> Result<Pose, StudioError> {
        joint(self.skeleton, j)?;
        let mut pose = self.shown.clone();
        change(&mut pose.locals[j as usize]);
        Ok(within_limits(self.skeleton, &pose))
    }

    fn rotate(&self, j: u32, rotation: UnitQuaternion<f64>) -> Edited {
        let rest = joint(self.skeleton, j)?.rest;
        let pose = self.changed(j, |local| local.rotation = rest.rotation * rotation)?;
        Ok(self.posed(&pose, format!("Rotate {}", self.name(j)?))?.merged(self.key("rotate", j)))
    }

    /// `translation`: of the joint from its position at rest, in the axes of the model.
    fn translate(&self, j: u32, translation: Vector3<f64>) -> Edited {
        let own = joint(self.skeleton, j)?;
        let above = match own.parent {
            None => UnitQuaternion::identity(),
            Some(parent) => Trs::from_matrix(&self.globals(&self.shown)?[parent as usize]).rotation,
        };
        let rest = own.rest.translation;
        let pose = self.changed(j, |local| local.translation = rest + above.inverse() * translation)?;
        Ok(self.posed(&pose, format!("Move {}", self.name(j)?))?.merged(self.key("translate", j)))
    }

    fn globals(&self, pose: &Pose) -> Result<Vec<nalgebra::Matrix4<f64>>, StudioError> {
        self.skeleton.globals(pose).map_err(refused)
    }

    /// The limb follows the hand, the character its root; what is pinned stays.
    fn drag(&self, j: u32, point: Point3<f64>, to: Point3<f64>) -> Edited {
        let is_root = joint(self.skeleton, j)?.parent.is_none();
        let mut all = targets(self.skeleton, &self.document.pose);
        // A pin of the joint that is dragged gives way.
        all.retain(|t| t.joint != j || !matches!(t.goal, Goal::Position { .. }));
        let chain = limb_chain(self.skeleton, j);
        let mut start = self.shown.clone();
        if is_root {
            let at = self.globals(&start)?[j as usize].transform_point(&point);
            start.locals[j as usize].translation += to - at;
        } else {
            all.push(Target { joint: j, goal: Goal::Position { point, at: to }, weight: 1.0, chain });
        }
        let options = options(self.skeleton, self.document);
        let found = solve(self.skeleton, &start, &all, &options, &Run::default()).map_err(refused)?;
        Ok(self.posed(&found.pose, format!("Drag {}", self.name(j)?))?.merged(self.key("drag", j)))
    }

    fn pin(&self, j: u32, orientation: bool) -> Edited {
        let name = self.name(j)?.to_owned();
        let pinned =
            |t: &NamedTarget| t.joint == name && matches!(t.target.goal, Goal::Position { .. } | Goal::Orientation(_));
        if self.document.pose.targets.iter().any(pinned) {
            return self.with_targets(format!("Let {name} go"), |all| {
                all.retain(|t| !pinned(t));
                Ok(())
            });
        }
        let frame = Trs::from_matrix(&self.globals(&self.shown)?[j as usize]);
        let mut goals = vec![Goal::Position { point: Point3::origin(), at: frame.translation.into() }];
        if orientation {
            goals.push(Goal::Orientation(frame.rotation));
        }
        self.with_targets(format!("Pin {name}"), |all| {
            // The limb makes up for what moves the body.
            let chain = limb_chain(self.skeleton, j);
            let pins = goals.iter().map(|goal| Target { joint: j, goal: goal.clone(), weight: 1.0, chain });
            all.extend(pins.map(|t| NamedTarget::of(self.skeleton, t)));
            Ok(())
        })
    }

    fn with_targets(
        &self,
        label: impl Into<String>,
        change: impl FnOnce(&mut Vec<NamedTarget>) -> Result<(), StudioError>,
    ) -> Edited {
        let mut pose = (*self.document.pose).clone();
        if self.time.is_none() {
            pose.joints = offsets(self.skeleton, &self.shown);
        }
        change(&mut pose.targets)?;
        if pose.targets.len() > MAX_TARGETS {
            return Err(StudioError::request(format!("more than {MAX_TARGETS} targets")));
        }
        Ok(Step::new(with_pose(self.document, pose), label))
    }

    fn set_target(&self, index: usize, target: &TargetMessage) -> Edited {
        let new = NamedTarget::of(self.skeleton, self.target(target)?);
        let step = self.with_targets("Move a target", |all| {
            *all.get_mut(index).ok_or_else(|| no_target(index))? = new;
            Ok(())
        })?;
        Ok(step.merged(format!("target {index}")))
    }

    /// The library's target of a message.
    fn target(&self, message: &TargetMessage) -> Result<Target, StudioError> {
        let &TargetMessage { joint: j, kind, at, weight } = message;
        let own = joint(self.skeleton, j)?;
        let at = point(at)?;
        if !(weight > 0.0 && weight.is_finite()) {
            return Err(StudioError::request(format!("weight {weight} is not above 0")));
        }
        let goal = match kind {
            TargetKind::Position => Goal::Position { point: Point3::origin(), at },
            TargetKind::Orientation => {
                Goal::Orientation(Trs::from_matrix(&self.globals(&self.shown)?[j as usize]).rotation)
            }
            TargetKind::LookAt => Goal::LookAt { axis: self.axis(j), at },
            TargetKind::Pole => {
                let middle = own.parent;
                let root = middle.and_then(|m| self.skeleton.joints()[m as usize].parent);
                let (Some(middle), Some(root)) = (middle, root) else {
                    return Err(StudioError::request("a pole needs two joints above its own"));
                };
                Goal::Pole { root, middle, at }
            }
        };
        Ok(Target { joint: j, goal, weight, chain: None })
    }

    /// Where a joint looks, in its frame: along the bone to its only child, else away from its parent.
    fn axis(&self, j: u32) -> Unit<Vector3<f64>> {
        let along = if let [child] = self.skeleton.children(j) {
            self.skeleton.joints()[*child as usize].rest.translation
        } else {
            let rest = self.skeleton.joints()[j as usize].rest;
            rest.rotation.inverse() * rest.translation
        };
        Unit::try_new(along, 0.0).unwrap_or_else(Vector3::z_axis)
    }

    fn reset(&self, joints: Option<&[u32]>) -> Edited {
        let Some(joints) = joints else { return self.posed(&self.skeleton.rest_pose(), "Rest pose") };
        let mut pose = self.shown.clone();
        for &j in joints {
            let rest = joint(self.skeleton, j)?.rest;
            pose.locals[j as usize] = rest;
        }
        self.posed(&pose, "Joints at rest")
    }

    fn store(&self, name: &str) -> Edited {
        let mut poses = (*self.document.poses).clone();
        if poses.len() >= MAX_POSES {
            return Err(StudioError::request(format!("the library holds {MAX_POSES} poses")));
        }
        poses.insert(name.to_owned(), Arc::new(offsets(self.skeleton, &self.shown)));
        Ok(Step::new(
            CharacterDocument { poses: Arc::new(poses), ..self.document.clone() },
            format!("Store pose {name}"),
        ))
    }
}
