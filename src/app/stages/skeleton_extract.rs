//! `skeleton.extract`: the curve in the middle of a surface, and joints on it, its own or those of a template.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use super::files::write_whole;
use super::kept::curve_of;
use super::prelude::*;
use super::values::Posed;
use crate::pipeline::job::Job;
use crate::pipeline::paths::to_path;
use plumbline_num::document::read_text;
use plumbline_num::run::Run;
use plumbline_shape::character::extraction::{
    ContractionStep, ExtractionOptions, ExtractionReport, Keep, extract, skeleton_of,
};
use plumbline_shape::character::fitting::fit_template;
use plumbline_shape::character::io::{Rig, read_rig, rig_text};
use plumbline_shape::character::naming::propose_names;
use plumbline_shape::character::skeleton_file::SkeletonFile;
use plumbline_shape::character::weights::{WeightOptions, bone_weights};
use plumbline_shape::character::{Character, CharacterError, CurveSkeleton, Skeleton, Skin};
use plumbline_shape::mesh::io::{WriteOptions, encode_model};
use plumbline_shape::mesh::{MeshFormat, Model, TriMesh, VertexRef};

/// Settings of `skeleton.extract`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SkeletonExtractSettings {
    /// The file to write: .json (with the curve), .glb or .gltf (bound to the surface), .tgf, .skel or .bvh
    #[schemars(extend("format" = "path"))]
    pub path: Option<String>,
    /// About how many joints; as many as bends, ends and junctions need if left out
    #[schemars(range(min = 1, max = 10_000))]
    pub joints: Option<u32>,
    /// How the surface is contracted and the curve pruned.
    #[serde(flatten)]
    pub options: ExtractionOptions,
    /// Ends that stay: auto, the tips of the surface, or a file that lists vertices
    pub keep: Option<String>,
    /// A skeleton whose joints are fitted to the curve (json glb gltf fbx bvh tgf skel); its names, parents and limits stay, and `joints` does
    /// not count
    #[schemars(extend("format" = "path"))]
    pub template: Option<String>,
    /// A folder for the surface after each contraction iteration, as .obj
    #[schemars(extend("format" = "path"))]
    pub contraction_frames: Option<String>,
}

impl Default for SkeletonExtractSettings {
    fn default() -> Self {
        let options = ExtractionOptions::default();
        Self { path: None, joints: None, options, keep: None, template: None, contraction_frames: None }
    }
}

impl SkeletonExtractSettings {
    /// The file that `keep` names.
    pub fn keep_file(&self) -> Option<&str> {
        self.keep.as_deref().filter(|keep| *keep != "auto")
    }
}

impl Stage for SkeletonExtractSettings {
    const KIND: &'static str = "skeleton.extract";
    const SUMMARY: &'static str = "finds the curve in the middle of a surface by contraction, and joints on it";
    const INPUTS: &'static [Port] = &[Port::one("mesh", PortType::Mesh, "the surface; it may be open or in parts")];
    const OUTPUTS: &'static [Port] = &[
        Port::one("skeleton", PortType::Skeleton, "the skeleton"),
        Port::one("file", PortType::File, "the file, where one is named"),
    ];
    type Input = (Posed,);
    type Output = (Arc<Rig>, Written);

    fn reads(&self) -> Vec<&str> {
        self.keep_file().into_iter().chain(self.template.as_deref()).collect()
    }

    fn writes(&self) -> Vec<String> {
        self.path.iter().cloned().collect()
    }

    fn run(&self, (posed,): Self::Input, context: &mut Context<'_, '_>) -> Result<Self::Output, RunError> {
        let mesh = posed.mesh()?;
        let options = ExtractionOptions { keep: keep(self, &mesh, context)?, ..self.options.clone() };
        let (curve, report) = match self.contraction_frames.as_deref().map(to_path) {
            None => curve_of(context, &mesh, &options, |context| extracted(context, &mesh, &options, None))?,
            // The contraction itself is asked for.
            Some(folder) => extracted(context, &mesh, &options, Some(&folder))?,
        };
        warn_of_bounds(context, &report);
        let (rig, proposed) = rig(context, &curve, &report, self)?;
        if let Some(path) = &self.path.as_deref().map(to_path) {
            let bytes = encoded(path, &posed.model, &rig, &curve, proposed, &context.job.run())?;
            context.write_file(path, bytes)?;
        }
        Ok((Arc::new(rig), Written))
    }
}

