//! `plumbline solve`: sparse linear systems from Matrix Market files.

use clap::Args;

use super::failure::Failure;
use super::print;
use crate::pipeline::Exit;
use crate::pipeline::solve::{SolveJob, solve};

/// Options of `plumbline solve`.
#[derive(Debug, Args)]
pub(super) struct SolveArgs {
    #[command(flatten)]
    job: SolveJob,
}

impl SolveArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        print(&solve(&self.job)?);
        Ok(Exit::Done)
    }
}
