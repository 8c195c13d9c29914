//! Edits as functions of the document.

mod clips;
mod poses;
mod skeleton;
mod weights;

use std::sync::Arc;

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use super::document::{CharacterDocument, Finding, SkeletonSource, Template};
use super::message::{Edit, Q4, SkinningMethod, V3};
use super::rig::{Rigs, fault};
use crate::error::StudioError;
use crate::files::DocumentFiles;
use crate::workspace::Step;
use plumbline_shape::character::{Pose, Skeleton, SkinWeights};
use plumbline_shape::mesh::{Model, TriMesh};

/// Maximum length of names, bytes.
const MAX_NAME: usize = 200;
/// Maximum number of joints made by hand: more than a tree shows.
const MAX_JOINTS: usize = 4096;

/// What edits read besides the document.
pub(super) struct Around<'a> {
    pub(super) mesh: &'a Arc<TriMesh>,
    pub(super) neighbors: &'a [Vec<u32>],
    pub(super) rigs: &'a mut Rigs,
    pub(super) files: &'a DocumentFiles,
    pub(super) model: &'a Model,
    /// The pose that is shown, where there is a skeleton.
    pub(super) shown: Option<Pose>,
    /// The time in the clip, where the pose of one is shown.
    pub(super) time: Option<f64>,
}

impl Around<'_> {
    /// The skeleton that is edited.
    pub(super) fn skeleton(&self, document: &CharacterDocument) -> Result<Arc<Skeleton>, StudioError> {
        let found = self.rigs.skeleton(&document.skeleton);
        found.ok_or_else(|| match document.skeleton {
            SkeletonSource::Found(_) => StudioError::request("the skeleton is still being extracted"),
            _ => StudioError::request("there is no skeleton yet"),
        })
    }

    /// The weights that are edited.
    pub(super) fn weights(&self, document: &CharacterDocument) -> Result<Arc<SkinWeights>, StudioError> {
        let skeleton = self.skeleton(document)?;
        let found = self.rigs.weights(&document.weights, &skeleton);
        found.ok_or_else(|| StudioError::request("the weights are still being computed"))
    }

    fn pose(&self, skeleton: &Skeleton) -> Pose {
        let fits = |pose: &&Pose| pose.locals.len() == skeleton.joint_count();
        self.shown.as_ref().filter(fits).cloned().unwrap_or_else(|| skeleton.rest_pose())
    }
}

pub(super) use clips::from_rest;
pub(super) use skeleton::add_clips;

type Edited = Result<Step<CharacterDocument>, StudioError>;

/// The document after an edit.
///
/// # Errors
/// [`StudioError::Request`] where it does not fit.
pub(super) fn apply(document: &CharacterDocument, edit: Edit, around: &mut Around<'_>) -> Edited {
    use Edit as E;
    match edit {
        E::Extract { options, joints, ends } => {
            Ok(found(document, Finding { options, joints, ends, template: None }, "Extract the skeleton"))
        }
        E::Template { name } => Ok(fitted(document, super::rig::template(&name)?)),
        E::TemplateFile { path } => skeleton::template_file(document, &path, around),
        E::ComputeWeights { .. } | E::Paint { .. } | E::Influences { .. } => weights::apply(document, edit, around),
        E::Rotate { .. }
        | E::Drag { .. }
        | E::Translate { .. }
        | E::Pin { .. }
        | E::AddTarget { .. }
        | E::SetTarget { .. }
        | E::RemoveTarget { .. }
        | E::ResetPose { .. }
        | E::MirrorPose
        | E::PastePose { .. }
        | E::TakePose
        | E::Lock { .. }
        | E::BakePose
        | E::StorePose { .. }
        | E::ApplyPose { .. }
        | E::RemovePose { .. } => poses::apply(document, edit, around),
        E::Skinning { method } => skinning(document, method, around),
        E::AddClip { .. }
        | E::RenameClip { .. }
        | E::RemoveClip { .. }
        | E::SelectClip { .. }
        | E::Key { .. }
        | E::KeyUnkeyed { .. }
        | E::DiscardUnkeyed { .. }
        | E::RunWrites { .. }
        | E::SetKey { .. }
        | E::MoveKeys { .. }
        | E::RemoveKeys { .. }
        | E::Interpolation { .. } => clips::apply(document, edit, around),
        other => Ok(with_fitting_model(skeleton::apply(document, other, around)?, around)),
    }
}

