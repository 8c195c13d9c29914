//! `plumbline task`: does one task of a plan, for an engine that hands them out.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Instant, SystemTime};

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::path_map::PathMapArgs;
use super::session::Session;
use crate::pipeline::execute::{Backend, Report, execute_alone};
use crate::pipeline::items::RECORDS_FOLDER;
use crate::pipeline::options::{Existing, ProgressMode, RunSettings};
use crate::pipeline::paths::{shown, to_path};
use crate::pipeline::progress::for_mode;
use crate::pipeline::records::{Records, Standing, refusal};
use crate::pipeline::tasks::{PATH_MAP_VARIABLE, Task, TaskPlan};
use crate::pipeline::{Exit, RunError, StageRunner};
use crate::stages::parts::PartJoiner;

#[derive(Debug, Args)]
pub(super) struct TaskArgs {
    #[command(subcommand)]
    command: TaskCommand,
}

#[derive(Debug, Subcommand)]
enum TaskCommand {
    /// Do one task of a plan: what an engine calls on one of its machines
    Run(TaskRunArgs),
}

#[derive(Debug, Args)]
struct TaskRunArgs {
    /// The plan, as `plumbline plan --json` wrote it
    #[arg(long, value_name = "FILE.json")]
    plan: PathBuf,
    /// The name of the task
    #[arg(long, value_name = "ID")]
    task: String,
    /// The folder that the plan's paths start from, on this machine
    #[arg(long, value_name = "DIR", default_value = ".")]
    root: PathBuf,
    /// Write only below this folder; may be repeated; the root if left out
    #[arg(long = "write-below", value_name = "DIR")]
    write_below: Vec<PathBuf>,
    #[command(flatten)]
    path_map: PathMapArgs,
    /// Threads; those that the plan states if left out
    #[arg(long, value_name = "N")]
    threads: Option<u32>,
    /// Form of the progress messages
    #[arg(long, value_enum, value_name = "HOW", default_value_t = ProgressMode::Auto)]
    progress: ProgressMode,
}

impl TaskArgs {
    pub(super) fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        match self.command {
            TaskCommand::Run(args) => args.run(session),
        }
    }
}

impl TaskRunArgs {
    fn run(self, session: &Session<'_>) -> Result<Exit, Failure> {
        let plan = TaskPlan::read(&self.plan).map_err(|e| Failure::new(e.exit(), e.to_string()))?;
        let unknown = || Failure::usage(format!("the plan has no task `{}`", shown(&self.task)));
        let map = self.path_map.map()?.with_variable(std::env::var_os(PATH_MAP_VARIABLE).as_deref());
        let map = map.map_err(Failure::usage)?;
        let mapped = |task: &Task| {
            let mut task = task.clone();
            task.map_paths(&map).map_err(|e| Failure::usage(format!("task `{}`: {e}", task.id)))?;
            Ok::<Task, Failure>(task)
        };
        let task = &mapped(plan.task(&self.task).ok_or_else(unknown)?)?;
        let instance = task.instance().map_err(|e| Failure::usage(format!("{}: {e}", self.plan.display())))?;
        // A share that is not mounted may be there on the next try, or on another machine.
        let absent = |e| Failure::new(Exit::Temporary, format!("the root `{}` is not there: {e}", self.root.display()));
        let root = self.root.canonicalize().map_err(absent)?;
        let below: Vec<PathBuf> = if self.write_below.is_empty() {
            vec![root.clone()]
        } else {
            let folder = |folder: &PathBuf| {
                let absent =
                    |e| Failure::new(Exit::Output, format!("no folder `{}` to write below: {e}", folder.display()));
                folder.canonicalize().map_err(absent)
            };
            self.write_below.iter().map(folder).collect::<Result<_, Failure>>()?
        };
        std::env::set_current_dir(&root).map_err(absent)?;
        check_outputs(task, &below)?;
        check_inputs(task)?;
        let whole = task.part_of.as_deref().and_then(|id| plan.task(id)).map(mapped).transpose()?;
        let whole = whole.as_ref();
        if let Some(whole) = whole
            && is_done(whole)?
        {
            report_end(whole, &task.id, &format!("up to date: so is `{}`\n", whole.id));
            return Ok(Exit::Done);
        }
        let options = task.options();
        let run = RunSettings {
            threads: self.threads.unwrap_or_else(|| u32::try_from(options.threads).unwrap_or(u32::MAX)),
            existing: Some(Existing::Skip),
            strict: options.strict,
            allow_paths: options.allow_paths.iter().map(crate::pipeline::paths::to_text).collect(),
            ..RunSettings::default()
        };
        let progress = for_mode(session.progress(self.progress), std::io::stderr().is_terminal());
        let folder = task.parts_folder();
        let joiner = task.parts().map(|parts| PartJoiner { folder: &folder, parts });
        let stages: &dyn StageRunner = match &joiner {
            Some(joiner) => joiner,
            None => session.runner,
        };
        let backend = Backend { stages, workers: None };
        let started = Instant::now();
        let report = execute_alone(&run, instance, backend, progress.as_ref(), &session.interrupt.cancel);
        let exit = report.exit();
        let stopped = session.interrupt.cancel.load(Ordering::Relaxed) && exit != Exit::Done;
        let exit = if stopped { session.interrupt.exit() } else { exit };
        let text = log_text(&report, exit, started.elapsed().as_secs_f64());
        report_end(whole.unwrap_or(task), &task.id, &text);
        if matches!(exit, Exit::Done | Exit::Partial)
            && let Err(error) = task.remove_parts()
        {
            tracing::warn!("`{folder}` is left: {error}");
        }
        Ok(exit)
    }
}

