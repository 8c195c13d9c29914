//! `plumbline solve`: sparse linear systems from Matrix Market files.

use clap::Args;

use super::failure::Failure;
use super::print;
use super::session::Session;
use crate::pipeline::Exit;
use crate::pipeline::options::RunSettings;
use crate::pipeline::solve::{SolveJob, solve};
use crate::pipeline::threads::pool;

/// Options of `plumbline solve`.
#[derive(Debug, Args)]
pub(super) struct SolveArgs {
    #[command(flatten)]
    job: SolveJob,
}

impl SolveArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let run = session.interrupt.run();
        let pool = pool(RunSettings::default().thread_count())?;
        print(&pool.install(|| solve(&self.job, &run))?);
        Ok(Exit::Done)
    }
}
