//! `skin.train`: how a surface follows a skeleton, learnt from poses that it is known in.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Matrix4, Point3};
use serde_json::{Value as Json, json};

use super::character_pose::PoseSettings;
use super::mesh::{binding, mesh_error};
use super::prelude::*;
use super::values::{Posed, not_finite};
use crate::pipeline::items::{MESH_EXTENSIONS, Search, is_glob};
use crate::pipeline::paths::to_path;
use plumbline_num::run::Run;
use plumbline_shape::character::ik::IkMethod;
use plumbline_shape::character::io::{Rig, character_of};
use plumbline_shape::character::pose_file::TargetPose;
use plumbline_shape::character::regression::{
    Example, Reduced, RegressionModel, RegressionOptions, SkinModel, fit_joints, tuned,
};
use plumbline_shape::character::weights::WeightMethod;
use plumbline_shape::character::{Character, CharacterError, RigFileError, Skeleton, Skin, SkinWeights};
use plumbline_shape::mesh::{Model, TriMesh, read_model};

/// Settings of `skin.train`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SkinTrainSettings {
    /// Meshes of the same vertices and faces in other poses: files, globs or folders; those of `held_out` are left out
    #[schemars(extend("format" = "path"))]
    pub examples: Vec<String>,
    /// Meshes for held-out validation: the model is not trained on them
    #[schemars(extend("format" = "path"))]
    pub held_out: Vec<String>,
    /// Pose files called as the meshes, with the joints of each; from the meshes themselves if left out
    #[schemars(extend("format" = "path"))]
    pub poses: Vec<String>,
    /// How the surface is bound to the skeleton, which says which joint each triangle belongs to; a mesh with a skin of its own
    /// stays bound as it is, unless a skeleton is given
    pub binding: WeightMethod,
    /// A file of weights, which replaces `binding`
    #[schemars(extend("format" = "path"))]
    pub weights: Option<String>,
    /// Ridge on what is learnt of the joints' rotations, rad²: larger trusts the examples less; found by leaving examples out if left
    /// out
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub ridge: Option<f64>,
    /// Weight of linear blending against what triangles have learnt: details longer than √(area / hold) follow it; found
    /// by leaving examples out if left out
    #[schemars(range(min = 1e-3, max = 1e9))]
    pub hold: Option<f64>,
    /// Keep so many shapes for each joint in the mean, where they are needed most, in place of all triangles: poses without a
    /// solve
    #[schemars(range(min = 1, max = 32))]
    pub prototypes: Option<u32>,
    /// The file of the model to write, .skin
    #[schemars(extend("format" = "path"))]
    pub path: String,
    /// Also write a report: NAME.html or NAME.json
    #[schemars(extend("format" = "path", "report" = true))]
    pub report: Option<String>,
}

impl Stage for SkinTrainSettings {
    const KIND: &'static str = "skin.train";
    const SUMMARY: &'static str = "learns from poses of a surface how it follows a skeleton";
    const INPUTS: &'static [Port] = &[
        Port::one("mesh", PortType::Mesh, "the mesh at rest"),
        Port::optional("skeleton", PortType::Skeleton, "the skeleton in it, where the file of the mesh has none"),
    ];
    const OUTPUTS: &'static [Port] = &[Port::one("file", PortType::File, "the file")];
    const REQUIRED: &'static [&'static str] = &["examples", "path"];
    type Input = (Posed, Option<Arc<Rig>>);
    type Output = (Written,);

    fn reads(&self) -> Vec<&str> {
        let lists = self.examples.iter().chain(&self.held_out).chain(&self.poses);
        // What folders and globs mean is found when it is read.
        let files = lists.filter(|name| !is_glob(name) && !to_path(name).is_dir());
        files.chain(&self.weights).map(String::as_str).collect()
    }

    fn writes(&self) -> Vec<String> {
        std::iter::once(&self.path).chain(&self.report).cloned().collect()
    }

    fn run(&self, (posed, rig): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        // The examples, and those for validation.
        let (kept, validation) = files(self)?;
        let subject = subject(context, &posed, rig.as_deref(), self)?;
        let (kept, validation) =
            (examples(&subject, &kept, self, context)?, examples(&subject, &validation, self, context)?);
        context.job.check_cancel()?;
        let examples: Vec<Example> = kept.iter().map(|e| e.example.clone()).collect();
        let (mesh, skeleton) = (subject.model.mesh(), &subject.skeleton);
        // Train with the regularization weights given or found.
        let options = options(&subject, &examples, self, &context.job.run())?;
        context.job.check_cancel()?;
        let (full, _) =
            RegressionModel::train(mesh, skeleton, &subject.weights, &examples, &options, &context.job.run())?;
        // Reduce the model where prototypes are asked for, then measure both kinds of examples.
        let linear = full.clone();
        let (mut model, file) = form(&subject, full, &examples, self.prototypes, &context.job.run())?;
        let (kept, validation) = (errors(&mut model, &linear, kept)?, errors(&mut model, &linear, validation)?);
        if let Some(surface) = &mut context.summary.surface {
            surface.training = Some(error_line(&kept, &validation, mesh.diagonal()));
        }
        context.write_file(&to_path(&self.path), file.to_bytes())?;
        // The report.
        let Some(path) = &self.report else { return Ok((Written,)) };
        let prototypes = if let Trained::Reduced(reduced) = &model { Some(reduced.shape_count()) } else { None };
        let report = json!({
            "version": 1,
            "joints": skeleton.joint_count(),
            "diagonal": mesh.diagonal(),
            "ridge": options.ridge,
            "hold": options.hold,
            "found_by_leaving_out": self.ridge.is_none() || self.hold.is_none(),
            "prototypes": prototypes,
            "examples": entries(&kept),
            "held_out": entries(&validation),
            "rms": [mean(&kept, |e| e.model), mean(&validation, |e| e.model)],
            "linear_rms": [mean(&kept, |e| e.linear), mean(&validation, |e| e.linear)],
        });
        let name = context.summary.surface.as_ref().map(|s| s.name.clone()).unwrap_or_default();
        context.write_report(path, &name, &report)?;
        Ok((Written,))
    }
}

