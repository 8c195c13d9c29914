//! A pipeline as tasks that any engine can run: one per item, or several for a long clip ([`TaskPlan::split`]), each the work of one call
//! of `plumbline task run`.
//!
//! The plan states for each task all that an engine needs: what it reads and writes, what it waits for, what it takes, and how often
//! to try. Its paths are relative to a root, so that another machine may have the folder elsewhere; files outside stay absolute. It
//! follows from the pipeline and its inputs alone: the same bytes each time.
//!
//! A task may be run by anybody, at any time, twice or at once: results that are [up to date](super::records) are kept, others
//! appear under their names when they are whole.
//!
//! ```json
//! { "format": "plumbline.plan", "version": 1, "program": "0.1.0",
//!   "tasks": [ { "id": "tour.mp4", "key": "b3:9c1e…", "after": [], "outputs": ["out/tour.mp4"],
//!                "inputs": [ { "path": "clips/tour.mp4", "file": { "size": 812345678, "mtime_ns": 1764230400000000000 } } ],
//!                "resources": { "cpus": 2, "memory_mb": 310, "gpus": 0 }, "retries": 2, "timeout_s": 86400,
//!                "estimate": { "seconds": 41.2, "disk_mb": 52.7, "work": {}, "stages": { "video.track": 12.3, "video.encode": 28.9 } },
//!                "order": { "key": "clips/tour.mp4", "stages": [] } } ] }
//! ```

mod export;
mod forecast;
mod path_map;
mod split;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::batch::Instance;
use super::cache::digest_of_file;
use super::check::Pipeline;
use super::estimate::Estimate;
use super::execute::BYTES_PER_PHOTO;
use super::job::{JobOptions, StageRunner};
use super::paths::{to_path, to_text};
use super::records::{Stamp, resolved};
use super::run_error::{Exit, RunError};
use super::setting_paths::{PathSetting, for_each_path};
use super::worker::Order;
use crate::stages::parts::ClipParts;
use plumbline_num::document::{Kind, VERSION};

pub use export::{TaskFormat, export};
pub use forecast::{Forecast, TaskForecast, TaskState};
pub use path_map::{PATH_MAP_VARIABLE, PathMap, PathRule};

/// Files of plans.
const KIND: Kind = Kind { name: "a plan of tasks", format: "plumbline.plan", max_bytes: 1 << 30 };

/// Times that a task is tried again, where the pipeline does not say.
const RETRIES: u32 = 2;
/// Memory of the program itself beside what stages state, bytes.
const PROGRAM_BYTES: u64 = 150 << 20;
/// Longest time for a task, s: a day for clips, an hour for all else.
const TIMEOUTS: (u64, u64) = (86_400, 3_600);
/// Longest name of a task, characters.
const MAX_ID: usize = 80;

/// The tasks of a pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskPlan {
    format: String,
    version: u32,
    /// Version of the program that made it, which alone runs it.
    pub program: String,
    /// The tasks, each behind those that it waits for.
    pub tasks: Vec<Task>,
}

/// The work of one call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Its name, unique in the plan: letters, digits, `.`, `_` and `-`.
    pub id: String,
    /// BLAKE3 over all that decides its results, and where they go.
    pub key: String,
    /// Tasks that must be done before.
    pub after: Vec<String>,
    /// Files that it reads.
    pub inputs: Vec<TaskInput>,
    /// Files and folders that it writes.
    pub outputs: Vec<String>,
    /// What it takes.
    pub resources: Resources,
    /// Times that it is tried again after a failure that may be temporary.
    pub retries: u32,
    /// Longest time, s.
    pub timeout_s: u64,
    /// What it is expected to take, by the model that is shipped with the program: the same on every machine.
    #[serde(default)]
    pub estimate: Estimate,
    /// The task of the clip that this one does a part of: where that is done, this one is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part_of: Option<String>,
    /// What the tasks before made, where this one joins it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    parts: Option<ClipParts>,
    /// The work.
    order: Order,
}

