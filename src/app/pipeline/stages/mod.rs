//! Bodies of the stages: where the methods of the other modules are joined to the graph.
//!
//! A pass is run stage by stage in the order of the graph. Stages that only describe a stream (`video.decode`, `video.warp`,
//! `video.render`) do nothing of their own accord: the sink that ends the stream (`video.track`, `video.encode`) pulls frames
//! through them, each on its own thread.

mod analysis;
mod chain;
mod context;
mod encoding;
mod export;
mod filling;
mod import;
mod importance;
mod mesh;
mod morphing;
mod npz;
mod numpy;
mod photo;
mod probe;
mod report;
mod retargeting;
mod sampling;
mod side_by_side;
mod sink;
mod smoothing;
mod stmap;
mod stream;
mod summary;
mod undistort;

use std::path::Path;

use super::batch::Instance;
use super::job::{Backend, Job, Probed, Values};
use super::kinds::{
    EncodeSettings, LensUndistortSettings, MotionExportSettings, MotionImportSettings, ReportSettings, SmoothSettings,
    StMapSettings, TrackSettings, VideoImportanceSettings, VideoRetargetSettings,
};
use super::plan::Pass;
use super::run_error::RunError;
use super::summary::Summary;
use context::{Context, media_error};
use plumbline_media::{Output, check_encoder};

/// The bodies that this program has.
pub struct Bodies;

impl Backend for Bodies {
    fn probe(&self, input: &str) -> Result<Probed, RunError> {
        probe::probe(input)
    }

    fn rehearse(&self, instance: &Instance) -> Result<(), RunError> {
        photo::rehearse(instance)?;
        mesh::rehearse(instance)?;
        for stage in &instance.graph.stages {
            if let Some(settings) = stage.settings.get::<EncodeSettings>() {
                let output = Output::parse(&settings.path);
                output.rehearse().map_err(media_error)?;
                if !output.is_sequence() {
                    check_encoder(settings.codec, &settings.encoder).map_err(media_error)?;
                }
            }
            if let Some(settings) = stage.settings.get::<MotionExportSettings>() {
                export::rehearse(settings)?;
            }
            if let Some(settings) = stage.settings.get::<StMapSettings>() {
                stmap::rehearse(settings)?;
            }
            if let Some(settings) = stage.settings.get::<ReportSettings>() {
                report::begin(Path::new(&settings.path))?;
            }
        }
        Ok(())
    }

    fn run_pass(&self, job: &Job<'_>, pass: &Pass, values: &mut Values, summary: &mut Summary) -> Result<(), RunError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(job.threads).build();
        let pool = pool.map_err(|e| RunError::Temporary(format!("cannot start {} threads: {e}", job.threads)))?;
        pool.install(|| {
            let mut context = Context { job, pass, values, summary };
            if job.graph().is_still() {
                return run_still(&mut context);
            }
            pass.stages.iter().try_for_each(|&stage| run_stage(&mut context, stage))
        })
    }
}

/// Evaluates the stages of a graph of still pictures or meshes, and lets go of what no later one takes. A picture takes a
/// second or two: progress is told by items done.
fn run_still(context: &mut Context<'_, '_>) -> Result<(), RunError> {
    let (job, pass) = (context.job, context.pass);
    for (done, &stage) in pass.stages.iter().enumerate() {
        job.check_cancel()?;
        let done_by_kind =
            photo::run(context, stage).or_else(|| mesh::run(context, stage)).or_else(|| morphing::run(context, stage));
        done_by_kind.unwrap_or_else(|| run_stage(context, stage))?;
        photo::let_go(job.graph(), &pass.stages, done, context.values);
    }
    Ok(())
}

fn run_stage(context: &mut Context<'_, '_>, stage: usize) -> Result<(), RunError> {
    let settings = context.job.graph().stages[stage].settings.clone();
    if let Some(settings) = settings.get::<TrackSettings>() {
        analysis::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<LensUndistortSettings>() {
        undistort::run(context, stage, settings)
    } else if settings.get::<VideoImportanceSettings>().is_some() {
        importance::run(context, stage)
    } else if let Some(settings) = settings.get::<VideoRetargetSettings>() {
        retargeting::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MotionImportSettings>() {
        import::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<MotionExportSettings>() {
        export::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<SmoothSettings>() {
        smoothing::run(context, stage, settings)
    } else if let Some(settings) = settings.get::<StMapSettings>() {
        stmap::run(context, stage, settings)
    } else if settings.get::<EncodeSettings>().is_some() {
        encoding::run(context, stage)
    } else if let Some(settings) = settings.get::<ReportSettings>() {
        report::run(context, stage, settings)
    } else {
        Ok(())
    }
}