/// Examples at least: of one alone nothing is learnt about what changes between poses, and none can be left out.
const MIN_EXAMPLES: usize = 2;
/// Files that are named where several are wrong.
const NAMED: usize = 10;
/// Size of an example, by the root of its area, over that at rest.
const SIZES: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// What examples are of.
struct Subject {
    model: Model,
    skeleton: Skeleton,
    weights: SkinWeights,
    /// How the mesh is bound in its own file, where no other skeleton is given.
    own: Option<Arc<Skin>>,
}

/// A pose, and the file it is from.
struct Named {
    file: PathBuf,
    example: Example,
}

/// The model in the form that is written.
enum Trained {
    Full(Box<RegressionModel>),
    Reduced(Box<Reduced>),
}

/// Root mean squares over the vertices of one mesh, units of the mesh.
struct Errors {
    file: PathBuf,
    model: f64,
    linear: f64,
}

/// The model in the form that is wanted, and for a file.
fn form(
    subject: &Subject,
    full: RegressionModel,
    examples: &[Example],
    prototypes: Option<u32>,
    run: &Run,
) -> Result<(Trained, SkinModel), RunError> {
    let (mesh, skeleton) = (subject.model.mesh(), &subject.skeleton);
    let Some(most) = prototypes else {
        let file = SkinModel::of(mesh, skeleton, &full).map_err(internal)?;
        return Ok((Trained::Full(Box::new(full)), file));
    };
    let samples: Vec<_> = examples.iter().map(|e| e.matrices.clone()).collect();
    let reduced = full.reduced(&samples, most as usize, run)?;
    let file = SkinModel::of_reduced(mesh, skeleton, &reduced).map_err(internal)?;
    Ok((Trained::Reduced(Box::new(reduced)), file))
}

#[expect(clippy::needless_pass_by_value, reason = "the signature that map_err wants")]
fn internal(error: CharacterError) -> RunError {
    RunError::Internal(error.to_string())
}

/// Files to learn from, and those that are held out.
fn files(settings: &SkinTrainSettings) -> Result<(Vec<PathBuf>, Vec<PathBuf>), RunError> {
    let found = |patterns: &[String]| {
        let search = Search { extensions: &MESH_EXTENSIONS, ..Search::default() };
        let files = search.paths(patterns).map_err(|e| RunError::Input(e.to_string()))?;
        if files.is_empty() && !patterns.is_empty() {
            return Err(RunError::Input(format!("no mesh matches {}", patterns.join(", "))));
        }
        Ok(files)
    };
    let (mut kept, validation) = (found(&settings.examples)?, found(&settings.held_out)?);
    kept.retain(|file| !validation.contains(file));
    if kept.len() < MIN_EXAMPLES {
        let count = kept.len();
        let aside = if validation.is_empty() { String::new() } else { format!(", {} held out", validation.len()) };
        let message = format!("{count} examples are too few to learn from (at least {MIN_EXAMPLES}{aside})");
        return Err(RunError::Input(format!("{message}; give more poses of the mesh")));
    }
    Ok((kept, validation))
}

