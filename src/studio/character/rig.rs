//! What is computed from a document: the skeleton, the weights, the skinned surface. Kept by what it was computed from, so that undo
//! finds it again.

use std::sync::Arc;

use nalgebra::{Matrix4, Point3};

use super::document::{Finding, SkeletonSource, WeightSource};
use super::message::{Ends, METHODS, SkinningMethod};
use crate::error::StudioError;
use plumbline_num::run::Run;
use plumbline_shape::character::extraction::{
    ContractionStep, ExtractionOptions, ExtractionReport, Keep, extract, skeleton_of,
};
use plumbline_shape::character::fitting::fit_template;
use plumbline_shape::character::humanoid::humanoid;
use plumbline_shape::character::skinning::Skinner;
use plumbline_shape::character::weights::bone_weights;
use plumbline_shape::character::{CharacterError, CurveSkeleton, Skeleton, Skin, SkinWeights};
use plumbline_shape::mesh::TriMesh;

/// Names of the templates.
pub(super) const TEMPLATES: [&str; 1] = ["humanoid"];
/// Results that are kept: as many as a user compares by undo and redo.
const MAX_KEPT: usize = 8;

/// An extracted skeleton.
#[derive(Debug)]
pub(super) struct Found {
    /// The skeleton.
    pub(super) skeleton: Arc<Skeleton>,
    /// What the extraction reports.
    pub(super) report: ExtractionReport,
    /// What the user should know.
    pub(super) notices: Vec<String>,
}

/// A small store of results by key; the oldest goes first.
#[derive(Debug)]
struct Kept<K, V>(Vec<(K, Arc<V>)>);

impl<K: PartialEq, V> Kept<K, V> {
    fn get(&self, key: &K) -> Option<Arc<V>> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone())
    }

    fn put(&mut self, key: K, value: Arc<V>) {
        if self.0.len() == MAX_KEPT {
            self.0.remove(0);
        }
        self.0.push((key, value));
    }
}

/// A shared value, the same only where it is the very one.
#[derive(Clone, Debug)]
struct Same<T>(Arc<T>);

impl<T> PartialEq for Same<T> {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

type CurveKey = (super::message::ExtractionOptions, Option<Ends>);

/// Results for the mesh of a document.
#[derive(Debug)]
pub(super) struct Rigs {
    mesh: Arc<TriMesh>,
    curves: Kept<CurveKey, (CurveSkeleton, ExtractionReport)>,
    found: Kept<Finding, Found>,
    weights: Kept<(Arc<Skeleton>, String), SkinWeights>,
    skins: Kept<(Arc<Skeleton>, Same<SkinWeights>), Skin>,
    skinners: Kept<(Same<Skin>, SkinningMethod), Skinner>,
}

impl Rigs {
    /// Nothing is known of the mesh.
    pub(super) fn new(mesh: Arc<TriMesh>) -> Self {
        Self {
            mesh,
            curves: Kept(Vec::new()),
            found: Kept(Vec::new()),
            weights: Kept(Vec::new()),
            skins: Kept(Vec::new()),
            skinners: Kept(Vec::new()),
        }
    }

    /// The skeleton, where it is known.
    pub(super) fn skeleton(&self, source: &SkeletonSource) -> Option<Arc<Skeleton>> {
        match source {
            SkeletonSource::None => None,
            SkeletonSource::Made(skeleton) => Some(skeleton.clone()),
            SkeletonSource::Found(finding) => self.found.get(finding).map(|found| found.skeleton.clone()),
        }
    }

    /// The report of an extraction, where it is done.
    pub(super) fn report(&self, finding: &Finding) -> Option<Arc<Found>> {
        self.found.get(finding)
    }

    /// The weights, where they are known.
    pub(super) fn weights(&self, source: &WeightSource, skeleton: &Arc<Skeleton>) -> Option<Arc<SkinWeights>> {
        match source {
            WeightSource::Given(weights, _) => Some(weights.clone()),
            WeightSource::Computed(options) => self.weights.get(&(skeleton.clone(), format!("{options:?}"))),
        }
    }

    /// Extracts a skeleton.
    ///
    /// # Errors
    /// What the extraction or the fit says.
    pub(super) fn find(&mut self, finding: &Finding, run: &Run) -> Result<Arc<Found>, StudioError> {
        let curve = self.curve(finding, run)?;
        let mut notices: Vec<String> = curve.1.repairs.clone();
        let skeleton = match finding.template.as_deref() {
            None => skeleton_of(&curve.0, finding.joints.map(|n| n as usize)).map_err(fault)?,
            Some(name) => {
                let fit = fit_template(&template(name)?, &curve.0, run).map_err(fault)?;
                let loose = fit.limbs.iter().filter(|limb| limb.stretch.is_none()).count();
                if loose > 0 {
                    notices.push(format!("{loose} of {} limbs of the template are not on the curve", fit.limbs.len()));
                }
                if fit.ambiguous {
                    notices.push("left and right look alike: look whether the sides are right".to_owned());
                }
                fit.skeleton
            }
        };
        let found = Arc::new(Found { skeleton: Arc::new(skeleton), report: curve.1.clone(), notices });
        self.found.put(finding.clone(), found.clone());
        Ok(found)
    }

