//! Reading and writing the files of a character: `NAME.character.toml`, `.skeleton.json` (with the clips, and the library of poses as clips
//! of one key), `.weights.json`, `.pose.json`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value as Json;

use super::document::{
    CharacterDocument, ClipDocument, Finding, NamedCurve, NamedTarget, Offsets, PoseDocument, SkeletonSource,
    WeightSource, offsets, pose_of,
};
use super::message::{ExtractionOptions, SkinningMethod};
use super::pipeline_text::{PipelineText, beside};
use super::rig::fault;
use super::solve;
use crate::error::StudioError;
use crate::files::DocumentFiles;
use plumbline_app::stages::SkinningChoice;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;
use plumbline_shape::character::clip::rotations;
use plumbline_shape::character::io::{Rig, character_of};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::character::skinning::SkinningMethod as Method;
use plumbline_shape::character::weights::WeightOptions;
use plumbline_shape::character::{
    Character, Clip, Curve, Extrapolation, Interpolation, Joint, Keys, RigFileError, Skeleton, Skin, SkinWeights,
    WeightsFile,
};
use plumbline_shape::mesh::io::{WriteOptions, encode_model};
use plumbline_shape::mesh::{MeshFormat, Model, ReadLimits};

const MAX_PIPELINE_BYTES: u64 = 4 << 20;
const MAX_SIDE_BYTES: u64 = 1 << 28;
/// Names of clips that hold a pose of the library.
const POSE: &str = "pose/";

/// What is read when a document is opened.
pub(super) struct Opened {
    pub(super) document: CharacterDocument,
    pub(super) model: Model,
    pub(super) notices: Vec<String>,
}

/// The pipeline that was opened, or a new one for the mesh that was.
pub(super) fn pipeline(files: &DocumentFiles) -> Result<PipelineText, StudioError> {
    let opened = files.opened().to_owned();
    let is_pipeline = opened.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let path = if is_pipeline { opened.clone() } else { files.side_file(".character.toml") };
    match files.read(&path, MAX_PIPELINE_BYTES)? {
        Some(bytes) => {
            let text = std::str::from_utf8(&bytes)
                .map_err(|e| StudioError::Input { path: path.clone(), why: format!("is no text: {e}") })?;
            PipelineText::read(&path, text)
        }
        None if is_pipeline => {
            let mesh = mesh_beside(files).ok_or_else(|| StudioError::Input {
                path: path.clone(),
                why: "there is no such file, and no mesh of this name beside it".to_owned(),
            })?;
            PipelineText::begin(&path, &mesh, &files.side_file(".skeleton.json"))
        }
        None => PipelineText::begin(&path, &opened, &files.side_file(".skeleton.json")),
    }
}

/// The mesh that a character is begun for: of the same name as its pipeline file.
fn mesh_beside(files: &DocumentFiles) -> Option<PathBuf> {
    let endings = [".obj", ".ply", ".off", ".stl", ".glb", ".gltf"];
    endings.iter().map(|ending| files.side_file(ending)).find(|path| path.is_file())
}

/// Reads the document of a pipeline and its model.
pub(super) fn open(files: &DocumentFiles, pipeline: PipelineText, model: Model) -> Result<Opened, StudioError> {
    let settings = pipeline.settings().clone();
    if settings.model.is_some() {
        let why = "follows a trained model (`model`), which the studio cannot show yet".to_owned();
        return Err(StudioError::Input { path: pipeline.path().to_owned(), why });
    }
    let method = settings.skinning.method().unwrap_or_default();
    let options = WeightOptions { method: settings.binding, ..WeightOptions::default() };
    let mut document = CharacterDocument {
        skeleton: SkeletonSource::None,
        finding: Arc::new(default_finding()),
        weights: WeightSource::Computed(options),
        pose: Arc::default(),
        poses: Arc::default(),
        clips: Arc::default(),
        clip: settings.clip.clone(),
        skinning: super::message::METHODS
            .iter()
            .find(|m| m.1 == method)
            .map_or(SkinningMethod::DualQuaternion, |m| m.0),
        pipeline,
    };
    let mut notices = Vec::new();
    match skeleton_of_files(files, &document)? {
        Some(rig) => {
            document.skeleton = SkeletonSource::Made(Arc::new(rig.skeleton.clone()));
            add_movements(&mut document, rig)?;
        }
        None => own_rig(&mut document, &model, &mut notices)?,
    }
    if let SkeletonSource::Made(skeleton) = document.skeleton.clone() {
        side_files(files, &mut document, &model, &skeleton)?;
    }
    document.clip = settings.clip.or(document.clip.filter(|_| !document.clips.is_empty()));
    let still = model.with_articulation(None).map_err(|e| StudioError::Method(e.to_string()))?;
    Ok(Opened { document, model: still, notices })
}

