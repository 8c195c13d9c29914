//! What of a plan is done, what is left, and how long it will take on so many workers.
//!
//! States and times are those of this moment and this machine, unlike the plan: they follow from the records beside the results, from
//! the cache, and from past runs.

use std::collections::{BTreeSet, HashMap};
use std::fmt;

use super::{Task, TaskPlan};
use crate::pipeline::cache::{Cache, Made};
use crate::pipeline::estimate::{Calibration, Estimate, Quantity, makespan};
use crate::pipeline::paths::{shown, to_text};
use crate::pipeline::records::{Records, Standing, refusal};
use crate::pipeline::run_error::RunError;
use crate::stages::kept;

/// How a task stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TaskState {
    /// Its results are up to date.
    Done,
    /// It has to run.
    Run,
    /// It has to run, and takes these results from the cache.
    Cached(Vec<&'static str>),
    /// It waits for this task.
    Waiting(String),
    /// It cannot run: an input is missing, or a result that no run on record made is in its place.
    Blocked(String),
}

/// A task with what it is expected to take.
#[derive(Clone, Debug, PartialEq)]
pub struct TaskForecast {
    /// Its name.
    pub id: String,
    /// How it stands.
    pub state: TaskState,
    /// Wall time on its threads, s; 0 where it does nothing.
    pub seconds: f64,
    /// Memory at its peak, MB.
    pub memory_mb: u64,
    /// Space for results and temporary files, MB.
    pub disk_mb: f64,
    /// The tasks that it waits for, by index.
    after: Vec<usize>,
}

/// The tasks of a plan, as they stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Forecast {
    /// The tasks, in the order of the plan.
    pub tasks: Vec<TaskForecast>,
    /// What the times follow from.
    pub calibration: Calibration,
}

/// What a cache has.
struct Known<'a> {
    cache: &'a Cache,
    index: Vec<Made>,
    build: String,
}

impl TaskPlan {
    /// How the tasks stand, and what they will take; to be called at the root of the plan. `cache`: where results and past runs are.
    ///
    /// # Errors
    /// [`RunError::Internal`]: none is known, of a plan of this program.
    pub fn forecast(&self, cache: Option<&Cache>) -> Result<Forecast, RunError> {
        let calibration = Calibration::of(&cache.map(crate::pipeline::estimate::past::read).unwrap_or_default());
        // A cache that cannot be looked into has nothing.
        let known =
            cache.and_then(|cache| Some(Known { cache, index: cache.index().ok()?, build: cache.program().ok()? }));
        let records = Records::default();
        let index: HashMap<&str, usize> =
            self.tasks.iter().enumerate().map(|(at, task)| (task.id.as_str(), at)).collect();
        let mut done_wholes: BTreeSet<&str> = BTreeSet::new();
        // The task of a clip is behind its parts, and decides of them.
        let parts: BTreeSet<&str> = self.tasks.iter().filter_map(|task| task.part_of.as_deref()).collect();
        for task in self.tasks.iter().filter(|task| parts.contains(task.id.as_str())) {
            if records.standing(&task.instance().map_err(RunError::Internal)?) == Standing::UpToDate {
                done_wholes.insert(&task.id);
            }
        }
        let mut tasks: Vec<TaskForecast> = Vec::with_capacity(self.tasks.len());
        for task in &self.tasks {
            let after: Vec<usize> = task.after.iter().filter_map(|id| index.get(id.as_str()).copied()).collect();
            let is_done = task.part_of.as_deref().is_some_and(|whole| done_wholes.contains(whole));
            let state =
                if is_done { TaskState::Done } else { state_of(task, &records, known.as_ref(), &tasks, &after)? };
            let (seconds, disk_mb) = match &state {
                TaskState::Done | TaskState::Blocked(_) => (0.0, 0.0),
                TaskState::Cached(names) => expected(&task.estimate, &calibration, names),
                TaskState::Run | TaskState::Waiting(_) => expected(&task.estimate, &calibration, &[]),
            };
            let memory_mb = task.resources.memory_mb;
            tasks.push(TaskForecast { id: task.id.clone(), state, seconds, memory_mb, disk_mb, after });
        }
        Ok(Forecast { tasks, calibration })
    }
}

