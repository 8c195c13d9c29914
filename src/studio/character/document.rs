//! The document: pipeline file, skeleton, weights, pose, library of poses, clips.
//!
//! Poses are kept by the names of joints, as offsets from rest: they survive edits of the skeleton. What a long computation gives (an
//! extracted skeleton, computed weights) is not in the document, but how it is computed: the result is found again after undo.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};

use super::message::{Ends, ExtractionOptions, SkinningMethod};
use super::pipeline_text::PipelineText;
use plumbline_num::math::Trs;
use plumbline_shape::character::ik::{Goal, Target};
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
        let (rotation, translation) = (rest.rotation.inverse() * local.rotation, local.translation - rest.translation);
        let moves = local.rotation != rest.rotation || translation != Vector3::zeros();
        moves.then_some(Self { rotation, translation })
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
    let local = |j: &plumbline_shape::character::Joint| offsets.get(&j.name).map_or(j.rest, |o| o.apply(&j.rest));
    Pose { locals: skeleton.joints().iter().map(local).collect() }
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
    pub template: Option<String>,
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
}

impl CharacterDocument {
    /// The clip that is shown.
    pub fn shown_clip(&self) -> Option<&Arc<ClipDocument>> {
        let name = self.clip.as_ref()?;
        self.clips.iter().find(|clip| clip.name == *name)
    }
}
