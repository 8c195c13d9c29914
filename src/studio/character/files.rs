//! Reading and writing the files of a character: `NAME.character.toml`, `.skeleton.json` (with the clips; the library of poses, and poses
//! that are not keyed, as clips of one key), `.weights.json`, `.pose.json`, and `.skin` where a trained skin was imported.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value as Json;

use super::document::{
    CharacterDocument, ClipDocument, Finding, NamedCurve, NamedTarget, Offset, Offsets, PoseDocument, Same,
    SkeletonSource, Trained, Unkeyed, WeightSource, offsets,
};
use super::message::{ExtractionOptions, SkinningMethod};
use super::pipeline_text::{PipelineText, beside};
use super::rig::fault;
use super::solve;
use crate::error::StudioError;
use crate::files::DocumentFiles;
use plumbline_app::pipeline::paths::to_path;
use plumbline_app::stages::SkinningChoice;
use plumbline_num::math::Trs;
use plumbline_num::run::Run;
use plumbline_shape::character::clip::rotations;
use plumbline_shape::character::io::{Rig, character_of};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::regression::SkinModel;
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
pub(super) const MAX_SIDE_BYTES: u64 = 1 << 28;
/// Of a trained skin: that of a million triangles.
pub(super) const MAX_MODEL_BYTES: u64 = 1 << 29;
/// Names of clips that hold a pose of the library.
pub(super) const POSE: &str = "pose/";
/// Names of clips that hold what is not keyed of another clip.
pub(super) const UNKEYED: &str = "unkeyed/";

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
    let endings = [".obj", ".ply", ".off", ".stl", ".glb", ".gltf", ".fbx"];
    endings.iter().map(|ending| files.side_file(ending)).find(|path| path.is_file())
}

/// Reads the document of a pipeline and its model.
pub(super) fn open(files: &DocumentFiles, pipeline: PipelineText, model: Model) -> Result<Opened, StudioError> {
    let settings = pipeline.settings().clone();
    let options = WeightOptions { method: settings.binding, ..WeightOptions::default() };
    let mut document = CharacterDocument {
        skeleton: SkeletonSource::None,
        finding: Arc::new(default_finding()),
        weights: WeightSource::Computed(options),
        pose: Arc::default(),
        poses: Arc::default(),
        clips: Arc::default(),
        clip: settings.clip.clone(),
        skinning: shown_method(settings.skinning),
        model: None,
        pipeline,
    };
    let mut notices = Vec::new();
    match skeleton_of_files(files, &document)? {
        OnDisk::Rig(rig) => {
            document.skeleton = SkeletonSource::Made(Arc::new(rig.skeleton.clone()));
            add_movements(&mut document, *rig)?;
        }
        OnDisk::NoJoints => {}
        OnDisk::Nothing => own_rig(&mut document, &model, &mut notices)?,
    }
    if let SkeletonSource::Made(skeleton) = document.skeleton.clone() {
        side_files(files, &mut document, &model, &skeleton)?;
        document.model = trained(files, &document, &model, &skeleton, &mut notices)?;
    }
    document.clip = settings.clip.or(document.clip.filter(|_| !document.clips.is_empty()));
    let still = model.with_articulation(None).map_err(|e| StudioError::Method(e.to_string()))?;
    Ok(Opened { document, model: still, notices })
}

/// The method of the page.
fn shown_method(choice: SkinningChoice) -> SkinningMethod {
    let Some(method) = choice.method() else { return SkinningMethod::Regression };
    super::message::METHODS.iter().find(|m| m.1 == method).map_or(SkinningMethod::DualQuaternion, |m| m.0)
}

