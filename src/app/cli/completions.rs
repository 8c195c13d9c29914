//! `plumbline completions`: completions for a shell.

use clap::Args;
use clap_complete::{Shell, generate};

use super::print;
use super::session::Session;
use crate::pipeline::Exit;

#[derive(Debug, Args)]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl CompletionsArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Exit {
        let mut script = Vec::new();
        generate(self.shell, &mut super::command_with(session.extensions), "plumbline", &mut script);
        print(&String::from_utf8_lossy(&script));
        Exit::Done
    }
}
