//! `plumbline run`: executes a pipeline; the way of every command that computes something.

use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::Ordering;

use clap::Args;

use super::failure::Failure;
use super::interrupt::Interrupt;
use super::{PipelineArgs, tell};
use crate::pipeline::execute::{Report, execute};
use crate::pipeline::options::ProgressMode;
use crate::pipeline::progress::for_mode;
use crate::pipeline::{Exit, Pipeline, PipelineFile, StageRunner, check, print};

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
    #[arg(long)]
    overwrite: bool,
    /// How progress is told
    #[arg(long, value_enum, value_name = "HOW")]
    progress: Option<ProgressMode>,
    /// Print the pipeline as it would run, and do nothing
    #[arg(long)]
    print_pipeline: bool,
}

impl RunArgs {
    pub(super) fn run(mut self, backend: &dyn StageRunner) -> Result<Exit, Failure> {
        let jobs = self.jobs.map(|n| format!("batch.jobs={n}"));
        let threads = self.threads.map(|n| format!("run.threads={n}"));
        let overwrite = self.overwrite.then(|| "run.overwrite=true".to_owned());
        self.pipeline.set.extend([jobs, threads, overwrite].into_iter().flatten());
        let mut pipeline = self.pipeline.read()?;
        pipeline.run.progress = self.progress.unwrap_or(pipeline.run.progress);
        if self.print_pipeline {
            tell(&print(&pipeline.file));
            return Ok(Exit::Done);
        }
        run_pipeline(&pipeline, backend)
    }
}

/// Checks and runs the pipeline that a command's options mean, or prints it.
pub(super) fn run_or_print(file: PipelineFile, print_only: bool, backend: &dyn StageRunner) -> Result<Exit, Failure> {
    if print_only {
        tell(&print(&file));
        return Ok(Exit::Done);
    }
    run_pipeline(&check(file)?, backend)
}

/// Runs a checked pipeline, tells summaries and failures, and gives the exit status.
fn run_pipeline(pipeline: &Pipeline, backend: &dyn StageRunner) -> Result<Exit, Failure> {
    let instances = pipeline.instances()?;
    let interrupt = Interrupt::install()?;
    let progress = for_mode(pipeline.run.progress, std::io::stderr().is_terminal());
    let report = execute(pipeline, &instances, backend, progress.as_ref(), &interrupt.cancel);
    let machine = pipeline.run.progress == ProgressMode::Json;
    if !machine {
        tell_report(&report);
    }
    tell_outputs(&report);
    let exit = report.exit();
    Ok(if interrupt.cancel.load(Ordering::Relaxed) && exit != Exit::Done { interrupt.exit() } else { exit })
}

/// Summaries and failures for people. There is nowhere left to complain where standard error is closed.
fn tell_report(report: &Report) {
    let mut err = std::io::stderr().lock();
    let many = report.items.len() > 1;
    for (key, summary) in report.done() {
        let heading = if many { format!("{key}\n") } else { String::new() };
        let _ = write!(err, "{heading}{summary}");
    }
    let failures: Vec<_> = report.failures().collect();
    if many && !failures.is_empty() {
        let _ = writeln!(err, "error: {} of {} items failed", failures.len(), report.items.len());
    }
    for (key, error) in failures {
        // Most errors begin with the name of the file at fault, which is often the key.
        let error = error.to_string();
        let named = !many || error.starts_with(&format!("{key}: "));
        let _ = if named { writeln!(err, "error: {error}") } else { writeln!(err, "error: {key}: {error}") };
    }
    let skipped: Vec<&str> = report.skipped().collect();
    if !skipped.is_empty() {
        let _ = writeln!(err, "not started: {}", skipped.join(", "));
    }
}

/// The paths written, one per line, for programs; a person has read them in the summary.
fn tell_outputs(report: &Report) {
    let paths = || report.done().flat_map(|(_, s)| &s.outputs);
    if std::io::stdout().is_terminal() || paths().any(|p| p == Path::new("-")) {
        return;
    }
    for path in paths() {
        tell(&format!("{}\n", path.display()));
    }
}
