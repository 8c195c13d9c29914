//! The result of a clip from its chunks: nothing is encoded, the other streams are copied once, and every seam is compared.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{PartName, made_before};
use crate::pipeline::batch::Instance;
use crate::pipeline::estimate::WorkSize;
use crate::pipeline::job::{ArtifactStore, Job, Probed, StageRunner};
use crate::pipeline::memory::ClipShape;
use crate::pipeline::paths::to_path;
use crate::pipeline::plan::Pass;
use crate::pipeline::run_error::RunError;
use crate::pipeline::summary::Summary;
use crate::stages::clip::encoding;
use crate::stages::clip::sink::Sink;
use crate::stages::context::Context;
use crate::stages::{BuiltinStages, DecodeSettings, EncodeSettings, MotionExportSettings, claim_targets};
use plumbline_media::FrameSpan;

/// The chunks of a clip.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClipParts {
    /// The frames of each chunk, in order.
    pub(crate) chunks: Vec<FrameSpan>,
}

/// Makes the results of a stabilization from the parts in a folder.
pub(crate) struct PartJoiner<'a> {
    pub(crate) folder: &'a str,
    pub(crate) parts: &'a ClipParts,
}

impl StageRunner for PartJoiner<'_> {
    fn probe(&self, input: &Path, playlists: bool) -> Result<Probed, RunError> {
        BuiltinStages.probe(input, playlists)
    }

    fn work_size(&self, instance: &Instance, clip: Option<&ClipShape>) -> WorkSize {
        BuiltinStages.work_size(instance, clip)
    }

    fn preflight(&self, instance: &Instance) -> Result<(), RunError> {
        BuiltinStages.preflight(instance)
    }

    fn run_pass(
        &self,
        job: &Job<'_>,
        pass: &Pass,
        values: &mut ArtifactStore,
        summary: &mut Summary,
    ) -> Result<(), RunError> {
        if pass.index > 0 {
            return Ok(());
        }
        values.claims = claim_targets(job)?;
        let mut context = Context { job, pass, values, summary, at: 0 };
        let sinks = self.join(&mut context)?;
        // Nothing gets its name before all parts are there and fit.
        self.export_motion(&mut context)?;
        encoding::finish(&mut context, sinks)
    }
}

impl PartJoiner<'_> {
    /// Gives the motion file that the pipeline asks for its name.
    fn export_motion(&self, context: &mut Context<'_, '_>) -> Result<(), RunError> {
        let exports = context.job.graph().stages.iter().filter_map(|s| s.settings.get::<MotionExportSettings>());
        let paths: Vec<_> = exports.filter_map(|export| export.path.as_deref()).map(to_path).collect();
        for path in paths {
            let mut made = made_before(&PartName::Export.in_folder(self.folder))?;
            context.fill_file(&path, |out| io::copy(&mut made, out).map(|_| ()))?;
        }
        Ok(())
    }

    /// Joins the chunks to a file that has no name yet.
    fn join(&self, context: &mut Context<'_, '_>) -> Result<Vec<Sink>, RunError> {
        let stages = &context.job.graph().stages;
        let no_stage = || RunError::Internal("the clip has no stage to join its parts for".to_owned());
        let source = stages.iter().position(|s| s.settings.get::<DecodeSettings>().is_some()).ok_or_else(no_stage)?;
        let encode = stages.iter().position(|s| s.settings.get::<EncodeSettings>().is_some()).ok_or_else(no_stage)?;
        let (input, reader) = context.open(source)?;
        let video = reader.info().clone();
        drop(reader);
        let frames = self.parts.chunks.iter().map(|chunk| chunk.frames.len() as u64).sum();
        context.job.progress.begin(context.pass.index, "join", Some(frames));
        let mut sinks = encoding::sinks(context, &[encode], source, &input, &video, &[])?;
        let mut done = 0;
        for (chunk, span) in self.parts.chunks.iter().enumerate() {
            context.job.check_cancel()?;
            let path = PartName::Chunk(chunk).in_folder(self.folder);
            drop(made_before(&path)?);
            sinks.iter_mut().try_for_each(|sink| sink.append(&path, span))?;
            done += span.frames.len() as u64;
            context.job.progress.frames(done);
        }
        if PartName::CutShort.in_folder(self.folder).exists() {
            context.summary.cut_short = true;
            context.warn(format!("the file is cut short after {done} frames"));
        }
        Ok(sinks)
    }
}