/// The results of a task that this one does a part of are there, made from what they would be made from now. Others in their place are
/// refused at once, and not only when all parts are done.
fn is_done(whole: &Task) -> Result<bool, Failure> {
    let instance = whole.instance().map_err(Failure::usage)?;
    let standing = Records::default().standing(&instance);
    match refusal(&standing, &instance) {
        Some(message) => Err(Failure::new(Exit::Output, message)),
        None => Ok(standing == Standing::UpToDate),
    }
}

/// Reports how task `id` ended, on standard error and in the log beside the results of `whole`, which it is or does a part of.
fn report_end(whole: &Task, id: &str, text: &str) {
    // Standard error is kept by most engines; where it is closed, the log beside the result is left.
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
    if let Err(error) = write_log(whole, id, text) {
        tracing::warn!("no log beside the results: {error}");
    }
}

/// Refuses results outside the folders that may be written to.
fn check_outputs(task: &Task, below: &[PathBuf]) -> Result<(), Failure> {
    let Some(output) = task.output_outside(below) else { return Ok(()) };
    let folders: Vec<String> = below.iter().map(|folder| format!("`{}`", folder.display())).collect();
    let outside =
        format!("task `{}` writes `{}`, which is not below {}", task.id, shown(&output), folders.join(" or "));
    Err(Failure::new(Exit::Output, outside + "; allow a folder with --write-below"))
}

/// Refuses to make from other files what the plan says.
fn check_inputs(task: &Task) -> Result<(), Failure> {
    match task.changed_input() {
        None => Ok(()),
        Some(input) if input.is_missing => {
            let message = format!("`{}` is not there, which task `{}` reads", shown(input.path), task.id);
            Err(RunError::Input(message + "; does this machine have the shared folder at --root?").into())
        }
        Some(input) => {
            let message = format!("`{}` changed since the plan was made", shown(input.path));
            Err(Failure::new(Exit::OtherPlan, message + "; make the plan again"))
        }
    }
}

/// How a task ended.
fn log_text(report: &Report, exit: Exit, seconds: f64) -> String {
    let mut text = String::new();
    for (_, summary) in report.done() {
        text += &if summary.up_to_date { "up to date\n".to_owned() } else { summary.to_string() };
    }
    for (_, error) in report.failures() {
        // Writing to a string does not fail.
        let _ = writeln!(text, "error: {}", shown(&error.to_string()));
    }
    let _ = writeln!(text, "exit status {} after {seconds:.1} s", exit as u8);
    text
}

/// Adds to the log of task `id`, in the folder of records beside the first result of `whole`.
fn write_log(whole: &Task, id: &str, text: &str) -> std::io::Result<()> {
    let Some(first) = whole.outputs.first() else { return Ok(()) };
    let path = to_path(first);
    let folder = path.parent().unwrap_or(Path::new("")).join(RECORDS_FOLDER).join("logs");
    std::fs::create_dir_all(&folder)?;
    let mut file = std::fs::File::options().create(true).append(true).open(folder.join(format!("{id}.log")))?;
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |time| time.as_secs());
    // Linux alone has it in a file.
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let host = host.trim();
    file.write_all(format!("--- {since} {host} process {}\n{text}", std::process::id()).as_bytes())
}