fn subject(
    context: &mut Context<'_, '_>,
    posed: &Posed,
    rig: Option<&Rig>,
    settings: &SkinTrainSettings,
) -> Result<Subject, RunError> {
    let model = posed.model.with_positions(posed.last().to_vec()).map_err(|e| not_finite(&e))?;
    let file = settings.weights.as_ref();
    let Some(rig) = rig else {
        let Character { skeleton, skin, .. } = own_character(&posed.model)?;
        let weights = match file {
            Some(_) => binding::weights(context, model.mesh(), &skeleton, settings.binding, file)?,
            None => skin.weights().clone(),
        };
        return Ok(Subject { model, skeleton, weights, own: Some(skin) });
    };
    let skeleton = rig.skeleton.clone();
    let weights = binding::weights(context, model.mesh(), &skeleton, settings.binding, file)?;
    Ok(Subject { model, skeleton, weights, own: None })
}

/// What the file of the mesh itself says of its joints.
fn own_character(model: &Model) -> Result<Character, RunError> {
    character_of(model).map_err(|e| match e {
        RigFileError::NoSkin => RunError::Input(format!("{e}; `--skeleton` (the input `skeleton`) names one")),
        other => RunError::Input(other.to_string()),
    })
}

/// Reads poses of the mesh; every file that is no pose of it is named.
fn examples(
    subject: &Subject,
    files: &[PathBuf],
    settings: &SkinTrainSettings,
    context: &Context<'_, '_>,
) -> Result<Vec<Named>, RunError> {
    let (limits, run) = (context.job.read_limits(), &context.job.run());
    let (mut read, mut faults) = (Vec::with_capacity(files.len()), Vec::new());
    for file in files {
        let model = read_model(file, &limits, run).map_err(|e| mesh_error(file, &e))?;
        match other(&subject.model, &model).or_else(|| of_other_size(subject.model.mesh(), model.mesh())) {
            Some(fault) => faults.push(format!("{}: {fault}", file.display())),
            None => read.push((file, model.mesh().positions().to_vec())),
        }
    }
    if !faults.is_empty() {
        let more = faults.len().saturating_sub(NAMED);
        faults.truncate(NAMED);
        if more > 0 {
            faults.push(format!("and {more} more"));
        }
        let list = faults.join("; ");
        return Err(RunError::Input(format!("examples must be poses of the mesh at rest: {list}")));
    }
    let poses = Poses::new(subject, settings)?;
    let named = |(file, positions): (&PathBuf, Vec<Point3<f64>>)| {
        let matrices = poses.matrices(subject, file, &positions, run)?;
        Ok(Named { file: file.clone(), example: Example { matrices, positions } })
    };
    read.into_iter().map(named).collect()
}

/// How a mesh is no other pose of the one at rest. Polygons are compared as in the files: how they are cut into
/// triangles depends on the pose.
fn other(rest: &Model, model: &Model) -> Option<String> {
    let counts = |m: &Model| (m.mesh().vertex_count(), m.faces().len());
    let ((vertices, faces), (expected_vertices, expected_faces)) = (counts(model), counts(rest));
    if rest.mesh().triangles() == model.mesh().triangles() && vertices == expected_vertices {
        return None;
    }
    if (vertices, faces) != (expected_vertices, expected_faces) {
        let expected = format!("expected {expected_vertices} and {expected_faces}");
        return Some(format!("{vertices} vertices and {faces} faces ({expected})"));
    }
    let first = (0..faces).find(|&f| rest.faces().get(f) != model.faces().get(f))?;
    let (found, expected) = (model.faces().get(first), rest.faces().get(first));
    Some(format!("face {first} has the vertices {found:?} (expected {expected:?})"))
}

/// How a mesh is too large or small for a pose of the one at rest: joints rotate, they do not scale.
fn of_other_size(rest: &TriMesh, mesh: &TriMesh) -> Option<String> {
    let times = (mesh.area() / rest.area()).sqrt();
    let expected = format!("expected {} to {}", SIZES.start(), SIZES.end());
    (!SIZES.contains(&times)).then(|| format!("{times:.3} times as large ({expected}); bring both to the same unit"))
}

/// Pose files with the joints of examples, where there are any.
struct Poses(Option<(Vec<PathBuf>, Character)>);

