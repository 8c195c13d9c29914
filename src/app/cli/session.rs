//! What all commands share: the global options, and the stages that do the work.

use clap::{ArgAction, Args};

use super::defaults::Defaults;
use crate::pipeline::StageRunner;
use crate::pipeline::options::ProgressMode;

/// Options of every command.
#[derive(Debug, Args)]
pub(super) struct GlobalArgs {
    /// Print errors only: no progress, no summary
    #[arg(short, long, global = true, help_heading = "Messages")]
    quiet: bool,
    /// Print the details of each result; -vv also logs the steps, -vvv everything
    #[arg(short, long, global = true, action = ArgAction::Count, overrides_with = "quiet", help_heading = "Messages")]
    verbose: u8,
    /// Log messages of this level and above: off, error, warn, info, debug, trace, or MODULE=LEVEL,…
    #[arg(long, global = true, value_name = "LEVEL", help_heading = "Messages", value_parser = log_filter)]
    log_level: Option<String>,
    /// Of other programs; the error says how inputs are given here.
    #[arg(short = 'i', global = true, hide = true, value_name = "FILE", value_parser = refuse_input_flag)]
    _input: Option<String>,
}

/// How much is printed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Verbosity {
    /// Errors.
    Quiet,
    /// A line per result.
    #[default]
    Normal,
    /// All that is known of a result.
    Detailed,
}

/// A run of the program.
pub(super) struct Session<'a> {
    /// The stages.
    pub(super) runner: &'a dyn StageRunner,
    /// How much is printed.
    pub(super) verbosity: Verbosity,
    /// Settings of a file.
    pub(super) defaults: Option<Defaults>,
}

impl GlobalArgs {
    /// How much is printed.
    pub(super) fn verbosity(&self) -> Verbosity {
        match (self.quiet, self.verbose) {
            (_, 1..) => Verbosity::Detailed,
            (true, 0) => Verbosity::Quiet,
            (false, 0) => Verbosity::Normal,
        }
    }

    /// Starts the log: `--log-level`, else `-vv`, else the variable `PLUMBLINE_LOG` say what is logged.
    pub(super) fn start_log(&self) {
        let by_count = match self.verbose {
            0 | 1 => None,
            2 => Some("info"),
            _ => Some("debug"),
        };
        let filter = match self.log_level.as_deref().or(by_count) {
            Some(text) => tracing_subscriber::EnvFilter::try_new(text),
            None => tracing_subscriber::EnvFilter::try_from_env("PLUMBLINE_LOG").or_else(|_| "off".parse()),
        };
        // `--log-level` was parsed before; a second start in one process keeps the first subscriber.
        if let Ok(filter) = filter {
            let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).try_init();
        }
    }
}

impl Session<'_> {
    /// The progress that is shown where `mode` is asked for.
    pub(super) fn progress(&self, mode: ProgressMode) -> ProgressMode {
        let for_people = matches!(mode, ProgressMode::Auto | ProgressMode::Plain);
        if for_people && self.verbosity == Verbosity::Quiet { ProgressMode::None } else { mode }
    }
}

/// Refuses what is no filter of a log.
fn log_filter(text: &str) -> Result<String, String> {
    let expected = "expected off, error, warn, info, debug, trace, or a list of MODULE=LEVEL";
    let known = ["off", "error", "warn", "info", "debug", "trace"];
    if !text.contains('=') && !known.contains(&text.to_ascii_lowercase().as_str()) {
        return Err(expected.to_owned());
    }
    match tracing_subscriber::EnvFilter::try_new(text) {
        Ok(_) => Ok(text.to_owned()),
        Err(error) => Err(format!("{error} ({expected})")),
    }
}

/// `-i` as FFmpeg has it.
fn refuse_input_flag(file: &str) -> Result<String, String> {
    Err(format!("inputs need no -i: give the path alone, as in `plumbline stabilize {file} -o OUTPUT`"))
}