fn default_finding() -> Finding {
    let o = plumbline_shape::character::extraction::ExtractionOptions::default();
    let options = ExtractionOptions {
        contraction: o.contraction,
        attraction: o.attraction,
        medial: o.medial,
        prune: o.prune,
        iterations: o.iterations as u32,
    };
    Finding { options, joints: None, ends: None, template: None }
}

/// The skeleton that the pipeline names; `None` where the file is not there yet.
fn skeleton_of_files(files: &DocumentFiles, document: &CharacterDocument) -> Result<Option<Rig>, StudioError> {
    let path = document.pipeline.skeleton();
    let Some(bytes) = files.read(path, MAX_SIDE_BYTES)? else { return Ok(None) };
    let input = |e: &dyn std::fmt::Display| StudioError::Input { path: path.to_owned(), why: e.to_string() };
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        let text = std::str::from_utf8(&bytes).map_err(|e| input(&e))?;
        let SkeletonFile { skeleton, clips, .. } = SkeletonFile::parse(text).map_err(|e| input(&e))?;
        return Ok(Some(Rig { skeleton, clips, warnings: Vec::new() }));
    }
    let rig = plumbline_shape::character::io::read_rig(&files.confined(path)?, &ReadLimits::default(), &Run::default());
    rig.map(Some).map_err(|e| input(&e))
}

/// Skeleton, skin and clips of the opened model, where it has them.
fn own_rig(document: &mut CharacterDocument, model: &Model, notices: &mut Vec<String>) -> Result<(), StudioError> {
    let character = match character_of(model) {
        Ok(character) => character,
        Err(RigFileError::NoSkin) => return Ok(()),
        Err(error) => return Err(StudioError::Method(error.to_string())),
    };
    let skeleton = in_bind_pose(&character)?;
    if !character.targets.is_empty() {
        notices.push(format!("{} morph targets are not edited here and not written", character.targets.len()));
    }
    let rig = Rig { skeleton: skeleton.clone(), clips: character.clips.clone(), warnings: Vec::new() };
    document.weights = WeightSource::Given(Arc::new(character.skin.weights().clone()), *document.weights.options());
    document.skeleton = SkeletonSource::Made(Arc::new(skeleton));
    super::edit::add_clips(document, &rig);
    Ok(())
}

/// The skeleton with its rest pose where the skin was bound.
fn in_bind_pose(character: &Character) -> Result<Skeleton, StudioError> {
    let joints = character.skeleton.joints();
    let inverse = character.skin.inverse_bind();
    let bound =
        |j: usize| inverse[j].try_inverse().ok_or_else(|| StudioError::Method("a joint is bound without size".into()));
    let joint = |(j, joint): (usize, &Joint)| -> Result<Joint, StudioError> {
        let above = joint.parent.map_or(nalgebra::Matrix4::identity(), |p| inverse[p as usize]);
        Ok(Joint { rest: Trs::from_matrix(&(above * bound(j)?)), ..joint.clone() })
    };
    Skeleton::new(joints.iter().enumerate().map(joint).collect::<Result<_, _>>()?).map_err(fault)
}

