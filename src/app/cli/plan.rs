//! `plumbline plan`: the passes of a pipeline and what each holds in memory; its tasks, how they are, and as JSON for engines.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::path_map::PathMapArgs;
use super::session::{Session, Verbosity};
use super::{PipelineArgs, print};
use crate::pipeline::cache::{Cache, digest_of_file};
use crate::pipeline::memory::human_bytes;
use crate::pipeline::paths::to_path;
use crate::pipeline::plan::temporary_space;
use crate::pipeline::progress::up_to_date_line;
use crate::pipeline::records::{Records, Standing};
use crate::pipeline::tasks::{Forecast, TaskFormat, TaskPlan, export};
use crate::pipeline::{Exit, Instance, Pipeline, Plan};
use crate::stages::files::write_whole;
use plumbline_num::files::{IfExists, free_space};

#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct PlanArgs {
    #[command(subcommand)]
    command: Option<PlanCommand>,
    #[command(flatten)]
    pipeline: Option<PipelineArgs>,
    /// Print the tasks as JSON, for engines: one per item, or several with --split
    #[arg(long)]
    json: bool,
    /// The folder that the paths of the tasks start from, which all machines have; the working directory if left out
    #[arg(long, value_name = "DIR", requires = "json")]
    root: Option<PathBuf>,
    /// Also state the contents of the inputs, so that a copy with another time counts as unchanged; reads every input, except those
    /// that the cache knows
    #[arg(long, requires = "json")]
    digests: bool,
    /// Split each stabilized clip that is longer into tasks of about this length, seconds, and read the packets of each for that
    #[arg(long, value_name = "SECONDS", value_parser = seconds_of_split)]
    split: Option<f64>,
    /// Print the expected time on so many workers, each of which does one task at a time; 1, 4 and 16 if left out
    #[arg(long, value_name = "N,…", value_delimiter = ',', conflicts_with = "json",
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    workers: Vec<u32>,
    /// Write the tasks to a file instead
    #[arg(short, long, value_name = "FILE.json", requires = "json")]
    output: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum PlanCommand {
    /// Write a plan for make, Slurm, HyperQueue or Graphviz
    Export(PlanExportArgs),
}

#[derive(Debug, Args)]
struct PlanExportArgs {
    /// The plan, as `plumbline plan --json` wrote it
    #[arg(value_name = "FILE.json")]
    plan: PathBuf,
    /// For which program
    #[arg(long, value_enum, value_name = "FORMAT")]
    format: TaskFormat,
    /// The folder that the paths of the tasks start from, on the machines that run them; the working directory if left out
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    #[command(flatten)]
    path_map: PathMapArgs,
}

impl PlanArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        match (self.command, self.pipeline) {
            (Some(PlanCommand::Export(args)), _) => args.run(),
            (None, Some(args)) if self.json => args.tasks(self.root, self.output, self.digests, self.split, session),
            (None, Some(args)) => args.passes(self.split, &self.workers, session),
            (None, None) => Err(Failure::usage("give a pipeline file, or the name of a shipped one")),
        }
    }
}

impl PipelineArgs {
    /// Prints or writes the tasks.
    fn tasks(
        &self,
        root: Option<PathBuf>,
        output: Option<PathBuf>,
        digests: bool,
        split: Option<f64>,
        session: &Session<'_>,
    ) -> Result<Exit, Failure> {
        let pipeline = self.read()?;
        let instances = pipeline.instances()?;
        let root = root.unwrap_or_else(|| PathBuf::from("."));
        let mut plan = TaskPlan::of(&pipeline, &instances, &root, session.runner)?;
        if digests {
            // Without a cache, every file is read.
            let cache = pipeline.run.cache_use().and_then(|used| used.open().ok());
            plan.state_contents(&root, |path| {
                cache.as_ref().map_or_else(|| digest_of_file(path), |cache| cache.digest_of(path))
            })?;
        }
        if let Some(seconds) = split {
            split_clips(&mut plan, &root, seconds, session)?;
        }
        let text = plan.to_text()?;
        match output {
            Some(path) => write_whole(&path, text, IfExists::Replace)?,
            None => print(&text),
        }
        Ok(Exit::Done)
    }

