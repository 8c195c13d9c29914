//! `character.pose`: a character in another pose, or in the poses of a movement.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use nalgebra::{Matrix4, Point3};
use serde_json::json;

use super::mesh::binding;
use super::posing::{MISSED, only, retargeted};
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::paths::to_path;
use plumbline_num::run::Run;
use plumbline_shape::character::ik::{Goal, IkMethod, IkSolution, Target, interpolate};
use plumbline_shape::character::io::{Rig, character_of};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::regression::{SkinModel, TrainedSkin};
use plumbline_shape::character::skinning::{Skinner, SkinningMethod};
use plumbline_shape::character::weights::WeightMethod;
use plumbline_shape::character::{
    Character, CharacterError, DetailRefiner, Extrapolation, Pose, RigFileError, Skeleton, Skin, SkinWeights,
};
use plumbline_shape::mesh::{Model, TriMesh};
use schemars::{Schema, SchemaGenerator};

/// How the surface follows the joints: a method, or a trained model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SkinningChoice {
    /// Regression by a trained model.
    Regression,
    /// A method of the library.
    #[serde(untagged)]
    Method(SkinningMethod),
}

impl SkinningChoice {
    /// The method; none where a trained model replaces it.
    pub fn method(self) -> Option<SkinningMethod> {
        if let Self::Method(method) = self { Some(method) } else { None }
    }
}

impl Default for SkinningChoice {
    fn default() -> Self {
        Self::Method(SkinningMethod::default())
    }
}

impl JsonSchema for SkinningChoice {
    fn schema_name() -> Cow<'static, str> {
        "SkinningChoice".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = SkinningMethod::json_schema(generator);
        if let Some(words) = schema.get_mut("oneOf").and_then(|words| words.as_array_mut()) {
            let about = "As a model has learnt from examples";
            words.push(json!({"type": "string", "const": "regression", "description": about}));
        }
        schema
    }
}

/// Settings of `character.pose`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PoseSettings {
    /// The pose: a pose file (JSON; `plumbline schema pose` describes it)
    #[schemars(extend("format" = "path"))]
    pub pose: Option<String>,
    /// The movement, by its name; of the file `motion_from` where one is given
    pub clip: Option<String>,
    /// A file whose movements the character takes: glTF, GLB, FBX, BVH or our own JSON
    #[schemars(extend("format" = "path"))]
    pub motion_from: Option<String>,
    /// Which joint follows which of `motion_from`, where names do not say (JSON; `plumbline schema joint-map` describes it)
    #[schemars(extend("format" = "path"))]
    pub map: Option<String>,
    /// How the surface follows the joints
    pub skinning: SkinningChoice,
    /// The trained model (.skin) for regression, of this mesh and skeleton
    #[schemars(extend("format" = "path"))]
    pub model: Option<String>,
    /// How a surface without a skin is bound to the skeleton
    pub binding: WeightMethod,
    /// A file of weights, which replaces `binding` (JSON; `plumbline schema weights` describes it)
    #[schemars(extend("format" = "path"))]
    pub weights: Option<String>,
    /// Keep the details that the surface has at rest, as they rotate with the joints; the number is the weight of the skinned surface: 1
    /// as much as that of neighbors, less lets it deviate further
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub details: Option<f64>,
    /// Poses: of a movement from its start to its end, of a pose file from rest to the pose; 1: the last alone
    #[schemars(range(min = 1, max = 9999))]
    pub frames: u32,
    /// Begin of the animation, seconds; its first key if left out
    pub start: Option<f64>,
    /// End of the animation, seconds; its last key if left out
    pub end: Option<f64>,
    /// Joints that keep the world position and orientation that they have before the rotations of the pose file, while its
    /// targets are sought, such as feet
    pub pin: Vec<String>,
    /// How the targets of a pose file are sought
    pub ik: IkMethod,
    /// Steps toward the targets of a pose file, at most
    #[schemars(range(min = 1, max = 100_000))]
    pub iterations: u32,
    /// The output keeps its skeleton and movements, and is in the pose by its joints: for .glb and .gltf, which are then
    /// shown with linear blend
    pub rig: bool,
}

