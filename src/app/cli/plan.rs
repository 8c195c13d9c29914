//! `plumbline plan`: the passes of a pipeline and what each holds in memory.

use std::fmt::Write as _;

use clap::Args;

use super::failure::Failure;
use super::session::Session;
use super::{PipelineArgs, print};
use crate::pipeline::memory::human_bytes;
use crate::pipeline::plan::temporary_space;
use crate::pipeline::{Exit, Plan};
use plumbline_num::files::free_space;

#[derive(Debug, Args)]
pub(super) struct PlanArgs {
    #[command(flatten)]
    pipeline: PipelineArgs,
}

impl PlanArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let pipeline = self.pipeline.read()?;
        // A plan can be read before the clips exist: then the figures stay symbolic.
        let instances = self.pipeline.instances(&pipeline)?;
        let first = instances.first();
        let clip = first
            .and_then(|i| i.inputs().into_iter().next())
            .and_then(|path| session.runner.probe(&path, false).ok())
            .and_then(|probed| probed.shape);
        let graph = first.map_or(&pipeline.graph, |i| &i.graph);
        let mut text = String::new();
        if let (Some(batch), Some(first)) = (&pipeline.batch, first) {
            let count = instances.len();
            let jobs = if batch.jobs == 0 { "as many as fit".to_owned() } else { batch.jobs.to_string() };
            text = format!("{count} items, {jobs} at once; figures for `{}`\n", first.key);
        }
        text.push_str(&Plan::of(graph).describe(graph, clip.as_ref()));
        let folder = std::env::temp_dir();
        let needed = clip.is_some_and(|clip| temporary_space(graph, &clip) > 0);
        if let Some(free) = free_space(&folder).filter(|_| needed) {
            // Writing to a string does not fail.
            let _ = writeln!(text, "free for temporary files: {} in {}", human_bytes(free), folder.display());
        }
        print(&text);
        Ok(Exit::Done)
    }
}