/// Weights, pose and clips.
fn side_files(
    files: &DocumentFiles,
    document: &mut CharacterDocument,
    model: &Model,
    skeleton: &Arc<Skeleton>,
) -> Result<(), StudioError> {
    let settings = document.pipeline.settings().clone();
    let text = |path: &Path| -> Result<Option<String>, StudioError> {
        let Some(bytes) = files.read(path, MAX_SIDE_BYTES)? else { return Ok(None) };
        let text = String::from_utf8(bytes.to_vec());
        text.map(Some).map_err(|e| StudioError::Input { path: path.to_owned(), why: format!("is no text: {e}") })
    };
    if let Some(path) = settings.weights.as_deref().map(PathBuf::from) {
        let input = |e: &dyn std::fmt::Display| StudioError::Input { path: path.clone(), why: e.to_string() };
        if let Some(text) = text(&path)? {
            let weights =
                WeightsFile::parse(&text).and_then(|f| Ok(f.for_skeleton(skeleton)?)).map_err(|e| input(&e))?;
            if weights.vertex_count() != model.mesh().vertex_count() {
                return Err(input(&format!(
                    "has {} rows for {} vertices",
                    weights.vertex_count(),
                    model.mesh().vertex_count()
                )));
            }
            document.weights = WeightSource::Given(Arc::new(weights), *document.weights.options());
        }
    }
    if let Some(path) = settings.pose.as_deref().map(PathBuf::from)
        && let Some(text) = text(&path)?
    {
        let character = rigged(document, model, skeleton)?;
        let pose = TargetPose::parse(&text, &character)
            .map_err(|e| StudioError::Input { path: path.clone(), why: e.to_string() })?;
        let name = |j: &u32| skeleton.joints()[*j as usize].name.clone();
        document.pose = Arc::new(PoseDocument {
            joints: offsets(skeleton, &pose.start),
            targets: pose.targets.into_iter().map(|t| NamedTarget::of(skeleton, t)).collect(),
            locked: pose.locked.iter().map(name).collect(),
        });
    }
    Ok(())
}

/// The character for readers and writers; all vertices follow the first joint where the weights are not known.
fn rigged(document: &CharacterDocument, model: &Model, skeleton: &Arc<Skeleton>) -> Result<Character, StudioError> {
    let weights = match &document.weights {
        WeightSource::Given(weights, _) => (**weights).clone(),
        WeightSource::Computed(_) => {
            SkinWeights::rigid(skeleton.joint_count(), &vec![0; model.mesh().vertex_count()]).map_err(fault)?
        }
    };
    character(model, skeleton, weights, document)
}

/// The character with its clips.
pub(super) fn character(
    model: &Model,
    skeleton: &Arc<Skeleton>,
    weights: SkinWeights,
    document: &CharacterDocument,
) -> Result<Character, StudioError> {
    let still = model.clone().with_articulation(None).map_err(|e| StudioError::Method(e.to_string()))?;
    let skin = Skin::bound(weights, skeleton).map_err(fault)?;
    let character = Character::new(still, (**skeleton).clone(), Arc::new(skin)).map_err(fault)?;
    let clips = clips(skeleton, document)?.into_iter().filter(|c| !c.tracks().is_empty()).collect();
    Ok(Character { clips, ..character })
}

fn clips(skeleton: &Skeleton, document: &CharacterDocument) -> Result<Vec<Clip>, StudioError> {
    document.clips.iter().map(|clip| solve::clip(skeleton, clip)).collect()
}

/// The clips of a file, and its library of poses.
fn add_movements(document: &mut CharacterDocument, mut rig: Rig) -> Result<(), StudioError> {
    let (poses, clips): (Vec<_>, Vec<_>) = rig.clips.drain(..).partition(|clip| clip.name().starts_with(POSE));
    rig.clips = clips;
    super::edit::add_clips(document, &rig);
    let library = |clip: &Clip| -> Result<(String, Arc<Offsets>), StudioError> {
        let pose = clip.pose(&rig.skeleton, 0.0, Extrapolation::Constant).map_err(fault)?;
        let name = clip.name().strip_prefix(POSE).unwrap_or_default().to_owned();
        Ok((name, Arc::new(offsets(&rig.skeleton, &pose))))
    };
    document.poses = Arc::new(poses.iter().map(library).collect::<Result<_, _>>()?);
    Ok(())
}