impl Default for PoseSettings {
    fn default() -> Self {
        Self {
            pose: None,
            clip: None,
            motion_from: None,
            map: None,
            skinning: SkinningChoice::default(),
            model: None,
            binding: WeightMethod::default(),
            weights: None,
            details: None,
            frames: 1,
            start: None,
            end: None,
            pin: Vec::new(),
            ik: IkMethod::default(),
            iterations: 200,
            rig: false,
        }
    }
}

impl Stage for PoseSettings {
    const KIND: &'static str = "character.pose";
    const ALIASES: &'static [&'static str] = &["pose"];
    const SUMMARY: &'static str = "puts a character into a pose, or through a movement";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the surface: with a skin, or to be bound to the skeleton"),
        Port::optional("skeleton", PortType::Skeleton, "the skeleton, where the file of the surface has none"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the surface in its poses")];
    type Input = (Posed, Option<Arc<Rig>>);
    type Output = (Posed,);

    fn conflicts(&self) -> Vec<Conflict> {
        let conflict = |key, message: &str, help| Conflict { key, message: message.to_owned(), help };
        let mut found = Vec::new();
        if self.pose.is_some() && self.clip.is_some() {
            let help = "name the clip in the pose file (`from`), or leave one out";
            found.push(conflict("clip", "a pose file and a clip are both given", help));
        }
        if self.pose.is_some() && self.motion_from.is_some() {
            found.push(conflict("motion_from", "a pose file and a motion are both given", "leave one out"));
        }
        if self.map.is_some() && self.motion_from.is_none() {
            let help = "give `motion_from`, or leave out `map`";
            found.push(conflict("map", "a map of joints belongs to a motion of another skeleton", help));
        }
        if self.rig && self.frames > 1 {
            found.push(conflict(
                "rig",
                "a rig is one file, and several frames are asked for",
                "leave out `frames` or `rig`",
            ));
        }
        if (self.skinning == SkinningChoice::Regression) != self.model.is_some() {
            let help = "give `skinning = \"regression\"` and `model`, or neither";
            found.push(conflict("model", "regression and a trained model belong together", help));
        }
        if self.rig && self.model.is_some() {
            found.push(conflict("rig", "a rig follows its joints by linear blend", "leave out `rig` or `model`"));
        }
        for (key, time) in [("start", self.start), ("end", self.end)] {
            if let Some(time) = time.filter(|t| !t.is_finite()) {
                found.push(conflict(key, &format!("{time} is no time"), "give a number of seconds"));
            }
        }
        if let (Some(start), Some(end)) = (self.start, self.end)
            && !(start <= end)
        {
            found.push(conflict("end", "it is before the start", "give an `end` that is not before `start`"));
        }
        found
    }

    fn reads(&self) -> Vec<&str> {
        let files = self.pose.iter().chain(&self.model).chain(&self.weights);
        files.chain(&self.motion_from).chain(&self.map).map(String::as_str).collect()
    }

    fn run(&self, (surface, rig): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let file = self.model.as_deref().map(to_path);
        let trained = file.as_deref().map(Trained::read).transpose()?;
        let mut character = character(context, &surface.model, rig.as_deref(), trained.as_ref(), self)?;
        let clip = match self.motion_from.as_deref().map(to_path) {
            None => self.clip.clone(),
            Some(source) => {
                let map = self.map.as_deref().map(to_path);
                let carried = retargeted(context, &character, &source, map.as_deref(), self.clip.as_deref())?;
                let shown = only(&carried, self.rig)?;
                character.prepend_clips(carried);
                shown
            }
        };
        let wanted = poses(context, &character, clip.as_deref(), self)?;
        let posed = if self.rig {
            let last = wanted.last().map(|(pose, _)| pose);
            // A movement is shown from rest; a pose is the state of the joints.
            let shown = if self.pose.is_some() { last } else { None };
            let model = character.to_model(shown).map_err(|e| RunError::Internal(e.to_string()))?;
            Posed::at_rest(model)
        } else {
            let positions = skinned(context, &character, &wanted, trained.as_ref(), self)?;
            Posed { model: Arc::new(character.model), poses: Arc::new(positions), handles: Arc::default() }
        };
        Ok((posed,))
    }
}

