//! Commands that another crate adds to the program: the studio uses all of the libraries and the pipelines of this crate, so that it
//! cannot be one of its modules.

use clap::ArgMatches;

use crate::pipeline::{Exit, RunError};
use plumbline_num::run::Interrupt;

/// A command of another crate.
#[derive(Clone, Copy, Debug)]
pub struct Extension {
    /// The group of `--help` that lists it; a new one comes after the others.
    pub group: &'static str,
    /// Three command lines for its help, one on a line.
    pub examples: &'static str,
    /// Its definition.
    pub command: fn() -> clap::Command,
    /// Runs it. A signal raises the interrupt; the command returns soon after, and the program's exit status is the signal's.
    pub run: fn(&ArgMatches, &Interrupt) -> Result<Exit, RunError>,
}

impl Extension {
    /// The one that a command line names, with its arguments.
    pub(super) fn named<'a>(extensions: &[Self], matches: &'a ArgMatches) -> Option<(Self, &'a ArgMatches)> {
        let (name, below) = matches.subcommand()?;
        let found = extensions.iter().find(|extension| (extension.command)().get_name() == name)?;
        Some((*found, below))
    }
}