fn state_of(
    task: &Task,
    records: &Records,
    known: Option<&Known<'_>>,
    before: &[TaskForecast],
    after: &[usize],
) -> Result<TaskState, RunError> {
    let instance = task.instance().map_err(RunError::Internal)?;
    let standing = records.standing(&instance);
    if standing == Standing::UpToDate {
        return Ok(TaskState::Done);
    }
    if let Some(message) = refusal(&standing, &instance) {
        return Ok(TaskState::Blocked(message));
    }
    if let Some(path) = instance.missing_inputs().first() {
        return Ok(TaskState::Blocked(format!("`{}` is missing", path.display())));
    }
    let waits_for =
        |is: fn(&TaskState) -> bool| after.iter().filter_map(|at| before.get(*at)).find(|task| is(&task.state));
    if let Some(blocked) = waits_for(|state| matches!(state, TaskState::Blocked(_))) {
        return Ok(TaskState::Blocked(format!("waits for {}, which is blocked", blocked.id)));
    }
    if let Some(open) = waits_for(|state| *state != TaskState::Done) {
        return Ok(TaskState::Waiting(open.id.clone()));
    }
    let expected = known.map(|k| kept::expected(&instance, k.cache, &k.index, &k.build)).unwrap_or_default();
    let names: Vec<&'static str> = expected.iter().map(|result| result.name).collect();
    Ok(if names.is_empty() { TaskState::Run } else { TaskState::Cached(names) })
}

/// Part of the time of a result that it takes to read it from the cache: a tenth, of tracks, and less of others.
const FROM_CACHE: f64 = 0.1;

/// Seconds and MB of a task with these results from the cache.
fn expected(estimate: &Estimate, calibration: &Calibration, cached: &[&str]) -> (f64, f64) {
    let is_cached = |kind: &str| kept::RESULTS.iter().any(|r| r.stage == kind && cached.contains(&r.name));
    let of_stage = |(kind, seconds): (&String, &f64)| {
        let part = if is_cached(kind) { FROM_CACHE } else { 1.0 };
        part * seconds * calibration.factor(kind, Quantity::Seconds)
    };
    // What is of no stage: the start of the program, and the joining of parts.
    let rest = (estimate.seconds - estimate.stages.values().sum::<f64>()).max(0.0);
    let seconds = rest * calibration.factor("", Quantity::Seconds) + estimate.stages.iter().map(of_stage).sum::<f64>();
    (seconds, estimate.disk_mb)
}

impl Forecast {
    /// Seconds until all is done that can be, on so many workers that each do one task at a time.
    pub fn makespan(&self, workers: usize) -> f64 {
        let seconds: Vec<f64> = self.tasks.iter().map(|task| task.seconds).collect();
        let after: Vec<Vec<usize>> = self.tasks.iter().map(|task| task.after.clone()).collect();
        makespan(&seconds, &after, workers)
    }

    /// The first `rows` tasks, one per line, and how many there are in each state.
    pub fn table(&self, rows: usize) -> String {
        let shown = &self.tasks[..rows.min(self.tasks.len())];
        let width = shown.iter().map(|task| task.id.len()).max().unwrap_or(0).max(4);
        let mut lines = Vec::new();
        if !shown.is_empty() {
            lines.push(format!("{:<width$}  {:>9}  {:>8}  {:>8}  state", "task", "time", "memory", "disk"));
        }
        for TaskForecast { id, state, seconds, memory_mb, disk_mb, .. } in shown {
            let (time, disk) = if *seconds > 0.0 {
                (Duration(*seconds).to_string(), format!("{} MB", round(*disk_mb)))
            } else {
                ("-".to_owned(), "-".to_owned())
            };
            lines.push(format!("{id:<width$}  {time:>9}  {memory_mb:>5} MB  {disk:>8}  {state}"));
        }
        if self.tasks.len() > shown.len() {
            lines.push(format!("and {} further tasks (-v prints all)", self.tasks.len() - shown.len()));
        }
        lines.push(self.counts());
        lines.push(String::new());
        lines.join("\n")
    }

