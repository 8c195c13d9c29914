//! What is computed from a document: the skeleton, the weights, the skinned surface. Kept by what it was computed from, so that undo
//! finds it again.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::{Matrix4, Point3};

use super::background::{Background, Computed};
use super::document::{Finding, Same, SkeletonSource, Template, Trained, WeightSource};
use super::message::{Ends, METHODS, SkinningMethod};
use crate::error::StudioError;
use plumbline_num::run::Run;
use plumbline_shape::character::extraction::{
    ContractionStep, ExtractionOptions, ExtractionReport, Keep, extract, skeleton_of,
};
use plumbline_shape::character::fitting::fit_template;
use plumbline_shape::character::humanoid::humanoid;
use plumbline_shape::character::regression::TrainedSkin;
use plumbline_shape::character::skinning::Skinner;
use plumbline_shape::character::weights::{WeightOptions, bone_weights};
use plumbline_shape::character::{
    CharacterError, CurveSkeleton, DetailRefiner, RigFileError, Skeleton, Skin, SkinWeights,
};
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

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<K: PartialEq, V> Kept<K, V> {
    fn get(&self, key: &K) -> Option<Arc<V>> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone())
    }

    fn put(&mut self, key: K, value: Arc<V>) -> Arc<V> {
        if self.0.len() == MAX_KEPT {
            self.0.remove(0);
        }
        self.0.push((key, value.clone()));
        value
    }

    /// What is known for a key, made where it is not.
    fn made(&mut self, key: K, make: impl FnOnce() -> Result<V, StudioError>) -> Result<Arc<V>, StudioError> {
        match self.get(&key) {
            Some(known) => Ok(known),
            None => Ok(self.put(key, Arc::new(make()?))),
        }
    }
}

type CurveKey = (super::message::ExtractionOptions, Option<Ends>);
type Curve = (CurveSkeleton, ExtractionReport);
type WeightKey = (Arc<Skeleton>, String);
/// A template on the curve, and what the user should know of it.
type Fitted = (Skeleton, Vec<String>);

fn curve_key(finding: &Finding) -> CurveKey {
    (finding.options, finding.ends.clone())
}

fn weight_key(options: &WeightOptions, skeleton: &Arc<Skeleton>) -> WeightKey {
    (skeleton.clone(), format!("{options:?}"))
}

/// A trained skin for the mesh and a skeleton.
#[derive(Debug)]
struct Bound {
    skin: Mutex<TrainedSkin>,
    /// Those that fit its examples best.
    weights: Arc<SkinWeights>,
}

/// How a surface follows a skeleton.
#[derive(Debug)]
pub(super) struct Following<'a> {
    /// The skeleton.
    pub(super) skeleton: &'a Arc<Skeleton>,
    /// Weights, bound at rest.
    pub(super) skin: &'a Arc<Skin>,
    /// The same weights.
    pub(super) weights: &'a Arc<SkinWeights>,
    /// The method.
    pub(super) method: SkinningMethod,
    /// The model of a regression.
    pub(super) model: Option<&'a Same<Trained>>,
    /// Weight of the skinned surface where details are kept, as the pipeline file has it.
    pub(super) details: Option<f64>,
}

/// Results for the mesh of a document.
#[derive(Debug)]
pub(super) struct Rigs {
    mesh: Arc<TriMesh>,
    curves: Kept<CurveKey, Curve>,
    found: Kept<Finding, Found>,
    weights: Kept<WeightKey, SkinWeights>,
    skins: Kept<(Arc<Skeleton>, Same<SkinWeights>), Skin>,
    skinners: Kept<(Same<Skin>, SkinningMethod), Skinner>,
    trained: Kept<(Same<Trained>, Arc<Skeleton>), Bound>,
    refiners: Kept<(Same<SkinWeights>, u64), Mutex<DetailRefiner>>,
    extracting: Background<CurveKey, Curve>,
    fitting: Background<Finding, Fitted>,
    weighing: Background<WeightKey, (SkinWeights, Vec<String>)>,
}

