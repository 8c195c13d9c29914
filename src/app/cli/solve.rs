//! `plumbline solve`: sparse linear systems from Matrix Market files.

use clap::Args;

use super::failure::Failure;
use super::print;
use super::session::Session;
use crate::pipeline::Exit;
use crate::pipeline::solve::{SolveJob, solve};

/// Options of `plumbline solve`.
#[derive(Debug, Args)]
pub(super) struct SolveArgs {
    #[command(flatten)]
    job: SolveJob,
}

impl SolveArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        print(&solve(&self.job, &session.interrupt.run())?);
        Ok(Exit::Done)
    }
}
