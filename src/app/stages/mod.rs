//! The stages: one file per kind, with its settings, ports and `run`. What several kinds share is in the folders beside
//! them.
//!
//! A pass is run stage by stage in the order of the graph. Stages that only describe a stream (`video.decode`, `video.warp`,
//! `video.render`) do nothing of their own accord: the sink that ends the stream (`video.track`, `video.encode`) pulls frames
//! through them, each on its own thread.
//!
//! To add a kind: a file here with a struct of settings that implements [`Stage`](crate::pipeline::kind::Stage), and its lines
//! in this file.

mod character_pose;
mod clip;
pub(crate) mod context;
mod faces_detect;
mod faces_load;
pub(crate) mod files;
mod image_grid;
mod image_importance;
mod image_load;
mod image_map_export;
mod image_render;
mod image_save;
pub(crate) mod kept;
mod lens_undistort;
mod lines_detect;
mod lines_load;
mod lines_save;
pub(crate) mod mesh;
mod mesh_blend;
mod mesh_compose;
mod mesh_deform;
mod mesh_load;
mod mesh_modes;
mod mesh_morph;
mod mesh_render;
mod mesh_save;
mod morphing;
mod npz;
mod numpy;
pub(crate) mod parts;
pub(crate) mod photo;
mod photo_rectangle;
mod photo_rectify;
mod photo_report;
mod photo_retarget;
pub mod photo_steps;
pub(crate) mod posing;
mod prelude;
mod probe;
mod skeleton_extract;
mod skeleton_load;
mod skin_train;
mod skin_weights;
pub(crate) mod values;
mod video_decode;
mod video_encode;
mod video_importance;
mod video_motion;
mod video_motion_export;
mod video_motion_import;
mod video_render;
mod video_report;
mod video_retarget;
mod video_smooth;
mod video_stmap;
mod video_track;
mod video_warp;
mod work_size;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

pub use character_pose::{PoseSettings, SkinningChoice};
pub use faces_detect::FacesDetectSettings;
pub use faces_load::FacesLoadSettings;
pub use image_grid::ImageGridSettings;
pub use image_importance::ImportanceSettings;
pub use image_load::ImageLoadSettings;
pub use image_map_export::MapExportSettings;
pub use image_render::{ImageRenderSettings, PhotoBorder};
pub use image_save::ImageSaveSettings;
pub use lens_undistort::LensUndistortSettings;
pub use lines_detect::LinesDetectSettings;
pub use lines_load::LinesLoadSettings;
pub use lines_save::LinesSaveSettings;
pub use mesh::animated::animated as animated_model;
pub use mesh_blend::BlendSettings;
pub use mesh_compose::ComposeSettings;
pub use mesh_deform::MeshDeformSettings;
pub use mesh_load::MeshLoadSettings;
pub use mesh_modes::MeshModesSettings;
pub use mesh_morph::MorphSettings;
pub use mesh_render::MeshRenderSettings;
pub use mesh_save::MeshSaveSettings;
pub use photo_rectangle::PhotoRectangleSettings;
pub use photo_rectify::PhotoRectifySettings;
pub use photo_report::PhotoReportSettings;
pub use photo_retarget::PhotoRetargetSettings;
pub use plumbline_media::{Codec, EncoderChoice};
pub use skeleton_extract::SkeletonExtractSettings;
pub use skeleton_load::SkeletonLoadSettings;
pub use skin_train::SkinTrainSettings;
pub use skin_weights::SkinWeightsSettings;
pub use video_decode::DecodeSettings;
pub use video_encode::EncodeSettings;
pub use video_importance::{ClipFaces, VideoImportanceSettings};
pub use video_motion::{MotionSettings, RollingShutter};
pub use video_motion_export::MotionExportSettings;
pub use video_motion_import::MotionImportSettings;
pub use video_render::{Border, Interpolation, RenderSettings};
pub use video_report::ReportSettings;
pub use video_retarget::VideoRetargetSettings;
pub use video_smooth::{InSpace, PathMethod, SmoothSettings, Zoom};
pub use video_stmap::StMapSettings;
pub use video_track::TrackSettings;
pub use video_warp::{ModelChoice, WarpSettings};