/// The curve of a surface; the steps of its contraction go to `folder`.
fn extracted(
    context: &mut Context<'_, '_>,
    mesh: &TriMesh,
    options: &ExtractionOptions,
    folder: Option<&Path>,
) -> Result<(CurveSkeleton, ExtractionReport), RunError> {
    let job = context.job;
    let mut failed = None;
    let mut frames = Vec::new();
    let mut observer = |step: &ContractionStep<'_>| {
        if job.check_cancel().is_err() {
            return ControlFlow::Break(());
        }
        let Some(folder) = folder else { return ControlFlow::Continue(()) };
        let path = folder.join(format!("part{:03}_round{:03}.obj", step.part, step.iteration));
        match write_frame(&path, step, job) {
            Ok(()) => frames.push(path),
            Err(error) => {
                failed = Some(error);
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    };
    let found = extract(mesh, options, &mut observer, &job.run());
    if let Some(error) = failed {
        return Err(error);
    }
    let found = found?;
    job.check_cancel()?;
    context.summary.outputs.extend(frames);
    Ok(found)
}

/// Warns of what has no curve, and of a curve that is coarser than usual.
fn warn_of_bounds(context: &mut Context<'_, '_>, report: &ExtractionReport) {
    if let Some(first) = report.outliers.first() {
        context.warn(format!(
            "{} outliers left out (first: vertex {first}): more than 100 times as far from the middle as nine tenths of the vertices",
            report.outliers.len()
        ));
    }
    if report.specks > 0 {
        context.warn(format!(
            "{} components with {} vertices left out: each has less than 1/10000 of the area of the largest",
            report.specks, report.speck_vertices
        ));
    }
    if report.spacing > 1.0 {
        context.warn(format!(
            "the shape is so long and thin that the nodes of its curve are {:.1} times as far apart as usual",
            report.spacing
        ));
    }
    if report.unrefined > 0 {
        context.warn(format!(
            "the curves of {} components are not centered to the end: too many of their triangles overlap; remesh them",
            report.unrefined
        ));
    }
}

/// The joints on the curve, as it bends, and what is to be said of names that were proposed for them; or those of a template with its
/// movements, whose names are someone's.
fn rig(
    context: &mut Context<'_, '_>,
    curve: &CurveSkeleton,
    report: &ExtractionReport,
    settings: &SkeletonExtractSettings,
) -> Result<(Rig, Option<String>), RunError> {
    if let Some(template) = settings.template.as_deref().map(to_path) {
        return Ok((fitted(context, &template, curve, report)?, None));
    }
    let wanted = settings.joints.map(|n| n as usize);
    let skeleton = skeleton_of(curve, wanted).map_err(|e| RunError::Input(e.to_string()))?;
    report_curve(context, &skeleton, report, settings);
    let rig = |skeleton| Rig { skeleton, clips: Vec::new(), warnings: Vec::new() };
    let Some(names) = propose_names(&skeleton, curve) else { return Ok((rig(skeleton), None)) };
    let proposed = names.summary();
    if let Some(surface) = &mut context.summary.surface {
        let line = surface.skeleton.take().unwrap_or_default();
        surface.skeleton = Some(format!("{line}; names {proposed}"));
    }
    Ok((rig(names.applied(&skeleton)?), Some(proposed)))
}

/// The joints of a template on the curve.
fn fitted(
    context: &mut Context<'_, '_>,
    path: &Path,
    curve: &CurveSkeleton,
    report: &ExtractionReport,
) -> Result<Rig, RunError> {
    let rig =
        read_rig(path, &context.job.read_limits(), &context.job.run()).map_err(|e| RunError::Input(e.to_string()))?;
    rig.warnings.iter().for_each(|w| context.warn(format!("{}: {w}", path.display())));
    let mesh = context.summary.surface.as_ref().map_or_else(|| "the mesh".to_owned(), |s| s.name.clone());
    // The template fitted to the curve.
    let fit = fit_template(&rig.skeleton, curve, &context.job.run()).map_err(|e| {
        let of = if matches!(e, CharacterError::Template(_)) { path.display().to_string() } else { mesh };
        RunError::from(e).about(of)
    })?;
    // The summary, and what the user should check.
    let name = |j: u32| fit.skeleton.joints()[j as usize].name.as_str();
    let loose: Vec<_> = fit.limbs.iter().filter(|l| l.stretch.is_none()).collect();
    let line = format!(
        "{} joints of {}, {:.4} times as large; {} of {} limbs on the curve, joints {:.1} % off the template's shape; a curve of {} ends, \
         {} of them without a limb",
        fit.skeleton.joint_count(),
        path.display(),
        fit.scale,
        fit.limbs.len() - loose.len(),
        fit.limbs.len(),
        100.0 * fit.residual,
        report.ends,
        fit.spare_ends
    );
    if let Some(surface) = &mut context.summary.surface {
        surface.repairs.clone_from(&report.repairs);
        surface.joints = Some(fit.skeleton.joint_count());
        surface.skeleton = Some(line);
    }
    for limb in loose {
        let (from, to) = (name(limb.from), name(limb.to));
        context
            .warn(format!("the curve has no limb from {from:?} to {to:?}; its joints went with the one it hangs on"));
    }
    if fit.ambiguous {
        let what = "the shape fits the template in two ways, as where left and right look alike";
        context.warn(format!("{what}; the one with the smallest rotation was taken: look whether the sides are right"));
    }
    // Its movements, for limbs of the new lengths.
    let clips = rig.clips.iter().map(|clip| fit.retargeted(&rig.skeleton, clip)).collect::<Result<_, _>>();
    let clips = clips.map_err(|e| RunError::Input(format!("{}: {e}", path.display())))?;
    Ok(Rig { skeleton: fit.skeleton, clips, warnings: Vec::new() })
}

/// Size of the largest list of vertices to keep, bytes: a hundred thousand numbers of ten digits, far more than a body has tips.
const MAX_BYTES: u64 = 1 << 20;

/// Which ends stay. A file has numbers alone, or a JSON list of vertices as other files name them.
fn keep(settings: &SkeletonExtractSettings, mesh: &TriMesh, context: &Context<'_, '_>) -> Result<Keep, RunError> {
    let Some(name) = settings.keep_file() else {
        return Ok(if settings.keep.is_some() { Keep::Extrema } else { Keep::Nothing });
    };
    let bad = |what: String| RunError::Input(format!("{name}: {what}"));
    let text = read_text(&to_path(name), MAX_BYTES)
        .map_err(|e| bad(format!("{e} (expected `auto`, or a file of vertices)")))?;
    let only_numbers = text.matches('[').count() <= 1 && !text.contains('{');
    let vertices: Vec<VertexRef> = if only_numbers {
        let words = text.split(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ']')).filter(|w| !w.is_empty());
        let number = |w: &str| {
            let number = w.parse().map(VertexRef::Vertex);
            number.map_err(|_| bad(format!("`{w}` is no number of a vertex (whole, from 0)")))
        };
        words.map(number).collect::<Result<_, _>>()?
    } else {
        serde_json::from_str(&text).map_err(|e| bad(format!("not a list of vertices: {e}")))?
    };
    let found = |vertex: &VertexRef| {
        context.job.check_cancel()?;
        vertex.find(mesh).ok_or_else(|| match vertex {
            VertexRef::Vertex(index) => {
                bad(format!("there is no vertex {index}; the mesh has {}, numbered from 0", mesh.vertex_count()))
            }
            VertexRef::Nearest(position) => bad(format!("{position:?} is no position")),
        })
    };
    vertices.iter().map(found).collect::<Result<_, _>>().map(Keep::Vertices)
}