impl Rigs {
    /// Nothing is known of the mesh.
    pub(super) fn new(mesh: Arc<TriMesh>) -> Self {
        Self {
            mesh,
            curves: Kept::default(),
            found: Kept::default(),
            weights: Kept::default(),
            skins: Kept::default(),
            skinners: Kept::default(),
            trained: Kept::default(),
            refiners: Kept::default(),
            extracting: Background::default(),
            fitting: Background::default(),
            weighing: Background::default(),
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
            WeightSource::Computed(options) => self.weights.get(&weight_key(options, skeleton)),
        }
    }

    /// Stops computations that another document does not need.
    pub(super) fn stop_others(&mut self, skeleton: &SkeletonSource, weights: &WeightSource) {
        let curve = match skeleton {
            SkeletonSource::Found(finding) => Some(curve_key(finding)),
            _ => None,
        };
        self.extracting.keep_only(curve.as_ref());
        self.fitting.keep_only(match skeleton {
            SkeletonSource::Found(finding) => Some(finding),
            _ => None,
        });
        let known = self.skeleton(skeleton);
        let key = known.filter(|_| matches!(weights, WeightSource::Computed(_)));
        self.weighing.keep_only(key.map(|skeleton| weight_key(weights.options(), &skeleton)).as_ref());
    }

    /// The fractions that are done of an extraction or a fit and of a computation of weights that run.
    pub(super) fn progress(&self) -> [Option<f64>; 2] {
        [self.extracting.progress().or(self.fitting.progress()), self.weighing.progress()]
    }

    /// Extracts a skeleton, on a thread of its own.
    ///
    /// # Errors
    /// What the extraction or the fit says.
    pub(super) fn find(&mut self, finding: &Finding, run: &Run) -> Result<Computed<Arc<Found>>, StudioError> {
        let curve = match self.curve(finding, run)? {
            Computed::Ready(curve) => curve,
            Computed::Running => return Ok(Computed::Running),
            Computed::Failed => return Ok(Computed::Failed),
        };
        let fitted = match finding.template.clone() {
            None => {
                let joints = finding.joints.map(|n| n as usize);
                Computed::Ready((skeleton_of(&curve.0, joints).map_err(fault)?, Vec::new()))
            }
            Some(template) => {
                let on = curve.clone();
                self.fitting.get(finding, run, move |run| fitted(&template.skeleton, &on.0, run))?
            }
        };
        Ok(fitted.map(|(skeleton, warnings)| {
            let notices = curve.1.repairs.iter().cloned().chain(warnings).collect();
            let found = Found { skeleton: Arc::new(skeleton), report: curve.1.clone(), notices };
            self.found.put(finding.clone(), Arc::new(found))
        }))
    }

    fn curve(&mut self, finding: &Finding, run: &Run) -> Result<Computed<Arc<Curve>>, StudioError> {
        let key = curve_key(finding);
        if let Some(known) = self.curves.get(&key) {
            return Ok(Computed::Ready(known));
        }
        let (mesh, options) = (self.mesh.clone(), library_options(finding));
        let extracted = self.extracting.get(&key, run, move |run| {
            let mut proceed = |_: &ContractionStep<'_>| std::ops::ControlFlow::Continue(());
            extract(&mesh, &options, &mut proceed, run).map_err(fault)
        })?;
        Ok(extracted.map(|curve| self.curves.put(key, Arc::new(curve))))
    }

    /// Computes weights, on a thread of its own.
    ///
    /// # Errors
    /// What the method says.
    pub(super) fn weigh(
        &mut self,
        source: &WeightSource,
        skeleton: &Arc<Skeleton>,
        run: &Run,
    ) -> Result<Computed<Vec<String>>, StudioError> {
        let options = *source.options();
        let key = weight_key(&options, skeleton);
        let (mesh, joints) = (self.mesh.clone(), skeleton.clone());
        let weighed = self.weighing.get(&key, run, move |run| weighed(&mesh, &joints, &options, run))?;
        Ok(weighed.map(|(weights, notices)| {
            self.weights.put(key, Arc::new(weights));
            notices
        }))
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
        self.skins.made((skeleton.clone(), Same(weights.clone())), || {
            Skin::bound((**weights).clone(), skeleton).map_err(fault)
        })
    }