/// The library as clips of one key.
fn pose_clips(skeleton: &Skeleton, poses: &BTreeMap<String, Arc<Offsets>>) -> Result<Vec<Clip>, StudioError> {
    let clip = |(name, offsets): (&String, &Arc<Offsets>)| {
        let pose = pose_of(skeleton, offsets);
        let mut curves = Vec::new();
        for joint in offsets.keys().filter(|joint| skeleton.find(joint).is_some()) {
            let local = pose.locals[skeleton.find(joint).unwrap_or_default() as usize];
            let rotation = rotations(vec![0.0], &[local.rotation], Interpolation::Step).map_err(fault)?;
            let translation =
                Keys::new(vec![0.0], vec![local.translation.into()], Interpolation::Step).map_err(fault)?;
            for curve in [Curve::Rotation(rotation), Curve::Translation(translation)] {
                curves.push(Arc::new(NamedCurve { joint: joint.clone(), curve }));
            }
        }
        solve::clip(skeleton, &ClipDocument { name: format!("{POSE}{name}"), curves })
    };
    poses.iter().map(clip).collect()
}

/// Writes all files.
pub(super) fn save(
    document: &CharacterDocument,
    (skeleton, weights): (&Arc<Skeleton>, &Arc<SkinWeights>),
    files: &mut DocumentFiles,
) -> Result<(), StudioError> {
    let pipeline = document.pipeline.path().to_owned();
    let side = |ending: &str| {
        let name = pipeline.file_name().unwrap_or_default().to_string_lossy().into_owned();
        pipeline.with_file_name(format!("{}{ending}", name.split('.').next().unwrap_or_default()))
    };
    let named = |given: &Option<String>, ending: &str| given.as_ref().map_or_else(|| side(ending), PathBuf::from);
    let settings = document.pipeline.settings();
    let (pose, weights_file) = (named(&settings.pose, ".pose.json"), named(&settings.weights, ".weights.json"));
    let json = document.pipeline.skeleton().extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let skeleton_file = if json { document.pipeline.skeleton().to_owned() } else { side(".skeleton.json") };
    let mut clips = clips(skeleton, document)?;
    clips.extend(pose_clips(skeleton, &document.poses)?);
    let file = SkeletonFile { skeleton: (**skeleton).clone(), curve: None, clips };
    files.write(&skeleton_file, file.to_json().into_bytes());
    files.write(&weights_file, WeightsFile::of(skeleton, weights).map_err(fault)?.to_json().into_bytes());
    let mut changes =
        vec![("weights", Json::from(beside(&pipeline, &weights_file))), ("skinning", skinning(document.skinning))];
    if settings.clip.is_none() {
        let text = solve::target_pose(skeleton, &document.pose).to_json(skeleton).map_err(fault)?;
        files.write(&pose, text.into_bytes());
        changes.push(("pose", beside(&pipeline, &pose).into()));
    }
    let mut text = document.pipeline.with(&changes)?;
    if !json {
        text = text.with_skeleton(&skeleton_file)?;
    }
    files.write(&pipeline, text.text().as_bytes());
    Ok(())
}

/// The word of the pipeline file; null for the default.
fn skinning(method: SkinningMethod) -> Json {
    let method = super::message::METHODS.iter().find(|m| m.0 == method).map(|m| m.1);
    method
        .filter(|m| *m != Method::default())
        .map_or(Json::Null, |m| serde_json::to_value(SkinningChoice::Method(m)).unwrap_or_default())
}

/// A character as GLB, its joints in a pose.
pub(super) fn glb(
    character: &Character,
    pose: Option<&plumbline_shape::character::Pose>,
) -> Result<Vec<u8>, StudioError> {
    let model = character.to_model(pose).map_err(|e| StudioError::Method(e.to_string()))?;
    let bytes = encode_model(&model, MeshFormat::Glb, &WriteOptions::default(), &Run::default());
    bytes.map_err(|e| StudioError::Method(e.to_string()))
}
