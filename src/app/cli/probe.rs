//! `plumbline probe`: what is in a clip.

use clap::Args;

use super::failure::Failure;
use super::tell;
use crate::pipeline::{Exit, StageRunner};

#[derive(Debug, Args)]
pub(super) struct ProbeArgs {
    /// The clip
    input: String,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl ProbeArgs {
    pub(super) fn run(self, backend: &dyn StageRunner) -> Result<Exit, Failure> {
        let probed = backend.probe(&self.input)?;
        let text = if self.json { format!("{:#}", probed.json) } else { probed.text };
        tell(&format!("{}\n", text.trim_end()));
        Ok(Exit::Done)
    }
}
