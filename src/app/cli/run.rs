//! `plumbline run`: executes a pipeline; every command that computes something ends here.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use clap::Args;

use super::failure::Failure;
use super::session::{Session, Verbosity};
use super::{PipelineArgs, print, worker};
use crate::pipeline::execute::{Backend, Report, execute};
use crate::pipeline::options::ProgressMode;
use crate::pipeline::progress::{error_line, for_mode};
use crate::pipeline::{Exit, Pipeline, PipelineFile, check, print as file_text};

#[derive(Debug, Args)]
pub(super) struct RunArgs {
    #[command(flatten)]
    pipeline: PipelineArgs,
    /// Items at work at once
    #[arg(long, value_name = "N")]
    jobs: Option<u32>,
    /// Threads for the whole run; 0 = all processors
    #[arg(long, value_name = "N")]
    threads: Option<u32>,
    /// Replace existing files
    #[arg(short = 'y', visible_short_alias = 'f', long)]
    overwrite: bool,
    /// Also open files of this folder that an input names, such as buffers of glTF; may be repeated
    #[arg(long = "allow-path", value_name = "DIR")]
    allow_paths: Vec<PathBuf>,
    /// Losses are errors, not warnings: a clip that is cut short, a stream that a container cannot store
    #[arg(long)]
    strict: bool,
    /// Form of the progress messages
    #[arg(long, value_enum, value_name = "HOW")]
    progress: Option<ProgressMode>,
    /// Print the pipeline as it would run, and do nothing
    #[arg(long)]
    print_pipeline: bool,
}

impl RunArgs {
    pub(super) fn run(mut self, session: &Session<'_>) -> Result<Exit, Failure> {
        let jobs = self.jobs.map(|n| format!("batch.jobs={n}"));
        let threads = self.threads.map(|n| format!("run.threads={n}"));
        let overwrite = self.overwrite.then(|| "run.overwrite=true".to_owned());
        let strict = self.strict.then(|| "run.strict=true".to_owned());
        self.pipeline.set.extend([jobs, threads, overwrite, strict].into_iter().flatten());
        let mut pipeline = self.pipeline.read()?;
        pipeline.run.progress = self.progress.unwrap_or(pipeline.run.progress);
        let allowed = self.allow_paths.iter().map(|folder| folder.to_string_lossy().into_owned());
        pipeline.run.allow_paths.extend(allowed);
        if self.print_pipeline {
            print(&file_text(&pipeline.file));
            return Ok(Exit::Done);
        }
        run_pipeline(&pipeline, session)
    }
}

/// Checks and runs the pipeline that a command's options mean, or prints it.
pub(super) fn run_or_print(file: PipelineFile, print_only: bool, session: &Session<'_>) -> Result<Exit, Failure> {
    let mut file = file;
    if let Some(defaults) = &session.defaults {
        defaults.apply(&mut file);
    }
    if print_only {
        print(&file_text(&file));
        return Ok(Exit::Done);
    }
    run_pipeline(&check(file)?, session)
}

/// Runs a checked pipeline, prints summaries and errors, and gives the exit status.
fn run_pipeline(pipeline: &Pipeline, session: &Session<'_>) -> Result<Exit, Failure> {
    let instances = pipeline.instances()?;
    let interrupt = &session.interrupt;
    let mode = session.progress(pipeline.run.progress);
    let progress = for_mode(mode, std::io::stderr().is_terminal());
    let workers = worker::this_program(&session.log);
    let backend = Backend { stages: session.runner, workers: workers.as_ref() };
    let report = execute(pipeline, &instances, backend, progress.as_ref(), &interrupt.cancel);
    if mode != ProgressMode::Json {
        print_report(&report, session.verbosity, progress.shows_errors());
    }
    print_outputs(&report);
    let exit = report.exit();
    Ok(if interrupt.cancel.load(Ordering::Relaxed) && exit != Exit::Done { interrupt.exit() } else { exit })
}

/// Summaries and errors for people; `shown`: the errors were printed as they occurred, and are not printed again.
fn print_report(report: &Report, verbosity: Verbosity, shown: bool) {
    let mut text = String::new();
    let many = report.items.len() > 1;
    log(report);
    for (key, summary) in report.done() {
        match verbosity {
            Verbosity::Quiet => {}
            Verbosity::Normal => text += &summary.brief(),
            Verbosity::Detailed if many => text.extend([key, "\n", &summary.to_string()]),
            Verbosity::Detailed => text += &summary.to_string(),
        }
    }
    let failures: Vec<_> = report.failures().collect();
    if !shown {
        for (key, error) in &failures {
            text.extend([&error_line(key, &error.to_string(), many), "\n"]);
        }
    }
    if many && !failures.is_empty() {
        // Writing to a string does not fail, here and below.
        let _ = writeln!(text, "{} of {} items failed", failures.len(), report.items.len());
    }
    let skipped: Vec<&str> = report.skipped().collect();
    if !skipped.is_empty() {
        let _ = writeln!(text, "not started: {}", skipped.join(", "));
    }
    // A closed standard error leaves nothing to print to.
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
}

/// The same for the log.
fn log(report: &Report) {
    for (key, summary) in report.done() {
        summary.warnings.iter().for_each(|warning| tracing::warn!("{key}: {warning}"));
        tracing::info!("{key}: {}", summary.brief().lines().next().unwrap_or_default());
    }
    report.failures().for_each(|(key, error)| tracing::error!("{key}: {error}"));
    report.skipped().for_each(|key| tracing::warn!("{key}: not started"));
}

/// The paths written, one per line, for programs; a person has read them in the summary.
fn print_outputs(report: &Report) {
    let paths = || report.done().flat_map(|(_, s)| &s.outputs);
    if std::io::stdout().is_terminal() || paths().any(|p| p == Path::new("-")) {
        return;
    }
    for path in paths() {
        print(&format!("{}\n", path.display()));
    }
}
