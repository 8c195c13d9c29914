//! `plumbline check`: every fault of a pipeline file, no input touched.

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::{PipelineArgs, print};
use crate::pipeline::plan::Plan;
use crate::pipeline::{Exit, Problems, read, shipped};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum MessageFormat {
    /// Lines of the file with arrows
    #[default]
    Text,
    /// A JSON list on standard output
    Json,
}

#[derive(Debug, Args)]
pub(super) struct CheckArgs {
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// Form of the list of faults
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    message_format: MessageFormat,
}

impl CheckArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let source = shipped::find_source(&self.pipeline.file).map_err(Failure::usage)?;
        let name = source.name.clone();
        match (read(source, &self.pipeline.set), self.message_format) {
            (Ok(pipeline), MessageFormat::Text) => {
                let (stages, passes) = (pipeline.graph.stages.len(), Plan::of(&pipeline.graph).passes.len());
                print(&format!("{name}: no faults; {stages} stages in {passes} passes\n"));
                Ok(Exit::Done)
            }
            (Ok(_), MessageFormat::Json) => {
                print("[]\n");
                Ok(Exit::Done)
            }
            (Err(problems), MessageFormat::Text) => Err(problems.into()),
            (Err(problems), MessageFormat::Json) => Ok(print_json(&problems)),
        }
    }
}

fn print_json(problems: &Problems) -> Exit {
    print(&format!("{:#}\n", problems.to_json()));
    Exit::Usage
}
