//! `plumbline run`: executes a pipeline; every command that computes something ends here.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use clap::{Args, ValueEnum};

use super::engine::EngineArgs;
use super::failure::Failure;
use super::job::{AgainArgs, JobArgs, UseCacheArgs};
use super::session::{RESULTS, Session, Verbosity};
use super::{PipelineArgs, print, worker};
use crate::pipeline::execute::{Backend, Report, execute};
use crate::pipeline::options::ProgressMode;
use crate::pipeline::paths::{shown, to_text};
use crate::pipeline::progress::{error_line, for_mode, up_to_date_line};
use crate::pipeline::results::Results;
use crate::pipeline::{Exit, Instance, Pipeline, PipelineFile, check, print as file_text};

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
    #[command(flatten)]
    again: AgainArgs,
    #[command(flatten)]
    engine: EngineArgs,
    /// Also open files of this folder that an input names, such as buffers of glTF; may be repeated
    #[arg(long = "allow-path", value_name = "DIR")]
    allow_paths: Vec<PathBuf>,
    #[command(flatten)]
    cache: UseCacheArgs,
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
        let existing = self.again.existing().and_then(|how| how.to_possible_value());
        let existing = existing.map(|how| format!("run.existing={}", how.get_name()));
        let strict = self.strict.then(|| "run.strict=true".to_owned());
        self.pipeline.set.extend([jobs, threads, existing, strict, self.cache.forced()].into_iter().flatten());
        let mut pipeline = self.pipeline.read()?;
        pipeline.run.progress = self.progress.unwrap_or(pipeline.run.progress);
        let allowed = self.allow_paths.iter().map(|folder| folder.to_string_lossy().into_owned());
        pipeline.run.allow_paths.extend(allowed);
        self.cache.apply(&mut pipeline.run, |folder| to_text(folder));
        if self.print_pipeline {
            print(&file_text(&pipeline.file));
            return Ok(Exit::Done);
        }
        let again = &self.again;
        if self.engine.is_elsewhere()
            && (again.results.is_some() || again.retry_failed.is_some() || again.existing().is_some())
        {
            let why = "its tasks keep what is up to date, and report by their exit status";
            return Err(Failure::usage(format!("--engine takes no --existing, --results and --retry-failed: {why}")));
        }
        match self.engine.run(&pipeline, session)? {
            Some(exit) => Ok(exit),
            None => run_pipeline(&pipeline, &self.again, session),
        }
    }
}

/// Checks and runs the pipeline that a command's options mean, or prints it.
pub(super) fn run_or_print(file: PipelineFile, job: &JobArgs, session: &Session<'_>) -> Result<Exit, Failure> {
    let mut file = file;
    if let Some(defaults) = &session.defaults {
        defaults.apply(&mut file);
    }
    if job.print_pipeline {
        print(&file_text(&file));
        return Ok(Exit::Done);
    }
    run_pipeline(&check(file)?, &job.again, session)
}

/// Runs a checked pipeline, prints summaries and errors, and gives the exit status.
fn run_pipeline(pipeline: &Pipeline, again: &AgainArgs, session: &Session<'_>) -> Result<Exit, Failure> {
    let started = Instant::now();
    let mut instances = pipeline.instances()?;
    if let Some(path) = &again.retry_failed {
        keep_unfinished(&mut instances, path)?;
    }
    again.results.as_deref().map_or(Ok(()), Results::check_target)?;
    let interrupt = &session.interrupt;
    let mode = session.progress(pipeline.run.progress);
    let progress = for_mode(mode, std::io::stderr().is_terminal());
    let workers = worker::this_program(&session.log);
    let backend = Backend { stages: session.runner, workers: workers.as_ref() };
    let report = execute(pipeline, &instances, backend, progress.as_ref(), &interrupt.cancel);
    if mode == ProgressMode::None
        && session.verbosity != Verbosity::Quiet
        && let Some(line) = up_to_date_line(report.up_to_date(), instances.len())
    {
        // A closed standard error leaves nothing to print to.
        let _ = writeln!(std::io::stderr().lock(), "{line}");
    }
    if mode != ProgressMode::Json {
        print_report(&report, session.verbosity, progress.shows_errors());
    }
    print_outputs(&report);
    let exit = report.exit();
    let exit = if interrupt.cancel.load(Ordering::Relaxed) && exit != Exit::Done { interrupt.exit() } else { exit };
    if let Some(path) = &again.results {
        let written = Results::of(&report, &instances, exit, started.elapsed().as_secs_f64()).write(path);
        // A fault of the run itself weighs more.
        if let Err(error) = written {
            let failure = Failure::from(error);
            if exit == Exit::Done {
                return Err(failure);
            }
            failure.report();
        }
    }
    Ok(exit)
}