use crate::pipeline::batch::Instance;
use crate::pipeline::estimate::WorkSize;
use crate::pipeline::graph::Graph;
use crate::pipeline::job::{ArtifactStore, Job, Probed, StageRunner};
use crate::pipeline::kind::StageKind;
use crate::pipeline::memory::{ClipShape, human_bytes};
use crate::pipeline::plan::{Pass, temporary_space};
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::Summary;
use crate::pipeline::threads;
use context::Context;
use files::cannot;
use plumbline_num::files::{AtomicFile, folder_of, free_space};
use plumbline_num::limits::Shortage;
use plumbline_num::time::Timestamp;

/// Every stage kind, in the order of the data flow.
pub static KINDS: [StageKind; 42] = [
    StageKind::of::<DecodeSettings>(),
    StageKind::of::<LensUndistortSettings>(),
    StageKind::of::<TrackSettings>(),
    StageKind::of::<MotionSettings>(),
    StageKind::of::<MotionImportSettings>(),
    StageKind::of::<MotionExportSettings>(),
    StageKind::of::<SmoothSettings>(),
    StageKind::of::<WarpSettings>(),
    StageKind::of::<VideoImportanceSettings>(),
    StageKind::of::<VideoRetargetSettings>(),
    StageKind::of::<StMapSettings>(),
    StageKind::of::<RenderSettings>(),
    StageKind::of::<EncodeSettings>(),
    StageKind::of::<ReportSettings>(),
    StageKind::of::<ImageLoadSettings>(),
    StageKind::of::<LinesLoadSettings>(),
    StageKind::of::<LinesDetectSettings>(),
    StageKind::of::<LinesSaveSettings>(),
    StageKind::of::<FacesLoadSettings>(),
    StageKind::of::<FacesDetectSettings>(),
    StageKind::of::<ImportanceSettings>(),
    StageKind::of::<PhotoRectifySettings>(),
    StageKind::of::<PhotoRectangleSettings>(),
    StageKind::of::<PhotoRetargetSettings>(),
    StageKind::of::<ImageRenderSettings>(),
    StageKind::of::<ImageGridSettings>(),
    StageKind::of::<ImageSaveSettings>(),
    StageKind::of::<MapExportSettings>(),
    StageKind::of::<PhotoReportSettings>(),
    StageKind::of::<MeshLoadSettings>(),
    StageKind::of::<MeshDeformSettings>(),
    StageKind::of::<MeshModesSettings>(),
    StageKind::of::<SkinWeightsSettings>(),
    StageKind::of::<SkeletonLoadSettings>(),
    StageKind::of::<SkeletonExtractSettings>(),
    StageKind::of::<SkinTrainSettings>(),
    StageKind::of::<PoseSettings>(),
    StageKind::of::<MorphSettings>(),
    StageKind::of::<BlendSettings>(),
    StageKind::of::<ComposeSettings>(),
    StageKind::of::<MeshRenderSettings>(),
    StageKind::of::<MeshSaveSettings>(),
];

/// The kind called `name`, now or in an earlier version.
pub fn find(name: &str) -> Option<&'static StageKind> {
    KINDS.iter().find(|k| k.name == name || k.aliases.contains(&name))
}

/// The kind called `name` in a task, which may be one of the parts of a clip.
pub(crate) fn find_in_task(name: &str) -> Option<&'static StageKind> {
    find(name).or_else(|| parts::PART_KINDS.iter().find(|kind| kind.name == name))
}

/// The stages that this program has.
pub struct BuiltinStages;

impl StageRunner for BuiltinStages {
    fn probe(&self, input: &Path, playlists: bool) -> Result<Probed, RunError> {
        probe::probe(input, playlists)
    }

    fn clip_seconds(&self, input: &Path) -> Result<Option<f64>, RunError> {
        probe::seconds(input)
    }

    fn frame_times(&self, input: &Path, settings: &DecodeSettings) -> Result<Vec<Timestamp>, RunError> {
        probe::frame_times(input, settings)
    }