    fn curve(&mut self, finding: &Finding, run: &Run) -> Result<Arc<(CurveSkeleton, ExtractionReport)>, StudioError> {
        let key = (finding.options, finding.ends.clone());
        if let Some(known) = self.curves.get(&key) {
            return Ok(known);
        }
        let o = finding.options;
        let options = ExtractionOptions {
            contraction: o.contraction,
            attraction: o.attraction,
            medial: o.medial,
            prune: o.prune,
            iterations: o.iterations as usize,
            keep: match &finding.ends {
                None => Keep::Nothing,
                Some(Ends::Word(_)) => Keep::Extrema,
                Some(Ends::Vertices(vertices)) => Keep::Vertices(vertices.clone()),
            },
        };
        let mut proceed = |_: &ContractionStep<'_>| std::ops::ControlFlow::Continue(());
        let curve = Arc::new(extract(&self.mesh, &options, &mut proceed, run).map_err(fault)?);
        self.curves.put(key, curve.clone());
        Ok(curve)
    }

    /// Computes weights.
    ///
    /// # Errors
    /// What the method says.
    pub(super) fn weigh(
        &mut self,
        source: &WeightSource,
        skeleton: &Arc<Skeleton>,
        run: &Run,
    ) -> Result<(Arc<SkinWeights>, Vec<String>), StudioError> {
        if let Some(known) = self.weights(source, skeleton) {
            return Ok((known, Vec::new()));
        }
        let options = source.options();
        let (weights, report) = bone_weights(&self.mesh, skeleton, options, run).map_err(fault)?;
        let mut notices = Vec::new();
        if report.borrowed_vertices > 0 {
            let (vertices, parts) = (report.borrowed_vertices, report.borrowed_components);
            notices.push(format!("{vertices} vertices in {parts} parts see no bone; they follow the nearest that do"));
        }
        let weights = Arc::new(weights);
        self.weights.put((skeleton.clone(), format!("{options:?}")), weights.clone());
        Ok((weights, notices))
    }

    /// The skin of weights, bound at rest.
    ///
    /// # Errors
    /// Weights of another skeleton.
    pub(super) fn skin(
        &mut self,
        skeleton: &Arc<Skeleton>,
        weights: &Arc<SkinWeights>,
    ) -> Result<Arc<Skin>, StudioError> {
        let key = (skeleton.clone(), Same(weights.clone()));
        if let Some(known) = self.skins.get(&key) {
            return Ok(known);
        }
        let skin = Arc::new(Skin::bound((**weights).clone(), skeleton).map_err(fault)?);
        self.skins.put(key, skin.clone());
        Ok(skin)
    }

    /// Positions in a pose, by a method: the call of the stage `character.pose`.
    ///
    /// # Errors
    /// What the method says.
    pub(super) fn positions(
        &mut self,
        skeleton: &Skeleton,
        skin: &Arc<Skin>,
        globals: &[Matrix4<f64>],
        method: SkinningMethod,
        run: &Run,
    ) -> Result<Vec<Point3<f64>>, StudioError> {
        let key = (Same(skin.clone()), method);
        let skinner = if let Some(known) = self.skinners.get(&key) {
            known
        } else {
            let library = METHODS.iter().find(|m| m.0 == method).map(|m| m.1);
            let library = library.ok_or_else(|| StudioError::request("there is no trained model"))?;
            let skinner = Skinner::new(&self.mesh, None, skeleton, skin, library, run).map_err(fault)?;
            let skinner = Arc::new(skinner);
            self.skinners.put(key, skinner.clone());
            skinner
        };
        skinner.positions(&skin.joint_matrices(globals).map_err(fault)?).map_err(fault)
    }
}

/// A template by its name.
///
/// # Errors
/// [`StudioError::Request`] for an unknown one.
pub(super) fn template(name: &str) -> Result<Skeleton, StudioError> {
    // The grid of its surface, which is not used, as coarse as it can be.
    const CELL: f64 = 0.1;
    match name {
        "humanoid" => Ok(humanoid(CELL).map_err(fault)?.skeleton),
        _ => Err(StudioError::request(format!(
            "there is no template {name:?} (expected one of {})",
            TEMPLATES.join(", ")
        ))),
    }
}

/// An error of the library: interrupted calls are no fault.
pub(super) fn fault(error: CharacterError) -> StudioError {
    match error {
        CharacterError::Interrupted(stopped) => StudioError::Stopped(stopped),
        other => StudioError::Method(other.to_string()),
    }
}