/// A file as it was when the plan was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskInput {
    /// Its path.
    pub path: String,
    /// `None`: it was not there.
    file: Option<Stamp>,
    /// BLAKE3 of its content, where the plan states it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    digest: Option<String>,
}

/// What a task takes of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Resources {
    /// Threads.
    pub cpus: usize,
    /// Memory at its peak, MB.
    pub memory_mb: u64,
    /// Graphics cards.
    pub gpus: u32,
}

impl TaskPlan {
    /// The tasks of `instances`, whose paths are relative to the working directory; those of the plan are relative to `root`.
    ///
    /// # Errors
    /// [`RunError::Input`] for a root that is no folder, [`RunError::Usage`] for standard input and output, which have no place in
    /// a plan.
    pub fn of(
        pipeline: &Pipeline,
        instances: &[Instance],
        root: &Path,
        runner: &dyn StageRunner,
    ) -> Result<Self, RunError> {
        let no_folder = |e| RunError::Input(format!("the root `{}` is no folder: {e}", root.display()));
        let root = root.canonicalize().map_err(no_folder)?;
        let mut ids = Ids::default();
        let batch = pipeline.batch.clone().unwrap_or_default();
        let still = pipeline.graph.is_still();
        // Stills do not gain by more threads; of clips decoding and encoding overlap.
        let cpus = match pipeline.run.threads {
            0 if still => 1,
            0 => 2,
            threads => (threads as usize / (batch.jobs as usize).max(1)).max(1),
        };
        let task = |instance: &Instance| -> Result<Task, RunError> {
            let clip = if still { None } else { clip_of(instance, runner) };
            let memory = clip.map_or(BYTES_PER_PHOTO, |clip| {
                instance.plan.passes.iter().map(|pass| pass.memory(&instance.graph, Some(&clip))).max().unwrap_or(0)
            });
            let options = JobOptions {
                threads: cpus,
                overwrite: false,
                strict: pipeline.run.strict || instance.is_strict(),
                allow_paths: pipeline.run.allowed_folders(),
                // Each machine has its own.
                cache: None,
            };
            let estimate = Estimate::of(instance, &runner.work_size(instance, clip.as_ref()), cpus);
            let mut order = Order::of(instance, options);
            let stages = instance.graph.stages.iter();
            let path = |path: &str| relative(path, &root);
            for (kind, settings) in order.kinds_and_settings().filter_map(|(kind, settings)| Some((kind?, settings))) {
                for_each_path(&kind.json_schema(), settings, &mut |text, setting| {
                    // A lens is a file or a word.
                    if setting == PathSetting::Path || to_path(text).is_file() {
                        *text = path(text)?;
                    }
                    Ok::<(), RunError>(())
                })?;
            }
            let input = |read: &str| Ok(TaskInput { path: path(read)?, file: Stamp::of(&to_path(read)), digest: None });
            let inputs: Vec<TaskInput> =
                stages.flat_map(|stage| stage.settings.reads()).map(input).collect::<Result<_, RunError>>()?;
            let written = [instance.outputs(), instance.folders()].concat();
            let outputs = written.iter().map(|p| path(&to_text(p))).collect::<Result<Vec<String>, RunError>>()?;
            Ok(Task {
                id: ids.next(&instance.key),
                key: key_of(&order, &inputs)?,
                after: Vec::new(),
                inputs,
                outputs,
                resources: Resources { cpus, memory_mb: (PROGRAM_BYTES + memory).div_ceil(1_000_000), gpus: 0 },
                retries: if batch.retries > 0 { batch.retries } else { RETRIES },
                timeout_s: if still { TIMEOUTS.1 } else { TIMEOUTS.0 },
                estimate,
                part_of: None,
                parts: None,
                order,
            })
        };
        let tasks = instances.iter().map(task).collect::<Result<_, RunError>>()?;
        let program = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Self { format: KIND.format.to_owned(), version: VERSION, program, tasks })
    }

    /// States the content of each input that is a file, by its digest as `digest_of` gives it: a copy with another time counts as
    /// unchanged then, and the keys of tasks are those of the contents. `root` is that of the plan.
    ///
    /// # Errors
    /// [`RunError::Input`] for an input that cannot be read.
    pub fn state_contents(
        &mut self,
        root: &Path,
        digest_of: impl Fn(&Path) -> std::io::Result<String>,
    ) -> Result<(), RunError> {
        for task in &mut self.tasks {
            for input in &mut task.inputs {
                let path = root.join(to_path(&input.path));
                if path.is_file() {
                    let failed = |e| RunError::Input(format!("{}: {e}", path.display()));
                    input.digest = Some(digest_of(&path).map_err(failed)?);
                }
            }
            task.key = key_of(&task.order, &task.inputs)?;
        }
        Ok(())
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn read(path: &Path) -> Result<Self, PlanError> {
        let wrong = |fault: String| PlanError::Read(format!("{}: {fault}", path.display()));
        let text = KIND.text(path).map_err(|e| wrong(e.to_string()))?;
        Self::parse(&text).map_err(|error| match error {
            PlanError::Read(fault) => wrong(fault),
            version @ PlanError::Version { .. } => version,
        })
    }

    /// Reads the text of a plan.
    ///
    /// # Errors
    /// [`PlanError`].
    pub fn parse(text: &str) -> Result<Self, PlanError> {
        let wrong = PlanError::Read;
        let json: Json = serde_json::from_str(text).map_err(|e| wrong(format!("not a plan of tasks: {e}")))?;
        if json["format"] != KIND.format {
            return Err(wrong(format!("not a plan of tasks (expected \"format\": \"{}\")", KIND.format)));
        }
        let program = json["program"].as_str().unwrap_or("another version");
        if json["version"] != VERSION || program != env!("CARGO_PKG_VERSION") {
            return Err(PlanError::Version { program: program.to_owned() });
        }
        let plan: Self = serde_json::from_value(json).map_err(|e| wrong(format!("not a plan of tasks: {e}")))?;
        plan.check().map_err(wrong)?;
        Ok(plan)
    }

    /// The plan as the text of a file.
    ///
    /// # Errors
    /// [`RunError::Internal`]: none is known.
    pub fn to_text(&self) -> Result<String, RunError> {
        serde_json::to_string(self).map(|text| text + "\n").map_err(|e| RunError::Internal(e.to_string()))
    }

    /// The task of this name.
    pub fn task(&self, id: &str) -> Option<&Task> {
        self.tasks.iter().find(|task| task.id == id)
    }

    /// Names are fit for files and shells, and each task is behind those that it waits for.
    fn check(&self) -> Result<(), String> {
        let mut before = HashSet::new();
        for task in &self.tasks {
            if !is_id(&task.id) {
                return Err(format!("`{}` is no name of a task", task.id.escape_default()));
            }
            if let Some(missing) = task.after.iter().find(|id| !before.contains(id.as_str())) {
                let missing = missing.escape_default();
                return Err(format!("task `{}` waits for `{missing}`, which is not before it", task.id));
            }
            if !before.insert(task.id.as_str()) {
                return Err(format!("two tasks are called `{}`", task.id));
            }
        }
        let whole = |task: &Task| task.part_of.as_ref().filter(|id| !before.contains(id.as_str())).cloned();
        if let Some(missing) = self.tasks.iter().find_map(whole) {
            return Err(format!("a task does a part of `{}`, which is no task", missing.escape_default()));
        }
        Ok(())
    }
}

