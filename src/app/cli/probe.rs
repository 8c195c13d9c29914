//! `plumbline probe`: contents of a clip.

use clap::Args;

use super::failure::Failure;
use super::print;
use super::session::Session;
use crate::pipeline::Exit;

#[derive(Debug, Args)]
pub(super) struct ProbeArgs {
    /// The clip
    input: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl ProbeArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let probed = session.runner.probe(&self.input)?;
        let text = if self.json { format!("{:#}", probed.json) } else { probed.text };
        print(&format!("{}\n", text.trim_end()));
        Ok(Exit::Done)
    }
}