    fn work_size(&self, instance: &Instance, clip: Option<&ClipShape>) -> WorkSize {
        work_size::work_size(instance, clip)
    }

    fn preflight(&self, instance: &Instance) -> Result<(), RunError> {
        instance.graph.stages.iter().try_for_each(|stage| stage.settings.preflight())
    }

    fn run_pass(
        &self,
        job: &Job<'_>,
        pass: &Pass,
        values: &mut ArtifactStore,
        summary: &mut Summary,
    ) -> Result<(), RunError> {
        let still = job.graph().is_still();
        check_limits(job.threads, still)?;
        if pass.index == 0 {
            check_space(job)?;
            values.claims = claim_targets(job)?;
        }
        threads::pool(job.threads)?.install(|| {
            let mut context = Context { job, pass, values, summary, at: 0 };
            if still {
                return run_still(&mut context);
            }
            pass.stages.iter().try_for_each(|&stage| run_stage(&mut context, stage))
        })
    }
}

/// What decoders, encoders and the loops of a clip take beside one thread for each of their own: `(threads, files)` of a
/// pass. Encoders start half as many again as they are given, and further ones that look ahead.
const OF_CLIP: (usize, usize) = (8, 16);
/// The same of a still picture or a mesh.
const OF_STILL: (usize, usize) = (2, 8);

/// Refuses a pass that could not start its threads or open its files: libraries in which that fails do not all say so.
fn check_limits(threads: usize, still: bool) -> Result<(), RunError> {
    let (more_threads, files) = if still { OF_STILL } else { OF_CLIP };
    let needed = if still { threads } else { 3 * threads } + more_threads;
    Shortage::check(needed, files).map_err(|shortage| {
        RunError::Temporary(format!("a run needs {needed} threads and {files} open files more: {shortage}"))
    })
}

/// Refuses a run whose files would not fit: results where the disk is full already, since their size is not known before,
/// and temporary ones by the length of the clip.
fn check_space(job: &Job<'_>) -> Result<(), RunError> {
    for path in job.instance.outputs() {
        if free_space(folder_of(&path)) == Some(0) {
            return Err(cannot(&path, &std::io::ErrorKind::StorageFull.into()));
        }
    }
    let graph = job.graph();
    if !graph.stages.iter().any(|stage| stage.memory().iter().any(|cost| cost.on_disk)) {
        return Ok(());
    }
    let shapes = job
        .instance
        .inputs()
        .iter()
        .filter(|path| *path != Path::new("-"))
        .filter_map(|path| probe::probe(path, false).ok()?.shape)
        .max_by_key(|s| s.frames);
    let folder = std::env::temp_dir();
    match (shapes, free_space(&folder)) {
        (Some(clip), Some(free)) => enough_space(temporary_space(graph, &clip), free, &folder),
        _ => Ok(()),
    }
}

/// What clips take of the space that a plan foresees, in the mean: not all points are found, and not all are followed.
const SPACE_TAKEN: f64 = 0.5;

fn enough_space(foreseen: u64, free: u64, folder: &Path) -> Result<(), RunError> {
    if SPACE_TAKEN * foreseen as f64 <= free as f64 {
        return Ok(());
    }
    let (foreseen, free, folder) = (human_bytes(foreseen), human_bytes(free), folder.display());
    let help = "set TMPDIR to a folder with more space";
    Err(RunError::Temporary(format!(
        "the tracks of the clip take up to {foreseen} in {folder}, which has {free} free; {help}"
    )))
}

/// Begins the files of a job, so that no other run writes them meanwhile: it is refused before it works.
pub(crate) fn claim_targets(job: &Job<'_>) -> Result<Vec<AtomicFile>, RunError> {
    let paths = job.instance.outputs().into_iter().filter(|path| path.as_os_str() != "-");
    paths.map(|path| AtomicFile::next_to(&path, job.if_exists()).map_err(|e| cannot(&path, &e))).collect()
}