    /// How many tasks are in each state.
    fn counts(&self) -> String {
        let count = |is: fn(&TaskState) -> bool| self.tasks.iter().filter(|task| is(&task.state)).count();
        let states = [
            (count(|s| *s == TaskState::Done), "done"),
            (count(|s| *s == TaskState::Run), "to run"),
            (count(|s| matches!(s, TaskState::Cached(_))), "to run from the cache"),
            (count(|s| matches!(s, TaskState::Waiting(_))), "waiting"),
            (count(|s| matches!(s, TaskState::Blocked(_))), "blocked"),
        ];
        let texts = states.iter().filter(|(count, _)| *count > 0).map(|(count, state)| format!("{count} {state}"));
        let word = if self.tasks.len() == 1 { "task" } else { "tasks" };
        format!("{} {word}: {}", self.tasks.len(), texts.collect::<Vec<_>>().join(", "))
    }

    /// The time on so many workers, and where the figures come from.
    pub fn totals(&self, workers: &[usize]) -> String {
        let mut lines = Vec::new();
        if self.tasks.iter().any(|task| task.seconds > 0.0) {
            let times = workers.iter().map(|&workers| {
                let word = if workers == 1 { "worker" } else { "workers" };
                format!("{} on {workers} {word}", Duration(self.makespan(workers)))
            });
            let times = times.collect::<Vec<_>>().join(", ");
            let memory = self.tasks.iter().map(|task| task.memory_mb).max().unwrap_or(0);
            let disk = round(self.tasks.iter().map(|task| task.disk_mb).sum());
            lines.push(format!("expected: {times}; up to {memory} MB of memory for a task, {disk} MB of disk for all"));
        }
        let fit = &self.calibration;
        lines.push(match fit.spread() {
            None => "times are those of the shipped model: no run with the cache is on record here".to_owned(),
            Some(spread) => {
                let percent = (100.0 * (spread - 1.0)).round();
                format!("times are fitted to {} figures of past runs, half of them within {percent} %", fit.count())
            }
        });
        lines.push(String::new());
        lines.join("\n")
    }
}

/// Three digits at most.
fn round(mb: f64) -> String {
    if mb < 9.95 { format!("{mb:.1}") } else { format!("{mb:.0}") }
}

impl fmt::Display for TaskState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => f.write_str("done"),
            Self::Run => f.write_str("run"),
            Self::Cached(names) => write!(f, "run; {} cached", names.join(", ")),
            Self::Waiting(id) => write!(f, "blocked: waits for {id}"),
            Self::Blocked(why) => write!(f, "blocked: {}", shown(&to_text(why))),
        }
    }
}

/// Seconds for people.
struct Duration(f64);

impl fmt::Display for Duration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.0.max(0.0);
        let whole = seconds.round() as u64;
        match whole {
            0..10 => write!(f, "{seconds:.1} s"),
            10..100 => write!(f, "{whole} s"),
            100..6000 => write!(f, "{} min {:02} s", whole / 60, whole % 60),
            _ => write!(f, "{} h {:02} min", whole / 3600, whole / 60 % 60),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_well() {
        for (seconds, text) in [
            (0.04, "0.0 s"),
            (9.44, "9.4 s"),
            (59.7, "60 s"),
            (125.0, "2 min 05 s"),
            (7300.0, "2 h 01 min"),
            (-1.0, "0.0 s"),
        ] {
            assert_eq!(Duration(seconds).to_string(), text);
        }
    }

    #[test]
    fn what_is_cached_takes_a_tenth_and_each_stage_has_its_factor() {
        let stages = [("video.track".to_owned(), 10.0), ("video.encode".to_owned(), 20.0)].into();
        let estimate = Estimate { seconds: 31.0, disk_mb: 5.0, stages, ..Estimate::default() };
        let none = Calibration::default();
        assert_eq!(expected(&estimate, &none, &[]), (31.0, 5.0));
        assert_eq!(expected(&estimate, &none, &["tracks"]), (22.0, 5.0));
    }
}