fn write_frame(path: &Path, step: &ContractionStep<'_>, job: &Job<'_>) -> Result<(), RunError> {
    let internal = |e: plumbline_shape::mesh::MeshError| RunError::Internal(e.to_string());
    let model = Model::of_mesh(step.surface());
    let bytes = encode_model(&model, MeshFormat::Obj, &WriteOptions::default(), &job.run()).map_err(internal)?;
    write_whole(path, bytes, job.if_exists())
}

/// The bytes of the file.
fn encoded(
    path: &Path,
    model: &Model,
    rig: &Rig,
    curve: &CurveSkeleton,
    proposed_names: Option<String>,
    run: &Run,
) -> Result<Vec<u8>, RunError> {
    let skeleton = &rig.skeleton;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let input = |e: &dyn std::fmt::Display| RunError::Input(e.to_string());
    match extension.as_str() {
        "json" => {
            let file = SkeletonFile {
                skeleton: skeleton.clone(),
                curve: Some(curve.clone()),
                proposed_names,
                clips: rig.clips.clone(),
            };
            Ok(file.to_json().into_bytes())
        }
        "glb" | "gltf" => {
            let (weights, _) =
                bone_weights(model.mesh(), skeleton, &WeightOptions::default(), run).map_err(|e| input(&e))?;
            let skin = Skin::bound(weights, skeleton).map_err(|e| input(&e))?;
            let still = model.clone().with_articulation(None).map_err(|e| RunError::Internal(e.to_string()))?;
            let character = Character::new(still, skeleton.clone(), Arc::new(skin)).map_err(|e| input(&e))?;
            let character = Character { clips: rig.clips.clone(), ..character };
            let rigged = character.to_model(None).map_err(|e| RunError::Internal(e.to_string()))?;
            let format = if extension == "glb" { MeshFormat::Glb } else { MeshFormat::Gltf };
            encode_model(&rigged, format, &WriteOptions::default(), run).map_err(|e| RunError::Internal(e.to_string()))
        }
        other => match rig_text(skeleton, rig.clips.first(), other) {
            Ok((text, _)) => Ok(text.into_bytes()),
            Err(_) => Err(RunError::Usage(format!(
                "the extension of `{}` names no skeleton to write (expected .json, .glb, .gltf, .tgf, .skel or .bvh)",
                path.display()
            ))),
        },
    }
}

fn report_curve(
    context: &mut Context<'_, '_>,
    skeleton: &Skeleton,
    report: &ExtractionReport,
    settings: &SkeletonExtractSettings,
) {
    let joints = skeleton.joint_count();
    let line = format!(
        "{joints} joints; a curve of {} ends, {} junctions and {} loops in {} parts, {} iterations",
        report.ends, report.junctions, report.loops, report.parts, report.iterations
    );
    if let Some(surface) = &mut context.summary.surface {
        surface.repairs.clone_from(&report.repairs);
        surface.joints = Some(joints);
        surface.skeleton = Some(line);
    }
    if report.parts == 1 && report.loops != report.handles {
        context.warn(format!("the curve has {} loops, but the surface has {} handles", report.loops, report.handles));
    }
    if let Some(wanted) = settings.joints.filter(|n| (*n as usize) < joints) {
        context.warn(format!("{joints} joints, not {wanted}: ends, junctions and loops need as many"));
    }
}