impl Task {
    /// The work, with its paths relative to the root: run it there.
    ///
    /// # Errors
    /// What is wrong with the plan.
    pub fn instance(&self) -> Result<Instance, String> {
        self.order.instance()
    }

    /// How it is to run.
    pub fn options(&self) -> &JobOptions {
        &self.order.options
    }

    /// The parts that it joins.
    pub fn parts(&self) -> Option<&ClipParts> {
        self.parts.as_ref()
    }

    /// A result, as the plan states it or as the work has it, that is not below one of these folders, which are without links; to be
    /// called at the root.
    pub fn output_outside(&self, below: &[PathBuf]) -> Option<String> {
        let is_outside = |output: &String| {
            let path = resolved(&to_path(output));
            !below.iter().any(|folder| path.starts_with(folder))
        };
        let made =
            self.instance().map(|instance| [instance.outputs(), instance.folders()].concat()).unwrap_or_default();
        let made = made.iter().map(to_text);
        self.outputs.iter().cloned().chain(made).find(is_outside)
    }

    /// An input that is not as it was when the plan was made; to be called at the root.
    pub fn changed_input(&self) -> Option<ChangedInput<'_>> {
        self.inputs.iter().find_map(|input| {
            let path = to_path(&input.path);
            let now = Stamp::of(&path);
            // The same content with another time is a copy.
            let is_copy = || now.is_some() && input.digest.is_some() && digest_of_file(&path).ok() == input.digest;
            (now != input.file && !is_copy()).then_some(ChangedInput { path: &input.path, is_missing: now.is_none() })
        })
    }
}