/// The trained skin: the one that the pipeline follows, which must fit, or one that was kept beside it.
fn trained(
    files: &DocumentFiles,
    document: &CharacterDocument,
    model: &Model,
    skeleton: &Skeleton,
    notices: &mut Vec<String>,
) -> Result<Option<Same<Trained>>, StudioError> {
    let named = document.pipeline.settings().model.as_deref().map(to_path);
    let path = named.clone().unwrap_or_else(|| files.side_file(".skin"));
    let input = |why: String| StudioError::Input { path: path.clone(), why };
    let read = || -> Result<Option<Same<Trained>>, StudioError> {
        let Some(bytes) = files.read(&path, MAX_MODEL_BYTES)? else { return Ok(None) };
        let found = SkinModel::from_bytes(&bytes).map_err(|e| input(e.to_string()))?;
        found.check(model.mesh(), skeleton).map_err(|e| input(e.to_string()))?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        Ok(Some(Same(Arc::new(Trained { file: Some(path.clone()), name, model: found }))))
    };
    match (named.is_some(), read()) {
        (true, Ok(None)) => Err(input("there is no such file".to_owned())),
        (false, Err(error)) => {
            notices.push(format!("{error}; it is left out"));
            Ok(None)
        }
        (_, read) => read,
    }
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

/// What the file of the skeleton has.
enum OnDisk {
    /// It is not there yet.
    Nothing,
    /// All joints were deleted ([`NO_JOINTS`]).
    NoJoints,
    Rig(Box<Rig>),
}

/// The file of a skeleton whose joints were all deleted: where there is none, a model's own skeleton counts.
const NO_JOINTS: &str = "{\"format\": \"plumbline.skeleton\", \"version\": 1, \"joints\": []}\n";

/// The skeleton that the pipeline names.
fn skeleton_of_files(files: &DocumentFiles, document: &CharacterDocument) -> Result<OnDisk, StudioError> {
    let path = document.pipeline.skeleton();
    let Some(bytes) = files.read(path, MAX_SIDE_BYTES)? else { return Ok(OnDisk::Nothing) };
    if &*bytes == NO_JOINTS.as_bytes() {
        return Ok(OnDisk::NoJoints);
    }
    let input = |e: &dyn std::fmt::Display| StudioError::Input { path: path.to_owned(), why: e.to_string() };
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) {
        let text = std::str::from_utf8(&bytes).map_err(|e| input(&e))?;
        let SkeletonFile { skeleton, clips, .. } = SkeletonFile::parse(text).map_err(|e| input(&e))?;
        return Ok(OnDisk::Rig(Box::new(Rig { skeleton, clips, warnings: Vec::new() })));
    }
    let rig = plumbline_shape::character::io::read_rig(&files.confined(path)?, &ReadLimits::default(), &Run::default());
    rig.map(|rig| OnDisk::Rig(Box::new(rig))).map_err(|e| input(&e))
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
    if let Some(path) = settings.weights.as_deref().map(to_path) {
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
    // Where a run writes a movement, the pose is kept beside it.
    let beside = settings.clip.as_ref().map(|_| files.side_file(".pose.json"));
    if let Some(path) = settings.pose.as_deref().map(to_path).or(beside)
        && let Some(text) = text(&path)?
    {
        let character = rigged(document, model, skeleton)?;
        let pose = TargetPose::parse(&text, &character)
            .map_err(|e| StudioError::Input { path: path.clone(), why: e.to_string() })?;
        let name = |j: &u32| skeleton.joints()[*j as usize].name.clone();
        document.pose = Arc::new(PoseDocument {
            joints: offsets(skeleton, &pose.start),
            targets: pose.all_targets().into_iter().map(|t| NamedTarget::of(skeleton, t)).collect(),
            locked: pose.locked.iter().map(name).collect(),
        });
    }
    Ok(())
}

/// The character for readers and writers; all vertices follow the first joint where the weights are not known.
pub(super) fn rigged(
    document: &CharacterDocument,
    model: &Model,
    skeleton: &Arc<Skeleton>,
) -> Result<Character, StudioError> {
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
    let (unkeyed, clips): (Vec<_>, Vec<_>) = clips.into_iter().partition(|clip| clip.name().starts_with(UNKEYED));
    rig.clips = clips;
    super::edit::add_clips(document, &rig);
    for clip in Arc::make_mut(&mut document.clips) {
        let of = |other: &&Clip| other.name().strip_prefix(UNKEYED) == Some(&clip.name);
        if let Some(found) = unkeyed.iter().find(of) {
            Arc::make_mut(clip).unkeyed = unkeyed_of(&rig.skeleton, found);
        }
    }
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
    let clip = |(name, offsets): (&String, &Arc<Offsets>)| held(skeleton, format!("{POSE}{name}"), &[(0.0, offsets)]);
    poses.iter().map(clip).collect()
}

/// What is not keyed as clips beside those that it belongs to.
fn unkeyed_clips(skeleton: &Skeleton, clips: &[Arc<ClipDocument>]) -> Result<Vec<Clip>, StudioError> {
    let clip = |clip: &Arc<ClipDocument>| {
        let poses: Vec<(f64, &Offsets)> = clip.unkeyed.iter().map(|pose| (pose.time, &pose.joints)).collect();
        held(skeleton, format!("{UNKEYED}{}", clip.name), &poses)
    };
    clips.iter().filter(|clip| !clip.unkeyed.is_empty()).map(clip).collect()
}

/// A clip that holds poses at times: of each joint that a pose has a key of its rotation and one of its translation.
fn held(skeleton: &Skeleton, name: String, poses: &[(f64, &Offsets)]) -> Result<Clip, StudioError> {
    let mut curves = Vec::new();
    for joint in skeleton.joints() {
        let keyed =
            poses.iter().filter_map(|(time, offsets)| Some((*time, offsets.get(&joint.name)?.apply(&joint.rest))));
        let (times, locals): (Vec<f64>, Vec<Trs>) = keyed.unzip();
        if times.is_empty() {
            continue;
        }
        let turned: Vec<_> = locals.iter().map(|local| local.rotation).collect();
        let moved = locals.iter().map(|local| local.translation.into()).collect();
        let rotation = rotations(times.clone(), &turned, Interpolation::Step).map_err(fault)?;
        let translation = Keys::new(times, moved, Interpolation::Step).map_err(fault)?;
        for curve in [Curve::Rotation(rotation), Curve::Translation(translation)] {
            curves.push(Arc::new(NamedCurve { joint: joint.name.clone(), curve }));
        }
    }
    solve::clip(skeleton, &ClipDocument { name, curves, unkeyed: Vec::new() })
}

/// The poses that a clip holds.
fn unkeyed_of(skeleton: &Skeleton, clip: &Clip) -> Vec<Unkeyed> {
    let mut poses: Vec<Unkeyed> = Vec::new();
    for track in clip.tracks() {
        let joint = &skeleton.joints()[track.joint as usize];
        for (k, &time) in track.curve.times().iter().enumerate() {
            let at = poses.partition_point(|pose| pose.time < time);
            if poses.get(at).is_none_or(|pose| pose.time > time) {
                poses.insert(at, Unkeyed { time, joints: Offsets::new() });
            }
            let rest = Offset::between(&joint.rest, &joint.rest);
            let offset = poses[at].joints.entry(joint.name.clone()).or_insert(rest);
            match &track.curve {
                Curve::Rotation(keys) => offset.rotation = joint.rest.rotation.inverse() * keys.key(k),
                Curve::Translation(keys) => {
                    offset.translation = nalgebra::Vector3::from(keys.values()[k]) - joint.rest.translation;
                }
                Curve::Scale(_) => {}
            }
        }
    }
    poses
}

/// Writes the files of a document without a skeleton.
pub(super) fn save_without_skeleton(
    document: &CharacterDocument,
    files: &mut DocumentFiles,
) -> Result<(), StudioError> {
    let (pipeline, skeleton) = (&document.pipeline, skeleton_file(&document.pipeline));
    files.write(&skeleton, NO_JOINTS.as_bytes());
    let text = if pipeline.skeleton() == skeleton { pipeline.clone() } else { pipeline.with_skeleton(&skeleton)? };
    files.write(pipeline.path(), text.text().as_bytes());
    Ok(())
}

/// `NAME` + `ending` beside the pipeline file `NAME.character.toml`.
fn side(pipeline: &Path, ending: &str) -> PathBuf {
    let name = pipeline.file_name().unwrap_or_default().to_string_lossy().into_owned();
    pipeline.with_file_name(format!("{}{ending}", name.split('.').next().unwrap_or_default()))
}

/// The file of the skeleton: the one that was read where it is our JSON.
fn skeleton_file(pipeline: &PipelineText) -> PathBuf {
    let json = pipeline.skeleton().extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if json { pipeline.skeleton().to_owned() } else { side(pipeline.path(), ".skeleton.json") }
}

/// Writes all files.
pub(super) fn save(
    document: &CharacterDocument,
    (skeleton, weights): (&Arc<Skeleton>, &Arc<SkinWeights>),
    files: &mut DocumentFiles,
) -> Result<(), StudioError> {
    let pipeline = document.pipeline.path().to_owned();
    let named = |given: &Option<String>, ending| given.as_deref().map_or_else(|| side(&pipeline, ending), to_path);
    let settings = document.pipeline.settings();
    let (pose, weights_file) = (named(&settings.pose, ".pose.json"), named(&settings.weights, ".weights.json"));
    let skeleton_file = skeleton_file(&document.pipeline);
    let mut clips = clips(skeleton, document)?;
    clips.extend(pose_clips(skeleton, &document.poses)?);
    clips.extend(unkeyed_clips(skeleton, &document.clips)?);
    let file = SkeletonFile { skeleton: (**skeleton).clone(), curve: None, proposed_names: None, clips };
    files.write(&skeleton_file, file.to_json().into_bytes());
    files.write(&weights_file, WeightsFile::of(skeleton, weights).map_err(fault)?.to_json().into_bytes());
    let model = save_model(document, &side(&pipeline, ".skin"), files);
    let model = model.map_or(Json::Null, |path| beside(&pipeline, &path).into());
    let mut changes = vec![
        ("weights", Json::from(beside(&pipeline, &weights_file))),
        ("skinning", skinning(document.skinning)),
        ("model", model),
    ];
    let text = solve::target_pose(skeleton, &document.pose).to_json(skeleton).map_err(fault)?;
    files.write(&pose, text.into_bytes());
    if settings.clip.is_none() {
        changes.push(("pose", beside(&pipeline, &pose).into()));
    }
    let mut text = document.pipeline.with(&changes)?;
    if text.skeleton() != skeleton_file {
        text = text.with_skeleton(&skeleton_file)?;
    }
    files.write(&pipeline, text.text().as_bytes());
    Ok(())
}

/// Keeps the trained skin in a file beside the document, unless it is in the file that the pipeline names. Gives the file that the
/// pipeline follows.
fn save_model(document: &CharacterDocument, beside: &Path, files: &mut DocumentFiles) -> Option<PathBuf> {
    let trained = &document.model.as_ref()?.0;
    let follows = document.skinning == SkinningMethod::Regression;
    let path = trained.file.as_deref().filter(|_| follows).unwrap_or(beside);
    if trained.file.as_deref() != Some(path) {
        files.write(path, trained.model.to_bytes());
    }
    follows.then(|| path.to_owned())
}

/// The word of the pipeline file; null for the default.
fn skinning(method: SkinningMethod) -> Json {
    if method == SkinningMethod::Regression {
        return serde_json::to_value(SkinningChoice::Regression).unwrap_or_default();
    }
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