    /// Prints the passes, and how the tasks are.
    fn passes(&self, split: Option<f64>, workers: &[u32], session: &Session<'_>) -> Result<Exit, Failure> {
        let pipeline = self.read()?;
        // A plan can be read before the clips exist: then the figures stay symbolic.
        let instances = self.instances(&pipeline)?;
        let first = instances.first();
        let clip = first
            .and_then(|i| i.inputs().into_iter().next())
            .and_then(|path| session.runner.probe(&path, false).ok())
            .and_then(|probed| probed.shape);
        let graph = first.map_or(&pipeline.graph, |i| &i.graph);
        let mut text = String::new();
        if let (Some(batch), Some(first)) = (&pipeline.batch, first) {
            let count = instances.len();
            let jobs = if batch.jobs == 0 { "as many as fit".to_owned() } else { batch.jobs.to_string() };
            let records = Records::default();
            let is_done = |instance: &&Instance| records.standing(instance) == Standing::UpToDate;
            let done = instances.iter().filter(is_done).count();
            let done = up_to_date_line(done, count).map_or_else(String::new, |line| format!(" ({line})"));
            text = format!("{count} items{done}, {jobs} at once; figures for `{}`\n", first.key);
        }
        text.push_str(&Plan::of(graph).describe(graph, clip.as_ref()));
        let folder = std::env::temp_dir();
        let needed = clip.is_some_and(|clip| temporary_space(graph, &clip) > 0);
        if let Some(free) = free_space(&folder).filter(|_| needed) {
            // Writing to a string does not fail.
            let _ = writeln!(text, "free for temporary files: {} in {}", human_bytes(free), folder.display());
        }
        if let Some(forecast) = forecast(&pipeline, &instances, split, session)? {
            let rows = if session.verbosity == Verbosity::Detailed { usize::MAX } else { ROWS };
            let workers: Vec<usize> = workers.iter().map(|n| *n as usize).collect();
            let workers = if workers.is_empty() { WORKERS.to_vec() } else { workers };
            text = text + "\n" + &forecast.table(rows) + &forecast.totals(&workers);
        }
        print(&text);
        Ok(Exit::Done)
    }
}

/// Tasks that are listed: of more, their number is what is looked for.
const ROWS: usize = 20;
/// Workers for which the time is printed, where none are given.
const WORKERS: [usize; 3] = [1, 4, 16];

/// How the tasks of a pipeline are; `None` where it has none: nothing to work on, or standard input and output, which are of no plan.
fn forecast(
    pipeline: &Pipeline,
    instances: &[Instance],
    split: Option<f64>,
    session: &Session<'_>,
) -> Result<Option<Forecast>, Failure> {
    let is_standard =
        |instance: &Instance| [instance.inputs(), instance.outputs()].concat().iter().any(|p| p == Path::new("-"));
    if instances.is_empty() || instances.iter().any(is_standard) {
        return Ok(None);
    }
    let root = Path::new(".");
    let mut plan = TaskPlan::of(pipeline, instances, root, session.runner)?;
    if let Some(seconds) = split {
        split_clips(&mut plan, root, seconds, session)?;
    }
    // To look into a cache does not make one.
    let used = pipeline.run.cache_use();
    let cache = used.and_then(|used| Cache::existing(&to_path(&used.folder), used.trusted).ok().flatten());
    Ok(Some(plan.forecast(cache.as_ref())?))
}

/// Shortest part of a clip, s: of less, the first key frames and the files between tasks would take more than the frames.
const MIN_SPLIT_S: f64 = 1.0;

/// The length of the parts of a clip.
pub(super) fn seconds_of_split(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|s: &f64| s.is_finite() && *s >= MIN_SPLIT_S);
    seconds.ok_or_else(|| format!("expected {MIN_SPLIT_S} second or more"))
}

/// Splits long clips, and reports those that stay one task.
pub(super) fn split_clips(
    plan: &mut TaskPlan,
    root: &Path,
    seconds: f64,
    session: &Session<'_>,
) -> Result<(), Failure> {
    for note in plan.split(root, seconds, session.runner)? {
        // Where standard error is closed, nobody reads it.
        let _ = writeln!(std::io::stderr().lock(), "note: {note}");
    }
    Ok(())
}

impl PlanExportArgs {
    fn run(self) -> Result<Exit, Failure> {
        let plan = TaskPlan::read(&self.plan).map_err(|e| Failure::new(e.exit(), e.to_string()))?;
        // Where it runs, the working directory is another.
        let absolute = |path: PathBuf| std::path::absolute(&path).unwrap_or(path);
        let root = self.root.unwrap_or_else(|| absolute(PathBuf::from(".")));
        let map = self.path_map.map()?;
        print(&export(&plan, &absolute(self.plan), &root, &map, self.format));
        Ok(Exit::Done)
    }
}
