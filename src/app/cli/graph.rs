//! `plumbline graph`: draws the stages of a pipeline.

use clap::Args;

use super::failure::Failure;
use super::{PipelineArgs, print};
use crate::pipeline::Exit;
use crate::pipeline::draw::{GraphFormat, draw};

#[derive(Debug, Args)]
pub(super) struct GraphArgs {
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// How to draw
    #[arg(long, value_enum, default_value_t, value_name = "FORMAT")]
    format: GraphFormat,
}

impl GraphArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let pipeline = self.pipeline.read()?;
        print(&draw(&pipeline.graph, self.format));
        Ok(Exit::Done)
    }
}
