//! `--settings FILE`: settings of a file as the defaults of a command's options.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Arg, Command};

use super::failure::Failure;
use crate::pipeline::partial::PartialFile;
use crate::pipeline::shipped::MAX_BYTES;
use crate::pipeline::syntax::Source;
use crate::pipeline::{Exit, PipelineFile};
use plumbline_num::document::read_text;

/// A file of settings, and the settings that the command at hand has as options.
pub(super) struct Defaults {
    file: PartialFile,
    options: Vec<(String, String)>,
}

/// The subcommands that a command line names, and its `--settings`. Errors are left to the second reading.
pub(super) fn requested(command: &Command, args: &[OsString]) -> Option<(Vec<String>, PathBuf)> {
    let matches = command.clone().ignore_errors(true).try_get_matches_from(args).ok()?;
    let (mut path, mut at) = (Vec::new(), &matches);
    while let Some((name, below)) = at.subcommand() {
        path.push(name.to_owned());
        at = below;
    }
    let settings = at.try_get_one::<PathBuf>("settings").ok()??;
    Some((path, settings.clone()))
}

impl Defaults {
    /// Reads and checks the file.
    pub(super) fn read(path: &Path) -> Result<Self, Failure> {
        let text = read_text(path, MAX_BYTES).map_err(|e| Failure {
            exit: Exit::Input,
            message: format!("{}: the settings cannot be read: {e}", path.display()),
            drawn: false,
        })?;
        let base = path.parent().filter(|p| *p != Path::new("")).map(Path::to_owned);
        let file = PartialFile::read(Source { name: path.display().to_string(), text, base })?;
        Ok(Self { file, options: Vec::new() })
    }

    /// The command whose subcommand at `path` has the settings as defaults of its options.
    pub(super) fn set(&mut self, command: Command, path: &[String]) -> Command {
        match path {
            [first, rest @ ..] => command.mut_subcommand(first, |below| self.set(below, rest)),
            [] => self.set_here(command),
        }
    }

    fn set_here(&mut self, command: Command) -> Command {
        let mut built = command.clone();
        built.build();
        let mut command = command;
        for group in built.get_groups() {
            // The name of an option's group says which setting it stands for.
            let Some((kind, key)) = group.get_id().as_str().split_once('/') else { continue };
            self.options.push((kind.to_owned(), key.to_owned()));
            let Some(words) = self.file.default_of(kind, key) else { continue };
            for id in group.get_args() {
                let default = |arg: Arg| arg.required(false).default_values(words.clone());
                command = command.mut_arg(id.as_str(), default);
            }
        }
        command
    }

    /// Adds the settings that are no options of the command.
    pub(super) fn apply(&self, file: &mut PipelineFile) {
        self.file.apply(file, &self.options);
    }
}
