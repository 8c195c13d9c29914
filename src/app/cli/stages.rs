//! `plumbline stages`: the kinds of stages.

use clap::Args;

use super::failure::Failure;
use super::print;
use crate::pipeline::{Exit, describe, suggest};
use crate::stages;

#[derive(Debug, Args)]
pub(super) struct StagesArgs {
    /// A kind to describe; all are listed if left out
    #[arg(value_name = "NAME")]
    name: Option<String>,
}

impl StagesArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let Some(name) = self.name else {
            print(&describe::list());
            return Ok(Exit::Done);
        };
        let kind = stages::find(&name).ok_or_else(|| {
            let hint = suggest::did_you_mean(&name, stages::KINDS.iter().map(|k| k.name)).unwrap_or_default();
            Failure::usage(format!("there is no stage kind `{name}`; {hint}"))
        })?;
        print(&describe::describe(kind));
        Ok(Exit::Done)
    }
}