/// Drops the instances that an earlier run, whose results are at `path`, has made.
fn keep_unfinished(instances: &mut Vec<Instance>, path: &Path) -> Result<(), Failure> {
    let read = |e| Failure { exit: Exit::Input, message: format!("{}: {e}", path.display()), drawn: false };
    let results = Results::read(path).map_err(read)?;
    let mut left = results.unfinished();
    instances.retain(|instance| left.remove(instance.key.as_str()));
    let mut lost: Vec<&str> = left.into_iter().collect();
    lost.sort_unstable();
    let mut text = format!("{} of {} items of `{}` to do\n", instances.len(), results.items.len(), path.display());
    if let [first, others @ ..] = lost.as_slice() {
        let others = if others.is_empty() { String::new() } else { format!(" and {} others", others.len()) };
        // Writing to a string does not fail.
        let _ = writeln!(text, "warning: `{}`{others} of it are not among the inputs", shown(first));
    }
    // A closed standard error leaves nothing to print to.
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
    Ok(())
}

/// Summaries and errors for people; `reported`: the errors were printed as they occurred, and are not printed again.
fn print_report(report: &Report, verbosity: Verbosity, reported: bool) {
    let mut text = String::new();
    let many = report.items.len() > 1;
    log(report);
    for (key, summary) in report.done().filter(|(_, summary)| !summary.up_to_date) {
        match verbosity {
            Verbosity::Quiet => {}
            Verbosity::Normal => text += &summary.brief(),
            Verbosity::Detailed if many => text.extend([key, "\n", &summary.to_string()]),
            Verbosity::Detailed => text += &summary.to_string(),
        }
    }
    let failures: Vec<_> = report.failures().collect();
    if !reported {
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
    let _ = std::io::stderr().lock().write_all(shown(&text).as_bytes());
}

/// The same for the log.
fn log(report: &Report) {
    for (key, summary) in report.done() {
        summary.warnings.iter().for_each(|warning| tracing::warn!(target: RESULTS, "{key}: {warning}"));
        tracing::info!(target: RESULTS, "{key}: {}", summary.brief().lines().next().unwrap_or_default());
    }
    report.failures().for_each(|(key, error)| tracing::error!(target: RESULTS, "{key}: {error}"));
    report.skipped().for_each(|key| tracing::warn!(target: RESULTS, "{key}: not started"));
}

/// The paths written, one per line, for programs; a person has read them in the summary.
fn print_outputs(report: &Report) {
    let paths = || report.done().filter(|(_, s)| !s.up_to_date).flat_map(|(_, s)| &s.outputs);
    if std::io::stdout().is_terminal() || paths().any(|p| p == Path::new("-")) {
        return;
    }
    for path in paths() {
        print_path(path);
    }
}

/// A path as the bytes that it is: a program reads the name of a file.
fn print_path(path: &Path) {
    let mut out = std::io::stdout().lock();
    // A reader that went away has read enough.
    let _ = out
        .write_all(path.as_os_str().as_encoded_bytes())
        .and_then(|()| out.write_all(b"\n"))
        .and_then(|()| out.flush());
}
