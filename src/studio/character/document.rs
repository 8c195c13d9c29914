//! The document: pipeline file, skeleton, weights, pose, library of poses, clips.
//!
//! Poses are kept by the names of joints, as offsets from rest: they survive edits of the skeleton. What a long computation gives (an
//! extracted skeleton, computed weights) is not in the document, but how it is computed: the result is found again after undo.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::message::{Ends, ExtractionOptions, SkinningMethod};
use super::pipeline_text::PipelineText;
use plumbline_num::math::Trs;
use plumbline_shape::character::ik::{Goal, Target};
use plumbline_shape::character::regression::SkinModel;
use plumbline_shape::character::weights::WeightOptions;
use plumbline_shape::character::{Curve, Pose, Skeleton, SkinWeights};

/// Rotation and translation of a joint from rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offset {
    /// `rest⁻¹ · pose`, in the frame of the joint at rest.
    pub rotation: UnitQuaternion<f64>,
    /// In the frame of the parent.
    pub translation: Vector3<f64>,
}

impl Offset {
    /// Of a transform from rest; `None` where it is at rest.
    pub fn of(rest: &Trs, local: &Trs) -> Option<Self> {
        let moves = local.rotation != rest.rotation || local.translation != rest.translation;
        moves.then(|| Self::between(rest, local))
    }

    /// Of a transform from rest.
    pub fn between(rest: &Trs, local: &Trs) -> Self {
        Self { rotation: rest.rotation.inverse() * local.rotation, translation: local.translation - rest.translation }
    }

    /// The transform.
    pub fn apply(&self, rest: &Trs) -> Trs {
        Trs {
            rotation: rest.rotation * self.rotation,
            translation: rest.translation + self.translation,
            scale: rest.scale,
        }
    }
}

/// Joints that are not at rest, by name.
pub type Offsets = BTreeMap<String, Offset>;

/// The offsets of a pose.
pub fn offsets(skeleton: &Skeleton, pose: &Pose) -> Offsets {
    let pairs = skeleton.joints().iter().zip(&pose.locals);
    pairs.filter_map(|(joint, local)| Some((joint.name.clone(), Offset::of(&joint.rest, local)?))).collect()
}

/// The pose of offsets; names that the skeleton lacks are passed over.
pub fn pose_of(skeleton: &Skeleton, offsets: &Offsets) -> Pose {
    with_offsets(skeleton, skeleton.rest_pose(), offsets)
}

/// A pose with other offsets of some joints.
pub fn with_offsets(skeleton: &Skeleton, mut pose: Pose, offsets: &Offsets) -> Pose {
    for (joint, local) in skeleton.joints().iter().zip(&mut pose.locals) {
        if let Some(offset) = offsets.get(&joint.name) {
            *local = offset.apply(&joint.rest);
        }
    }
    pose
}

/// Offsets from rest of the joints in which a pose differs from another one.
pub fn differing(skeleton: &Skeleton, pose: &Pose, from: &Pose) -> Offsets {
    /// Rotations nearer than this, rad, and translations relative to their lengths are the same but for rounding.
    const SAME: f64 = 1e-9;
    let differs = |a: &Trs, b: &Trs| {
        let far = (a.translation - b.translation).norm() > SAME * (1.0 + b.translation.norm());
        far || a.rotation.angle_to(&b.rotation) > SAME
    };
    let joints = skeleton.joints().iter().zip(pose.locals.iter().zip(&from.locals));
    joints
        .filter(|(_, (a, b))| differs(a, b))
        .map(|(j, (a, _))| (j.name.clone(), Offset::between(&j.rest, a)))
        .collect()
}

/// Where the skeleton comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum SkeletonSource {
    /// There is none yet.
    None,
    /// It is extracted from the surface.
    Found(Arc<Finding>),
    /// It was read or made by hand.
    Made(Arc<Skeleton>),
}

/// How a skeleton is extracted.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Options of the extraction.
    pub options: ExtractionOptions,
    /// About how many joints.
    pub joints: Option<u32>,
    /// Ends that stay.
    pub ends: Option<Ends>,
    /// The template that is fitted.
    pub template: Option<Arc<Template>>,
}

/// A skeleton that is fitted to a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Template {
    /// What it is called.
    pub name: String,
    /// Its joints.
    pub skeleton: Skeleton,
}

/// A shared value, the same only where it is the very one.
#[derive(Debug)]
pub struct Same<T>(pub Arc<T>);

impl<T> Clone for Same<T> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<T> PartialEq for Same<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// A skin that was trained on example poses.
#[derive(Debug)]
pub struct Trained {
    /// The file that it was read from beside the document; none where it was imported.
    pub file: Option<PathBuf>,
    /// What it is called.
    pub name: String,
    /// The model.
    pub model: SkinModel,
}

