//! The pose of a document: the call of the stage `character.pose`.

use nalgebra::Vector3;

use super::document::{CharacterDocument, ClipDocument, PoseDocument, pose_of, with_offsets};
use super::rig::fault;
use crate::error::StudioError;
use plumbline_num::run::Run;
use plumbline_shape::character::ik::{IkOptions, IkSolution, Target};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::{Clip, Extrapolation, Pose, Skeleton, Track};

/// The targets of a pose whose joints the skeleton has.
pub(super) fn targets(skeleton: &Skeleton, pose: &PoseDocument) -> Vec<Target> {
    pose.targets.iter().filter_map(|t| t.resolved(skeleton)).collect()
}

/// What the pose file of the document says.
pub(super) fn target_pose(skeleton: &Skeleton, document: &PoseDocument) -> TargetPose {
    let locked = document.locked.iter().filter_map(|name| skeleton.find(name)).collect();
    let start = pose_of(skeleton, &document.joints);
    TargetPose { start, targets: targets(skeleton, document), locked, ..TargetPose::default() }
}

/// Options of inverse kinematics, as the pipeline file has them.
pub(super) fn options(skeleton: &Skeleton, document: &CharacterDocument) -> IkOptions {
    let settings = document.pipeline.settings();
    let locked = document.pose.locked.iter().filter_map(|name| skeleton.find(name)).collect();
    IkOptions { method: settings.ik, iterations: settings.iterations as usize, locked, ..IkOptions::default() }
}

/// The pose with its targets met.
///
/// # Errors
/// What the solver says.
pub(super) fn solved(skeleton: &Skeleton, document: &CharacterDocument, run: &Run) -> Result<IkSolution, StudioError> {
    let wanted = target_pose(skeleton, &document.pose);
    let options = options(skeleton, document);
    plumbline_shape::character::ik::solve(skeleton, &wanted.start, &wanted.targets, &options, run).map_err(fault)
}

/// A clip of the library; curves of joints that the skeleton lacks are passed over.
///
/// # Errors
/// None for documents that edits made.
pub(super) fn clip(skeleton: &Skeleton, document: &ClipDocument) -> Result<Clip, StudioError> {
    let track = |c: &std::sync::Arc<super::document::NamedCurve>| {
        Some(Track { joint: skeleton.find(&c.joint)?, curve: c.curve.clone() })
    };
    Clip::new(document.name.clone(), document.curves.iter().filter_map(track).collect(), Vec::new()).map_err(fault)
}

/// The pose of the keys of a clip at a time.
///
/// # Errors
/// As [`clip`].
pub(super) fn keyed_pose(skeleton: &Skeleton, document: &ClipDocument, time: f64) -> Result<Pose, StudioError> {
    clip(skeleton, document)?.pose(skeleton, time, Extrapolation::Constant).map_err(fault)
}

/// The pose of a clip at a time, with what is not keyed there.
///
/// # Errors
/// As [`clip`].
pub(super) fn clip_pose(skeleton: &Skeleton, document: &ClipDocument, time: f64) -> Result<Pose, StudioError> {
    let keyed = keyed_pose(skeleton, document, time)?;
    Ok(match document.unkeyed_at(time) {
        Some(unkeyed) => with_offsets(skeleton, keyed, &unkeyed.joints),
        None => keyed,
    })
}

/// Poses of the keys of a clip, from its first key to its last: those of the stage `character.pose`.
///
/// # Errors
/// As [`clip`].
pub(super) fn frames(skeleton: &Skeleton, document: &ClipDocument, count: u32) -> Result<Vec<Pose>, StudioError> {
    let clip = clip(skeleton, document)?;
    let (start, end) = clip.span().unwrap_or((0.0, 0.0));
    let fraction = |k: u32| if count <= 1 { 1.0 } else { f64::from(k) / f64::from(count - 1) };
    let time = |k: u32| start + (end - start) * fraction(k);
    (0..count).map(|k| clip.pose(skeleton, time(k), Extrapolation::Constant).map_err(fault)).collect()
}

/// The shift that brings a mesh to the center, for buffers.
pub(super) fn shift(center: &nalgebra::Point3<f64>) -> Vector3<f64> {
    -center.coords
}