    /// Positions in a pose: the calls of the stage `character.pose`.
    ///
    /// # Errors
    /// What the method says.
    pub(super) fn positions(
        &mut self,
        of: &Following<'_>,
        globals: &[Matrix4<f64>],
        run: &Run,
    ) -> Result<Vec<Point3<f64>>, StudioError> {
        let matrices = of.skin.joint_matrices(globals).map_err(fault)?;
        let library = METHODS.iter().find(|m| m.0 == of.method).map(|m| m.1);
        let (skinned, weights) = if let Some(method) = library {
            let key = (Same(of.skin.clone()), of.method);
            let make = || Skinner::new(&self.mesh, None, of.skeleton, of.skin, method, run).map_err(fault);
            (self.skinners.made(key, make)?.positions(&matrices), of.weights.clone())
        } else {
            let bound = self.bound(of, run)?;
            (locked(&bound.skin).positions(&matrices), bound.weights.clone())
        };
        let skinned = skinned.map_err(fault)?;
        let Some(hold) = of.details else { return Ok(skinned) };
        let refiner = self.refiners.made((Same(weights.clone()), hold.to_bits()), || {
            DetailRefiner::new(&self.mesh, &weights, hold, run).map(Mutex::new).map_err(fault)
        })?;
        locked(&refiner).refined(skinned, &matrices, run).map_err(fault)
    }

    fn bound(&mut self, of: &Following<'_>, run: &Run) -> Result<Arc<Bound>, StudioError> {
        let trained = of.model.ok_or_else(|| StudioError::request("there is no trained model"))?;
        self.trained.made((trained.clone(), of.skeleton.clone()), || {
            let model = &trained.0.model;
            let refused = |e: RigFileError| StudioError::Method(format!("{}: {e}", trained.0.name));
            let weights = model.weights().for_skeleton(of.skeleton).map_err(fault)?;
            let skin = match model.bound(&self.mesh, of.skeleton, run) {
                Err(RigFileError::Character(error)) => return Err(fault(error)),
                bound => bound.map_err(refused)?,
            };
            Ok(Bound { skin: Mutex::new(skin), weights: Arc::new(weights) })
        })
    }
}

/// What nobody else holds.
fn locked<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

fn library_options(finding: &Finding) -> ExtractionOptions {
    let o = finding.options;
    ExtractionOptions {
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
    }
}

fn fitted(template: &Skeleton, curve: &CurveSkeleton, run: &Run) -> Result<Fitted, StudioError> {
    let fit = fit_template(template, curve, run).map_err(fault)?;
    let mut notices = Vec::new();
    let loose = fit.limbs.iter().filter(|limb| limb.stretch.is_none()).count();
    if loose > 0 {
        notices.push(format!("{loose} of {} limbs of the template are not on the curve", fit.limbs.len()));
    }
    if fit.ambiguous {
        notices.push("left and right look alike: look whether the sides are right".to_owned());
    }
    Ok((fit.skeleton, notices))
}

fn weighed(
    mesh: &TriMesh,
    skeleton: &Skeleton,
    options: &WeightOptions,
    run: &Run,
) -> Result<(SkinWeights, Vec<String>), StudioError> {
    let (weights, report) = bone_weights(mesh, skeleton, options, run).map_err(fault)?;
    let mut notices = Vec::new();
    if report.borrowed_vertices > 0 {
        let (vertices, parts) = (report.borrowed_vertices, report.borrowed_components);
        notices.push(format!("{vertices} vertices in {parts} parts see no bone; they follow the nearest that do"));
    }
    Ok((weights, notices))
}

/// A template by its name.
///
/// # Errors
/// [`StudioError::Request`] for an unknown one.
pub(super) fn template(name: &str) -> Result<Template, StudioError> {
    // The grid of its surface, which is not used, as coarse as it can be.
    const CELL: f64 = 0.1;
    match name {
        "humanoid" => Ok(Template { name: name.to_owned(), skeleton: humanoid(CELL).map_err(fault)?.skeleton }),
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