/// Where the weights come from.
#[derive(Clone, Debug, PartialEq)]
pub enum WeightSource {
    /// They are computed.
    Computed(WeightOptions),
    /// They were read or painted, on weights that were computed by these options.
    Given(Arc<SkinWeights>, WeightOptions),
}

impl WeightSource {
    /// Options of the computation.
    pub fn options(&self) -> &WeightOptions {
        match self {
            Self::Computed(options) | Self::Given(_, options) => options,
        }
    }
}

/// A target by the names of its joints.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedTarget {
    /// Its joints are replaced by those of the names when it is resolved.
    pub target: Target,
    /// Name of its joint.
    pub joint: String,
    /// Names of root and middle, of a pole.
    pub pole: Option<[String; 2]>,
}

impl NamedTarget {
    /// Of a target of a skeleton.
    pub fn of(skeleton: &Skeleton, target: Target) -> Self {
        let name = |j: u32| skeleton.joints()[j as usize].name.clone();
        let pole = match target.goal {
            Goal::Pole { root, middle, .. } => Some([name(root), name(middle)]),
            _ => None,
        };
        Self { joint: name(target.joint), pole, target }
    }

    /// The target, where the skeleton has its joints.
    pub fn resolved(&self, skeleton: &Skeleton) -> Option<Target> {
        let mut target = self.target.clone();
        target.joint = skeleton.find(&self.joint)?;
        if let (Goal::Pole { root, middle, .. }, Some([first, second])) = (&mut target.goal, &self.pole) {
            (*root, *middle) = (skeleton.find(first)?, skeleton.find(second)?);
        }
        Some(target)
    }
}

/// The pose before its targets are sought, and the targets.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseDocument {
    /// Joints that are not at rest.
    pub joints: Offsets,
    /// Targets.
    pub targets: Vec<NamedTarget>,
    /// Names of joints that do not rotate for targets.
    pub locked: Vec<String>,
}

/// The curve of a joint's property, by the name of the joint.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedCurve {
    /// The joint.
    pub joint: String,
    /// Its keys.
    pub curve: Curve,
}

/// A clip.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipDocument {
    /// Its name.
    pub name: String,
    /// Curves, at most one of a kind per joint.
    pub curves: Vec<Arc<NamedCurve>>,
    /// Poses that are not keyed, each at its time.
    pub unkeyed: Vec<Unkeyed>,
}

/// A pose at a time of a clip that is not among its keys: the clip is posed so at this time, and its curves do not go through it.
#[derive(Clone, Debug, PartialEq)]
pub struct Unkeyed {
    /// The time, s.
    pub time: f64,
    /// Joints that differ from the keys.
    pub joints: Offsets,
}

/// Times nearer than this are one, s: a hundredth of a frame.
pub const SAME_TIME: f64 = 1e-4;

impl ClipDocument {
    /// What is not keyed at a time.
    pub fn unkeyed_at(&self, time: f64) -> Option<&Unkeyed> {
        self.unkeyed.iter().find(|pose| (pose.time - time).abs() < SAME_TIME)
    }

    /// The same with other joints that are not keyed at a time.
    pub fn set_unkeyed(&mut self, time: f64, joints: Offsets) {
        self.unkeyed.retain(|pose| (pose.time - time).abs() >= SAME_TIME);
        if !joints.is_empty() {
            let at = self.unkeyed.partition_point(|pose| pose.time < time);
            self.unkeyed.insert(at, Unkeyed { time, joints });
        }
    }
}

/// What the files of a character say.
#[derive(Clone, Debug, PartialEq)]
pub struct CharacterDocument {
    /// The pipeline file.
    pub pipeline: PipelineText,
    /// The skeleton.
    pub skeleton: SkeletonSource,
    /// Of the extraction, as the panel shows it.
    pub finding: Arc<Finding>,
    /// The weights.
    pub weights: WeightSource,
    /// The pose.
    pub pose: Arc<PoseDocument>,
    /// The library.
    pub poses: Arc<BTreeMap<String, Arc<Offsets>>>,
    /// The clips.
    pub clips: Arc<Vec<Arc<ClipDocument>>>,
    /// The clip that is shown.
    pub clip: Option<String>,
    /// How the surface follows.
    pub skinning: SkinningMethod,
    /// The trained skin.
    pub model: Option<Same<Trained>>,
}

impl CharacterDocument {
    /// The clip that is shown.
    pub fn shown_clip(&self) -> Option<&Arc<ClipDocument>> {
        let name = self.clip.as_ref()?;
        self.clips.iter().find(|clip| clip.name == *name)
    }
}
