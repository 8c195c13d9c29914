//! `plumbline probe`: contents of a clip.

use std::path::PathBuf;

use clap::Args;

use super::failure::Failure;
use super::print;
use super::session::Session;
use crate::pipeline::Exit;

#[derive(Debug, Args)]
pub(super) struct ProbeArgs {
    /// The clip
    input: PathBuf,
    /// Also look into a playlist (HLS, ffconcat) of files in its own folder
    #[arg(long)]
    allow_playlist: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl ProbeArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let probed = session.runner.probe(&self.input, self.allow_playlist)?;
        let text = if self.json { format!("{:#}", probed.json) } else { probed.text };
        print(&format!("{}\n", text.trim_end()));
        Ok(Exit::Done)
    }
}