/// The skeleton of a template, fitted to the surface.
pub(super) fn fitted(document: &CharacterDocument, template: Template) -> Step<CharacterDocument> {
    let label = format!("Fit the template {}", template.name);
    let finding = Finding { template: Some(Arc::new(template)), ..(*document.finding).clone() };
    found(document, finding, &label)
}

/// The same without regression where the trained skin does not fit the skeleton any more.
fn with_fitting_model(mut step: Step<CharacterDocument>, around: &Around<'_>) -> Step<CharacterDocument> {
    let skeleton = around.rigs.skeleton(&step.document.skeleton);
    let fits = skeleton.is_some_and(|s| model_fault(&step.document, around.mesh, &s).is_none());
    if !fits && step.document.skinning == SkinningMethod::Regression {
        step.document.skinning = SkinningMethod::DualQuaternion;
        step.label.push_str("; the trained skin does not fit any more");
    }
    step
}

/// Why there is no trained skin for the mesh and a skeleton; none where there is.
pub(super) fn model_fault(document: &CharacterDocument, mesh: &TriMesh, skeleton: &Skeleton) -> Option<String> {
    match &document.model {
        None => Some("there is no trained skin: import one (`plumbline skin train` makes them)".to_owned()),
        Some(trained) => trained.0.model.check(mesh, skeleton).err().map(|e| e.to_string()),
    }
}

fn found(document: &CharacterDocument, finding: Finding, label: &str) -> Step<CharacterDocument> {
    let finding = Arc::new(finding);
    let skeleton = SkeletonSource::Found(finding.clone());
    let weights = super::document::WeightSource::Computed(*document.weights.options());
    // Whether a trained skin fits the joints that will be found is not known.
    let skinning = match document.skinning {
        SkinningMethod::Regression => SkinningMethod::DualQuaternion,
        other => other,
    };
    Step::new(CharacterDocument { skeleton, finding, weights, skinning, ..document.clone() }, label)
}

fn skinning(document: &CharacterDocument, method: SkinningMethod, around: &Around<'_>) -> Edited {
    if method == SkinningMethod::Regression {
        if let Some(fault) = model_fault(document, around.mesh, &*around.skeleton(document)?) {
            return Err(StudioError::Request(fault));
        }
        // The stage refuses some settings together with a trained skin.
        document.pipeline.with(&[("skinning", "regression".into()), ("model", "x.skin".into())])?;
    }
    let label = format!("Skinning: {}", serde_json::to_value(method).unwrap_or_default().as_str().unwrap_or_default());
    Ok(Step::new(CharacterDocument { skinning: method, ..document.clone() }, label))
}

/// A finite point.
pub(super) fn point(p: V3) -> Result<Point3<f64>, StudioError> {
    vector(p).map(Point3::from)
}

/// A finite vector.
pub(super) fn vector(v: V3) -> Result<Vector3<f64>, StudioError> {
    if v.iter().all(|c| c.is_finite()) {
        Ok(Vector3::from(v))
    } else {
        Err(StudioError::request(format!("{v:?} is not finite")))
    }
}

/// A rotation of any length.
pub(super) fn rotation([x, y, z, w]: Q4) -> Result<UnitQuaternion<f64>, StudioError> {
    let given = Quaternion::new(w, x, y, z);
    let unit = given.norm().is_finite().then(|| UnitQuaternion::try_new(given, 1e-12)).flatten();
    unit.ok_or_else(|| StudioError::request(format!("[{x}, {y}, {z}, {w}] is no rotation")))
}

/// A name that may be given.
pub(super) fn name(text: &str) -> Result<String, StudioError> {
    let text = text.trim();
    if text.is_empty() || text.len() > MAX_NAME {
        return Err(StudioError::request(format!("a name has 1 to {MAX_NAME} bytes, not {}", text.len())));
    }
    Ok(text.to_owned())
}

/// A joint of the skeleton.
pub(super) fn joint(skeleton: &Skeleton, joint: u32) -> Result<&plumbline_shape::character::Joint, StudioError> {
    let count = skeleton.joint_count();
    let found = skeleton.joints().get(joint as usize);
    found.ok_or_else(|| StudioError::request(format!("there is no joint {joint} (the skeleton has {count})")))
}

/// A request that the library refused.
pub(super) fn refused(error: plumbline_shape::character::CharacterError) -> StudioError {
    match fault(error) {
        StudioError::Method(why) => StudioError::Request(why),
        other => other,
    }
}