/// The surface with its own skin, or bound to the skeleton that is given.
fn character(
    context: &mut Context<'_, '_>,
    model: &Model,
    rig: Option<&Rig>,
    trained: Option<&Trained<'_>>,
    settings: &PoseSettings,
) -> Result<Character, RunError> {
    let Some(rig) = rig else {
        let character = character_of(model).map_err(|e| match e {
            RigFileError::NoSkin => RunError::Input(format!("{e}; `--skeleton` (the input `skeleton`) names one")),
            other => RunError::Input(other.to_string()),
        })?;
        let known = model.warnings();
        character.warnings.iter().filter(|w| !known.contains(w)).for_each(|w| context.warn(w.clone()));
        return Ok(character);
    };
    let weights = match trained {
        Some(trained) => trained.weights(model.mesh(), &rig.skeleton)?,
        None => binding::weights(context, model.mesh(), &rig.skeleton, settings.binding, settings.weights.as_ref())?,
    };
    let skin = Skin::bound(weights, &rig.skeleton)?;
    let still = model.clone().with_articulation(None).map_err(|e| RunError::Internal(e.to_string()))?;
    let character = Character::new(still, rig.skeleton.clone(), Arc::new(skin))?;
    Ok(Character { clips: rig.clips.clone(), ..character })
}

/// A pose and the weights of the morph targets.
type Wanted = (Pose, Vec<f64>);

fn poses(
    context: &mut Context<'_, '_>,
    character: &Character,
    clip: Option<&str>,
    settings: &PoseSettings,
) -> Result<Vec<Wanted>, RunError> {
    let rest = || (character.skeleton.rest_pose(), character.rest_weights());
    let fraction = |k: u32| if settings.frames <= 1 { 1.0 } else { f64::from(k) / f64::from(settings.frames - 1) };
    if let Some(path) = settings.pose.as_deref().map(Path::new) {
        // A pose file: solve for its targets once, then interpolate from rest.
        let wanted = TargetPose::read(path, character);
        let mut wanted = wanted.map_err(|e| RunError::Input(e.to_string()).about(path.display()))?;
        for name in &settings.pin {
            wanted.pin(&character.skeleton, character.skeleton.named(name)?)?;
        }
        let found = wanted.solve(character, settings.ik, settings.iterations as usize, &context.job.run());
        let found = found.map_err(|e| RunError::from(e).about(path.display()))?;
        for missed in missed(&wanted, &found, character) {
            context.warn(format!("{}: {missed}", path.display()));
        }
        let (from, weights) = rest();
        let pose = |k: u32| {
            let pose = interpolate(&character.skeleton, &from, &found.pose, fraction(k))
                .map_err(|e| RunError::Internal(e.to_string()))?;
            let mixed = weights.iter().zip(&wanted.weights).map(|(a, b)| a + (b - a) * fraction(k)).collect();
            Ok((pose, mixed))
        };
        return (0..settings.frames).map(pose).collect();
    }
    // A movement: sample it. Neither: the character at rest.
    let Some(name) = clip else { return Ok(vec![rest(); settings.frames as usize]) };
    let refused = |e: &dyn std::fmt::Display| RunError::Input(e.to_string());
    let clip = character.clip(name).map_err(|e| refused(&e))?;
    let (first, last) = clip.span().unwrap_or((0.0, 0.0));
    let (start, end) = (settings.start.unwrap_or(first), settings.end.unwrap_or(last));
    let pose = |k: u32| {
        let time = start + (end - start) * fraction(k);
        let pose = clip.pose(&character.skeleton, time, Extrapolation::Constant).map_err(|e| refused(&e))?;
        Ok((pose, clip.weights(&character.rest_weights(), time, Extrapolation::Constant).map_err(|e| refused(&e))?))
    };
    (0..settings.frames).map(pose).collect()
}

/// Targets out of reach, with their distance.
fn missed(wanted: &TargetPose, found: &IkSolution, character: &Character) -> Vec<String> {
    let diagonal = character.model.mesh().diagonal();
    let of = |(k, (target, residual)): (usize, (&Target, &f64))| {
        let (limit, unit) =
            if let Goal::Position { .. } = target.goal { (MISSED * diagonal, "units") } else { (MISSED, "rad") };
        let joint = &character.skeleton.joints()[target.joint as usize].name;
        let what = if k < wanted.targets.len() {
            format!("target {k} of joint {joint:?}")
        } else {
            format!("pinned joint {joint:?}")
        };
        (*residual > limit).then(|| format!("{what} is missed by {residual:.3} {unit}"))
    };
    wanted.all_targets().iter().zip(&found.residuals).enumerate().filter_map(of).collect()
}

