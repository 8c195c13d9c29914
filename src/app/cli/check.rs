//! `plumbline check`: every fault of a pipeline file and of its batch, no input opened.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::failure::Failure;
use super::{PipelineArgs, print};
use crate::pipeline::plan::Plan;
use crate::pipeline::{Exit, Instance, Problems, read, shipped};

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
        let checked = read(source, &self.pipeline.set).and_then(|pipeline| {
            let instances = self.pipeline.instances(&pipeline)?;
            Ok((pipeline, instances))
        });
        match (checked, self.message_format) {
            (Ok((pipeline, instances)), MessageFormat::Text) => {
                let (stages, passes) = (pipeline.graph.stages.len(), Plan::of(&pipeline.graph).passes.len());
                print(&format!("{name}: no faults; {stages} stages in {passes} passes\n"));
                note_missing(&instances);
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

/// Inputs that a note lists.
const MAX_LISTED: usize = 5;

/// Names inputs that do not exist, which may be there by the time of the run.
fn note_missing(instances: &[Instance]) {
    let missing: BTreeSet<PathBuf> = instances.iter().flat_map(Instance::missing_inputs).collect();
    if missing.is_empty() {
        return;
    }
    let mut names: Vec<String> = missing.iter().take(MAX_LISTED).map(|path| format!("`{}`", path.display())).collect();
    if let Some(more) = missing.len().checked_sub(MAX_LISTED).filter(|more| *more > 0) {
        names.push(format!("{more} others"));
    }
    // A closed standard error leaves nothing to print to.
    let _ = writeln!(std::io::stderr().lock(), "note: there is no file {}", names.join(", "));
}

fn print_json(problems: &Problems) -> Exit {
    print(&format!("{:#}\n", problems.to_json()));
    Exit::Usage
}