/// An input that is not as the plan has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChangedInput<'a> {
    /// Its path.
    pub path: &'a str,
    /// It is not there.
    pub is_missing: bool,
}

/// Why a plan is not read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlanError {
    /// The file cannot be read, or is no plan.
    #[error("{0}")]
    Read(String),
    /// Another version of the program made it.
    #[error(
        "the plan was made by plumbline {program}, this is {}; make it again with this version, or install that one \
         on every machine", env!("CARGO_PKG_VERSION")
    )]
    Version {
        /// The version that made it.
        program: String,
    },
}

impl PlanError {
    /// Exit status of the program.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Read(_) => Exit::Usage,
            Self::Version { .. } => Exit::OtherPlan,
        }
    }
}

/// The clip that an instance works on.
fn clip_of(instance: &Instance, runner: &dyn StageRunner) -> Option<super::memory::ClipShape> {
    let first = instance.inputs().into_iter().next()?;
    runner.probe(&first, false).ok()?.shape
}

/// A path of a setting as seen from the root; that of a file outside is absolute.
fn relative(path: &str, root: &Path) -> Result<String, RunError> {
    if path == "-" {
        let help = "name files, which all machines see";
        return Err(RunError::Usage(format!("standard input and output have no place in a plan: {help}")));
    }
    let absolute = resolved(&to_path(path));
    let inside = absolute.strip_prefix(root).map(Path::to_owned).unwrap_or(absolute);
    Ok(to_text(if inside == Path::new("") { PathBuf::from(".") } else { inside }))
}

/// BLAKE3 over the version, the stages with their settings, and the inputs.
fn key_of(order: &Order, inputs: &[TaskInput]) -> Result<String, RunError> {
    // By content, where that is known, and otherwise by size and time.
    let known = |input: &TaskInput| {
        (input.path.clone(), input.digest.is_none().then(|| input.file.clone()), input.digest.clone())
    };
    let inputs: Vec<_> = inputs.iter().map(known).collect();
    let all = (env!("CARGO_PKG_VERSION"), order.stages(), inputs);
    let text = serde_json::to_vec(&all).map_err(|e| RunError::Internal(e.to_string()))?;
    Ok(format!("b3:{}", blake3::hash(&text).to_hex()))
}

fn is_id(id: &str) -> bool {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    !id.is_empty() && id.len() <= MAX_ID + 12 && id.chars().all(fits) && !id.starts_with(['.', '-'])
}

/// Names of tasks, made of the keys of their items.
#[derive(Debug, Default)]
struct Ids {
    taken: HashSet<String>,
}

impl Ids {
    fn next(&mut self, key: &str) -> String {
        let fit = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-') { c } else { '_' };
        let all: Vec<char> = key.chars().map(fit).collect();
        // The end tells items apart: keys begin with the same folder.
        let end: String = all[all.len().saturating_sub(MAX_ID)..].iter().collect();
        let name = match end.trim_start_matches(['.', '-', '_']) {
            "" => "task",
            name => name,
        };
        let mut id = name.to_owned();
        let mut number = 2;
        while !self.taken.insert(id.clone()) {
            id = format!("{name}-{number}");
            number += 1;
        }
        id
    }
}

#[cfg(test)]
mod tests;