/// A model of a file.
struct Trained<'a> {
    path: &'a Path,
    model: SkinModel,
}

impl<'a> Trained<'a> {
    fn read(path: &'a Path) -> Result<Self, RunError> {
        let model = SkinModel::read(path).map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
        Ok(Self { path, model })
    }

    fn refused(&self, error: &dyn std::fmt::Display) -> RunError {
        RunError::Input(format!("{}: {error}", self.path.display()))
    }

    /// The weights that fitted its examples best.
    fn weights(&self, mesh: &TriMesh, skeleton: &Skeleton) -> Result<SkinWeights, RunError> {
        self.model.check(mesh, skeleton).map_err(|e| self.refused(&e))?;
        self.model.weights().for_skeleton(skeleton).map_err(|e| self.refused(&e))
    }
}

/// What puts the surface into a pose.
enum Follower {
    Blend(Box<Skinner>, SkinningMethod),
    /// With the weights of the morph targets that its surface at rest has.
    Trained(Box<TrainedSkin>, Vec<f64>),
}

impl Follower {
    fn new(
        character: &Character,
        trained: Option<&Trained<'_>>,
        settings: &PoseSettings,
        run: &Run,
    ) -> Result<Self, RunError> {
        let mesh = character.model.mesh();
        match (settings.skinning.method(), trained) {
            (Some(method), _) => Ok(Self::Blend(Box::new(blend(character, mesh, method, run)?), method)),
            (None, None) => Err(RunError::Usage("regression needs a trained skin (`model`)".to_owned())),
            (None, Some(file)) => {
                let bound = file.model.bound(mesh, &character.skeleton, run).map_err(|e| file.refused(&e))?;
                Ok(Self::Trained(Box::new(bound), vec![0.0; character.targets.len()]))
            }
        }
    }

    /// Positions in a pose, with weights of the morph targets.
    fn positions(
        &mut self,
        character: &Character,
        matrices: &[Matrix4<f64>],
        morphs: &[f64],
        run: &Run,
    ) -> Result<Vec<Point3<f64>>, RunError> {
        let morphed = morphs.iter().any(|w| *w != 0.0);
        match self {
            Self::Trained(trained, at_rest) => {
                if at_rest.as_slice() != morphs {
                    trained.set_rest(&character.morphed(morphs)?, run)?;
                    morphs.clone_into(at_rest);
                }
                Ok(trained.positions(matrices)?)
            }
            Self::Blend(skinner, _) if !morphed => Ok(skinner.positions(matrices)?),
            Self::Blend(_, method) => {
                let positions = character.morphed(morphs)?;
                let mesh =
                    character.model.mesh().with_positions(positions).map_err(|e| RunError::Input(e.to_string()))?;
                Ok(blend(character, &mesh, *method, run)?.positions(matrices)?)
            }
        }
    }
}

fn blend(character: &Character, mesh: &TriMesh, method: SkinningMethod, run: &Run) -> Result<Skinner, CharacterError> {
    Skinner::new(mesh, None, &character.skeleton, &character.skin, method, run)
}

/// Positions of the surface in each pose.
fn skinned(
    context: &Context<'_, '_>,
    character: &Character,
    wanted: &[Wanted],
    trained: Option<&Trained<'_>>,
    settings: &PoseSettings,
) -> Result<Vec<Vec<Point3<f64>>>, RunError> {
    let skin = &character.skin;
    let mut follower = Follower::new(character, trained, settings, &context.job.run())?;
    let refiner = |weight| DetailRefiner::new(character.model.mesh(), skin.weights(), weight, &context.job.run());
    let mut refiner = settings.details.map(refiner).transpose()?;
    let mut positions = Vec::with_capacity(wanted.len());
    for (pose, morphs) in wanted {
        context.job.check_cancel()?;
        let matrices = skin.joint_matrices(&character.skeleton.globals(pose)?)?;
        let skinned = follower.positions(character, &matrices, morphs, &context.job.run())?;
        positions.push(match &mut refiner {
            Some(refiner) => refiner.refined(skinned, &matrices, &context.job.run())?,
            None => skinned,
        });
    }
    Ok(positions)
}
