//! What all commands share: the global options, and the stages that do the work.

use std::ffi::OsString;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::{ArgAction, Args};
use tracing_subscriber::filter::{EnvFilter, FilterExt, filter_fn};
use tracing_subscriber::fmt::layer;
use tracing_subscriber::layer::{Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;

use super::defaults::Defaults;
use super::extension::Extension;
use super::failure::Failure;
use super::interrupt::Interrupt;
use crate::pipeline::options::ProgressMode;
use crate::pipeline::{RunError, StageRunner};

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
    /// Add a log of the run to a file: steps, warnings, errors; --log-level says how much
    #[arg(long, global = true, value_name = "FILE", help_heading = "Messages")]
    log_file: Option<PathBuf>,
    /// Of other programs; the error says how inputs are given here.
    #[arg(short = 'i', global = true, hide = true, value_name = "FILE", value_parser = refuse_input_flag)]
    _input: Option<String>,
}

/// Target of the events that say how an item ended.
pub(super) const RESULTS: &str = "plumbline::results";

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
    /// Options by which another process of this program logs the same.
    pub(super) log: Vec<OsString>,
    /// Settings of a file.
    pub(super) defaults: Option<Defaults>,
    /// What signals set.
    pub(super) interrupt: Interrupt,
    /// Commands of other crates.
    pub(super) extensions: &'a [Extension],
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

    /// What is logged, as `--log-level` or else `-vv` say.
    fn log(&self) -> Option<String> {
        let by_count = match self.verbose {
            0 | 1 => None,
            2 => Some("info"),
            _ => Some("debug"),
        };
        self.log_level.clone().or(by_count.map(str::to_owned))
    }

    /// Options by which another process of this program logs the same.
    pub(super) fn log_args(&self) -> Vec<OsString> {
        let level = self.log().map(|level| ["--log-level".into(), level.into()]);
        let file = self.log_file.as_ref().map(|file| ["--log-file".into(), file.into()]);
        level.into_iter().chain(file).flatten().collect()
    }

    /// Starts the log: `--log-level`, else `-vv`, else the variable `PLUMBLINE_LOG` say what goes to standard error. To a file
    /// goes the same, and steps, warnings and errors where nothing is said.
    pub(super) fn start_log(&self) -> Result<(), Failure> {
        let said = self.log().or_else(|| std::env::var("PLUMBLINE_LOG").ok());
        // `--log-level` was parsed before; what the variable holds may be anything.
        let filter = |default: &str| {
            let text = said.as_deref().unwrap_or(default);
            EnvFilter::try_new(text).unwrap_or_else(|_| EnvFilter::new(default))
        };
        let file = self.log_file.as_deref().map(opened).transpose()?;
        let plain = file.is_some();
        let to_file = file.map(|file| layer().with_ansi(false).with_writer(file).with_filter(filter("info")));
        // What goes to the file need not be on the screen as well, unless asked for.
        // How each item ended is printed there in any case.
        let shown = filter_fn(|event| event.target() != RESULTS).and(filter("off"));
        let to_screen =
            (!plain || self.log().is_some()).then(|| layer().with_writer(std::io::stderr).with_filter(shown));
        // A second start in one process keeps the first subscriber.
        let _ = tracing_subscriber::registry().with(to_file).with(to_screen).try_init();
        if plain {
            let args: Vec<_> = std::env::args_os().skip(1).collect();
            tracing::info!(version = env!("CARGO_PKG_VERSION"), ?args, "plumbline");
        }
        Ok(())
    }
}

/// Opens a log to add to: lines of several processes do not mix, since each is written at once.
fn opened(path: &Path) -> Result<Arc<File>, Failure> {
    let file = File::options().create(true).append(true).open(path);
    file.map(Arc::new).map_err(|e| RunError::Output(format!("{}: cannot be written: {e}", path.display())).into())
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
    match EnvFilter::try_new(text) {
        Ok(_) => Ok(text.to_owned()),
        Err(error) => Err(format!("{error} ({expected})")),
    }
}

/// `-i` as FFmpeg has it.
fn refuse_input_flag(file: &str) -> Result<String, String> {
    Err(format!("inputs need no -i: give the path alone, as in `plumbline stabilize {file} -o OUTPUT`"))
}