/// Evaluates the stages of a graph of still pictures or meshes, and lets go of what no later one takes. A picture takes a
/// second or two: progress is reported by items done.
fn run_still(context: &mut Context<'_, '_>) -> Result<(), RunError> {
    let (job, pass) = (context.job, context.pass);
    for (done, &stage) in pass.stages.iter().enumerate() {
        job.check_cancel()?;
        run_stage(context, stage)?;
        let_go(job.graph(), &pass.stages, done, context.values);
    }
    Ok(())
}

fn run_stage(context: &mut Context<'_, '_>, stage: usize) -> Result<(), RunError> {
    let settings = Arc::clone(&context.stage(stage).settings);
    let (started, noted) = (Instant::now(), context.summary.stage_seconds.values().sum::<f64>());
    settings.run(context, stage)?;
    // What the stage did for others is theirs.
    let of_others = context.summary.stage_seconds.values().sum::<f64>() - noted;
    let kind = context.stage(stage).kind.name;
    context.summary.note_seconds(kind, started.elapsed().as_secs_f64() - of_others);
    Ok(())
}

/// Drops the results that no stage of `stages` after position `done` takes.
fn let_go(graph: &Graph, stages: &[usize], done: usize, values: &mut ArtifactStore) {
    for &from in &stages[..=done] {
        let later = stages[done + 1..].iter().any(|&s| graph.stages[s].edges.iter().any(|e| e.from == from));
        if !later {
            values.forget(from);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::pipeline::graph::Stage;
    use crate::pipeline::plan::Plan;
    use crate::pipeline::progress::{Silent, TaskProgress};

    /// What a stage of its own says, connected to nothing.
    fn run_alone(kind: &'static StageKind) -> Result<(), RunError> {
        let settings = kind.defaults().expect("defaults of a kind");
        let stage = Stage { name: "alone".to_owned(), kind, settings, deferred: Vec::new(), edges: Vec::new() };
        let graph = Graph { stages: vec![stage] };
        let plan = Plan::of(&graph);
        let instance = Instance { key: "alone".to_owned(), item: None, graph, plan: plan.into() };
        let progress = TaskProgress::new(&Silent, "alone", 1);
        let cancel = Arc::new(AtomicBool::new(false));
        let job = Job {
            instance: &instance,
            threads: 1,
            overwrite: false,
            allow_paths: &[],
            cache: None,
            strict: false,
            progress: &progress,
            cancel: &cancel,
            publishing: None,
        };
        let (mut values, mut summary) = (ArtifactStore::default(), Summary::default());
        let pass = &instance.plan.passes[0];
        run_stage(&mut Context { job: &job, pass, values: &mut values, summary: &mut summary, at: 0 }, 0)
    }

    #[test]
    fn a_kind_is_found_by_its_earlier_name_and_no_name_means_two_kinds() {
        for (earlier, now) in [
            ("pose", "character.pose"),
            ("morph", "mesh.morph"),
            ("blend", "mesh.blend"),
            ("compose", "mesh.compose"),
            ("importance", "image.importance"),
        ] {
            assert_eq!(find(earlier).map(|k| k.name), Some(now));
        }
        let mut names: Vec<_> =
            KINDS.iter().flat_map(|k| [k.name].into_iter().chain(k.aliases.iter().copied())).collect();
        let all = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all);
    }

    #[test]
    fn every_kind_runs_or_says_what_it_lacks() {
        for kind in &KINDS {
            let described = ["video.decode", "video.motion", "video.warp", "video.render"].contains(&kind.name);
            let streams = kind.name.starts_with("video.") || kind.name.starts_with("lens.");
            let lacks = kind.inputs.iter().find(|p| p.arity.is_required());
            match (run_alone(kind), lacks) {
                (Ok(()), _) => assert!(described, "{} did nothing", kind.name),
                (Err(error), Some(port)) if !streams => {
                    let expected = format!("`alone` has no {}", port.name);
                    assert!(error.to_string().contains(&expected), "{}: {error}", kind.name);
                }
                (Err(_), _) => assert!(!described, "{} does something", kind.name),
            }
        }
    }
}