impl Poses {
    fn new(subject: &Subject, settings: &SkinTrainSettings) -> Result<Self, RunError> {
        if settings.poses.is_empty() {
            return Ok(Self(None));
        }
        let search = Search { extensions: &["json"], ..Search::default() };
        let files = search.paths(&settings.poses).map_err(|e| RunError::Input(e.to_string()))?;
        let bound = || Skin::bound(subject.weights.clone(), &subject.skeleton).map(Arc::new);
        let skin = subject.own.clone().map_or_else(bound, Ok)?;
        let character = Character::new(subject.model.clone(), subject.skeleton.clone(), skin);
        Ok(Self(Some((files, character?))))
    }

    /// How space moves with each joint in the pose that a mesh shows.
    fn matrices(
        &self,
        subject: &Subject,
        file: &Path,
        positions: &[Point3<f64>],
        run: &Run,
    ) -> Result<Vec<Matrix4<f64>>, RunError> {
        let Some((files, character)) = &self.0 else {
            return Ok(fit_joints(subject.model.mesh(), &subject.skeleton, &subject.weights, positions)?);
        };
        let pose = files.iter().find(|pose| pose.file_stem() == file.file_stem());
        let pose = pose.ok_or_else(|| {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy();
            RunError::Input(format!("{}: no pose file is called `{stem}`, as the mesh is", file.display()))
        })?;
        let of_file = |e: CharacterError| RunError::from(e).about(pose.display());
        let wanted = TargetPose::read(pose, character);
        let wanted = wanted.map_err(|e| RunError::Input(e.to_string()).about(pose.display()))?;
        let steps = PoseSettings::default().iterations as usize;
        let found = wanted.solve(character, IkMethod::LeastSquares, steps, run).map_err(of_file)?;
        let globals = subject.skeleton.globals(&found.pose).map_err(of_file)?;
        character.skin.joint_matrices(&globals).map_err(of_file)
    }
}

/// Those that are set, and those that leaving examples out finds.
fn options(
    subject: &Subject,
    examples: &[Example],
    settings: &SkinTrainSettings,
    run: &Run,
) -> Result<RegressionOptions, RunError> {
    let found = match (settings.ridge, settings.hold) {
        (Some(ridge), Some(hold)) => RegressionOptions { ridge, hold },
        _ => tuned(subject.model.mesh(), &subject.skeleton, &subject.weights, examples, run)?,
    };
    Ok(RegressionOptions { ridge: settings.ridge.unwrap_or(found.ridge), hold: settings.hold.unwrap_or(found.hold) })
}

/// How well poses come back, by the model that is written and by the best linear blend.
fn errors(model: &mut Trained, linear: &RegressionModel, named: Vec<Named>) -> Result<Vec<Errors>, RunError> {
    let of = |Named { file, example }: Named| {
        let matrices = &example.matrices;
        let posed = match model {
            Trained::Full(model) => model.positions(matrices),
            Trained::Reduced(model) => model.positions(matrices),
        };
        let blended = linear.linear_positions(matrices)?;
        let model = rms(&posed?, &example.positions);
        Ok(Errors { file, model, linear: rms(&blended, &example.positions) })
    };
    named.into_iter().map(of).collect()
}

fn rms(a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (sum / a.len().max(1) as f64).sqrt()
}

fn mean(errors: &[Errors], of: impl Fn(&Errors) -> f64) -> Option<f64> {
    (!errors.is_empty()).then(|| errors.iter().map(of).sum::<f64>() / errors.len() as f64)
}

/// In a line.
fn error_line(kept: &[Errors], validation: &[Errors], diagonal: f64) -> String {
    let relative = |errors: &[Errors], of: fn(&Errors) -> f64| {
        100.0 * mean(errors, of).unwrap_or(0.0) / diagonal.max(f64::MIN_POSITIVE)
    };
    let both = |errors: &[Errors]| {
        let (model, linear) = (relative(errors, |e| e.model), relative(errors, |e| e.linear));
        format!("{model:.3} % of the diagonal off (linear blend {linear:.3} %)")
    };
    let mut line = format!("{} poses, {}", kept.len(), both(kept));
    if !validation.is_empty() {
        let _ = write!(line, "; {} held out, {}", validation.len(), both(validation));
    }
    line
}

fn entries(errors: &[Errors]) -> Vec<Json> {
    let entry = |e: &Errors| json!({"file": e.file.display().to_string(), "rms": e.model, "linear_rms": e.linear});
    errors.iter().map(entry).collect()
}
