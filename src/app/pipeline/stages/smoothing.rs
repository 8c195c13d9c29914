//! `video.smooth`: the path of the virtual camera, between the passes.

use super::context::Context;
use crate::pipeline::kinds::SmoothSettings;
use crate::pipeline::run_error::RunError;
use plumbline_video::motion::ClipMotion;
use plumbline_video::stabilize::{Tracks, plan_path};

/// Plans the path.
pub(super) fn run(context: &mut Context<'_, '_>, stage: usize, settings: &SmoothSettings) -> Result<(), RunError> {
    let motion: &ClipMotion = context.values.get(context.required(stage, "motion")?)?;
    let tracks: Option<&Tracks> = context.edge(stage, "tracks").map(|edge| context.values.get(edge)).transpose()?;
    let path = plan_path(motion, tracks, settings, &context.job.run())?;
    context.values.put(stage, "path", path);
    Ok(())
}
