//! Why a command failed: a message for people and an exit status for programs.

use std::io::{IsTerminal, Write};

use crate::pipeline::paths::shown;
use crate::pipeline::{Exit, Problems, RunError};

/// Why a command failed.
#[derive(Debug)]
pub(super) struct Failure {
    /// Exit status.
    pub exit: Exit,
    /// The message; `error:` is put in front unless it is drawn with its position in a file.
    pub message: String,
    /// The message is complete.
    pub drawn: bool,
}

impl Failure {
    pub(super) fn new(exit: Exit, message: impl Into<String>) -> Self {
        Self { exit, message: message.into(), drawn: false }
    }

    pub(super) fn usage(message: impl Into<String>) -> Self {
        Self::new(Exit::Usage, message)
    }

    /// Prints it to standard error; where that fails, nothing is left to print to.
    pub(super) fn report(&self) {
        let mut err = std::io::stderr().lock();
        let message = shown(&self.message);
        let _ = if self.drawn { write!(err, "{message}") } else { writeln!(err, "error: {message}") };
    }
}

impl From<Problems> for Failure {
    fn from(problems: Problems) -> Self {
        let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        Self { exit: Exit::Usage, message: problems.render(color, 100), drawn: true }
    }
}

impl From<RunError> for Failure {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Config(problems) => problems.into(),
            other => {
                let other = other.settled();
                Self { exit: other.exit(), message: other.to_string(), drawn: false }
            }
        }
    }
}
