//! The built-in executor: runs the instances of a pipeline, some at once, one failure not stopping the rest.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use super::batch::Instance;
use super::check::Pipeline;
use super::estimate::{measurements, past};
use super::job::{ArtifactStore, Job, JobOptions, StageRunner};
use super::options::{BatchSettings, Existing, OnError, RunSettings};
use super::progress::{Event, Progress, TaskProgress};
use super::records::{Records, Standing, refusal};
use super::run_error::{Exit, RunError};
use super::summary::Summary;
use super::threads::start;
use super::worker::{Order, Pool, Worker, WorkerProgram};
use plumbline_num::files::AtomicFile;

/// How one item ended.
#[derive(Debug)]
pub struct ItemReport {
    /// Key of the instance.
    pub key: String,
    /// What it did, or why it failed; `None`: it was not started.
    pub result: Option<Result<Summary, RunError>>,
}

/// How a run ended.
#[derive(Debug, Default)]
pub struct Report {
    /// The items, in order.
    pub items: Vec<ItemReport>,
}

impl Report {
    /// Failed items with their errors.
    pub fn failures(&self) -> impl Iterator<Item = (&str, &RunError)> {
        self.items.iter().filter_map(|i| Some((i.key.as_str(), i.result.as_ref()?.as_ref().err()?)))
    }

    /// Items that are finished, with their summaries: those up to date among them.
    pub fn done(&self) -> impl Iterator<Item = (&str, &Summary)> {
        self.items.iter().filter_map(|i| Some((i.key.as_str(), i.result.as_ref()?.as_ref().ok()?)))
    }

    /// Number of items whose results were there already.
    pub fn up_to_date(&self) -> usize {
        self.done().filter(|(_, summary)| summary.up_to_date).count()
    }

    /// Keys of items that were never started.
    pub fn skipped(&self) -> impl Iterator<Item = &str> {
        self.items.iter().filter(|i| i.result.is_none()).map(|i| i.key.as_str())
    }

    /// Exit status: of the fault for a lone item, [`Exit::Partial`] for some of many, and where a clip was cut short.
    pub fn exit(&self) -> Exit {
        if self.failures().any(|(_, e)| matches!(e, RunError::Interrupted)) {
            return Exit::Interrupted;
        }
        match (self.failures().next(), self.items.len()) {
            (None, _) if self.done().any(|(_, summary)| summary.cut_short) => Exit::Partial,
            (None, _) => Exit::Done,
            (Some((_, error)), 1) => error.exit(),
            (Some(_), _) => Exit::Partial,
        }
    }
}

/// Who does the work.
#[derive(Clone, Copy)]
pub struct Backend<'a> {
    /// The bodies of the stages.
    pub stages: &'a dyn StageRunner,
    /// Items of a batch are done by processes of this program, so that a crash in foreign code ends one of them alone;
    /// `None`: by this process, as a lone item is.
    pub workers: Option<&'a WorkerProgram>,
}

/// Runs every instance.
pub fn execute(
    pipeline: &Pipeline,
    instances: &[Instance],
    backend: Backend<'_>,
    progress: &dyn Progress,
    cancel: &Arc<AtomicBool>,
) -> Report {
    let batch = pipeline.batch.clone().unwrap_or_default();
    let jobs = match batch.jobs {
        0 if pipeline.graph.is_still() => pipeline.run.thread_count().min(photos_in_memory()),
        n => n as usize,
    };
    let jobs = jobs.clamp(1, instances.len().max(1));
    let existing = pipeline.run.existing(pipeline.batch.is_some());
    let on_record = pipeline.batch.is_some() || existing == Existing::Skip;
    let way = Way { run: &pipeline.run, batch: &batch, existing, on_record, jobs };
    way.execute(instances, backend, progress, cancel)
}

/// Runs one instance, of a plan that was made before.
pub fn execute_alone(
    run: &RunSettings,
    instance: Instance,
    backend: Backend<'_>,
    progress: &dyn Progress,
    cancel: &Arc<AtomicBool>,
) -> Report {
    let (batch, existing) = (BatchSettings::default(), run.existing(false));
    let way = Way { run, batch: &batch, existing, on_record: existing == Existing::Skip, jobs: 1 };
    way.execute(&[instance], backend, progress, cancel)
}

/// How instances are run.
struct Way<'a> {
    run: &'a RunSettings,
    batch: &'a BatchSettings,
    existing: Existing,
    /// Results are put on record.
    on_record: bool,
    /// Items at work at once.
    jobs: usize,
}

impl Way<'_> {
    fn execute(
        self,
        instances: &[Instance],
        backend: Backend<'_>,
        progress: &dyn Progress,
        cancel: &Arc<AtomicBool>,
    ) -> Report {
        let started = Instant::now();
        let Self { run, batch, existing, on_record, jobs } = self;
        let threads = (run.thread_count() / jobs).max(1);
        let made = Mutex::default();
        let pool = backend.workers.filter(|_| instances.len() > 1).map(|program| Pool::new(program.clone()));
        let records = on_record.then(Records::default);
        let mut executor = Executor {
            run,
            existing,
            batch,
            backend: backend.stages,
            pool: pool.as_ref(),
            progress,
            cancel,
            threads,
            made: &made,
            records,
            up_to_date: Vec::new(),
        };
        executor.find_up_to_date(instances);
        let up_to_date = executor.up_to_date.iter().filter(|up| **up).count();
        progress.event(&Event::RunStart { items: instances.len(), up_to_date });
        let results = executor.run_all(instances, jobs);
        if let Some(Err(error)) = executor.records.as_ref().map(Records::compact) {
            tracing::warn!("records of results were not shortened: {error}");
        }
        let report = Report {
            items: instances.iter().zip(results).map(|(i, result)| ItemReport { key: i.key.clone(), result }).collect(),
        };
        let (done, failed) = (report.done().count() - report.up_to_date(), report.failures().count());
        if report.done().count() < instances.len() {
            take_back(made.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner));
        }
        progress.event(&Event::RunEnd { done, failed, seconds: started.elapsed().as_secs_f64() });
        report
    }
}

/// Memory that a still picture may take while it is at work: one of 50 MP and 8 bit, decoded, in planes and sampled.
pub(super) const BYTES_PER_PHOTO: u64 = 512 << 20;

/// How many still pictures the memory that is free now has room for, at least 1.
fn photos_in_memory() -> usize {
    // Linux alone has it in a file; elsewhere the number of processors decides.
    let Ok(text) = std::fs::read_to_string("/proc/meminfo") else { return usize::MAX };
    let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"));
    let kilobytes = line.and_then(|l| l.split_whitespace().next()?.parse::<u64>().ok());
    kilobytes.map_or(usize::MAX, |kb| (kb.saturating_mul(1024) / BYTES_PER_PHOTO).max(1) as usize)
}

struct Executor<'a> {
    run: &'a RunSettings,
    existing: Existing,
    batch: &'a BatchSettings,
    backend: &'a dyn StageRunner,
    pool: Option<&'a Pool>,
    progress: &'a dyn Progress,
    cancel: &'a Arc<AtomicBool>,
    threads: usize,
    /// Folders that this run made, each after the one it is in.
    made: &'a Mutex<Vec<PathBuf>>,
    /// What earlier runs made; `None`: nothing is kept on record.
    records: Option<Records>,
    /// Whether each item was up to date when the run began.
    up_to_date: Vec<bool>,
}

/// How often a run with workers looks whether the user stopped it.
const LOOK_FOR_STOP: Duration = Duration::from_millis(50);

/// How long an item waits for those who write its results: several times what a worker takes to see that its run is gone, and to end.
const WAIT_FOR_WRITERS: Duration = Duration::from_secs(10);

/// How often it looks.
const LOOK_FOR_WRITERS: Duration = Duration::from_millis(20);

type ItemResult = Option<Result<Summary, RunError>>;

impl Executor<'_> {
    /// `jobs` threads take the items in order.
    fn run_all(&self, instances: &[Instance], jobs: usize) -> Vec<ItemResult> {
        let next = AtomicUsize::new(0);
        let stop = AtomicBool::new(false);
        let results: Mutex<Vec<ItemResult>> = Mutex::new(instances.iter().map(|_| None).collect());
        let slot = || {
            let mut worker = self.pool.map(Pool::worker);
            while !stop.load(Ordering::Relaxed) {
                let at = next.fetch_add(1, Ordering::Relaxed);
                let Some(instance) = instances.get(at) else { break };
                let result = self.run_item(at, instance, worker.as_mut());
                let interrupted = matches!(result, Err(RunError::Interrupted));
                if interrupted || (result.is_err() && self.batch.on_error == OnError::Stop) {
                    stop.store(true, Ordering::Relaxed);
                }
                if let Ok(mut results) = results.lock() {
                    results[at] = Some(result);
                }
            }
        };
        let (at_work, ended) = mpsc::channel::<()>();
        std::thread::scope(|scope| {
            if self.pool.is_some() {
                // Without a thread for it, workers stop by the signal alone.
                let _ = start(scope, "stop", move || self.stop_workers(&ended));
            }
            // Where the system starts no more of them, those that are there do the work.
            let others: Vec<_> = (1..jobs).map_while(|_| start(scope, "job", slot).ok()).collect();
            slot();
            for thread in others {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            }
            drop(at_work);
        });
        results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    /// Stops the workers once the user stops the run; returns at its end.
    fn stop_workers(&self, ended: &mpsc::Receiver<()>) {
        while ended.recv_timeout(LOOK_FOR_STOP) == Err(mpsc::RecvTimeoutError::Timeout) {
            if self.cancel.load(Ordering::Relaxed) {
                self.pool.iter().for_each(|pool| pool.stop());
            }
        }
    }

    /// Looks for results that are up to date before the work begins, so that it is known how much there is to do.
    fn find_up_to_date(&mut self, instances: &[Instance]) {
        let Some(records) = self.records.as_ref().filter(|_| self.existing == Existing::Skip) else { return };
        let is_up_to_date = |instance: &Instance| {
            !self.cancel.load(Ordering::Relaxed) && records.standing(instance) == Standing::UpToDate
        };
        self.up_to_date = instances.iter().map(is_up_to_date).collect();
    }

    /// Whether the results of an item may be replaced; `None`: they are up to date.
    fn may_replace(&self, instance: &Instance) -> Result<Option<bool>, RunError> {
        let Some(records) = self.records.as_ref().filter(|_| self.existing == Existing::Skip) else {
            return Ok(Some(self.existing == Existing::Overwrite));
        };
        self.wait_for_writers(instance);
        let standing = records.standing(instance);
        match refusal(&standing, instance) {
            Some(message) => Err(RunError::Output(message)),
            None => Ok((standing != Standing::UpToDate).then_some(standing == Standing::Unfinished)),
        }
    }

    /// Waits a while for others who write a result of this item: a worker of a run that was killed ends soon, and what stands on
    /// record is settled only then.
    fn wait_for_writers(&self, instance: &Instance) {
        let until = Instant::now() + WAIT_FOR_WRITERS;
        let outputs = instance.outputs();
        while outputs.iter().any(|path| AtomicFile::remove_leftovers(path))
            && Instant::now() < until
            && !self.cancel.load(Ordering::Relaxed)
        {
            std::thread::park_timeout(LOOK_FOR_WRITERS);
        }
    }

    fn run_item(
        &self,
        at: usize,
        instance: &Instance,
        mut worker: Option<&mut Worker<'_>>,
    ) -> Result<Summary, RunError> {
        let task = instance.key.as_str();
        if self.up_to_date.get(at) == Some(&true) {
            self.progress.event(&Event::TaskSkip { task });
            return Ok(Summary::of_up_to_date(instance.outputs()));
        }
        self.progress.event(&Event::TaskStart { task });
        let mut attempt = 1;
        let result = loop {
            let result = self.try_item(instance, worker.as_deref_mut());
            match &result {
                Err(error) if error.is_temporary() && attempt <= self.batch.retries => {
                    attempt += 1;
                    self.progress.event(&Event::TaskRetry { task, attempt, error: &error.to_string() });
                }
                _ => break result,
            }
        };
        match &result {
            Ok(summary) => self.progress.event(&Event::TaskDone { task, summary }),
            Err(e) => self.progress.event(&Event::TaskFail { task, error: &e.to_string(), code: e.exit() as u8 }),
        }
        result
    }

    fn try_item(&self, instance: &Instance, worker: Option<&mut Worker<'_>>) -> Result<Summary, RunError> {
        let Some(overwrite) = self.may_replace(instance)? else {
            return Ok(Summary::of_up_to_date(instance.outputs()));
        };
        self.check_targets(instance, overwrite)?;
        let options = JobOptions {
            threads: self.threads,
            overwrite,
            strict: self.run.strict || instance.is_strict(),
            allow_paths: self.run.allowed_folders(),
            cache: self.run.cache_use(),
        };
        let record = self.records.as_ref().and_then(|records| records.begin(instance));
        let publishing = |file: &Path, target: &Path| {
            if let Some(Err(error)) = record.as_ref().map(|record| record.publishing(file, target)) {
                // The same fault is a warning at the end of the item.
                tracing::debug!("{} is not on record: {error}", target.display());
            }
            Ok(())
        };
        let mut summary = match worker.filter(|_| !uses_standard_streams(instance)) {
            Some(_) if self.cancel.load(Ordering::Relaxed) => Err(RunError::Interrupted),
            Some(worker) => {
                let done = worker.run(&Order::of(instance, options), &instance.key, self.progress, &publishing);
                if done.is_err() {
                    // A worker that crashed took nothing along.
                    instance.outputs().iter().for_each(|path| _ = AtomicFile::remove_leftovers(path));
                }
                done
            }
            None => {
                let progress = TaskProgress::new(self.progress, &instance.key, instance.plan.passes.len());
                do_work(&Job::new(instance, &options, &progress, self.cancel, Some(&publishing)), self.backend)
            }
        }?;
        self.note_times(instance, &summary);
        // A folder that takes no record keeps its results.
        if let Some(Err(error)) = record.map(|record| record.finish(&summary.outputs)) {
            summary.warnings.push(format!("not on record, so that a later run cannot skip it: {error}"));
        }
        Ok(summary)
    }

    /// Adds what the item took to the past runs that estimates follow from: with the cache, and off with it.
    fn note_times(&self, instance: &Instance, summary: &Summary) {
        let Some(cache) = self.run.cache_use().and_then(|used| used.open().ok()) else { return };
        let found = measurements(instance, &summary.work, self.threads, summary);
        if let Err(error) = past::add(&cache, &found) {
            tracing::info!("the times of {} are not noted: {error}", instance.key);
        }
    }

    /// Refuses existing files and makes missing folders before any work is done.
    fn check_targets(&self, instance: &Instance, overwrite: bool) -> Result<(), RunError> {
        instance.folders().iter().try_for_each(|folder| {
            self.make_folder(folder)?;
            check_folder(folder, overwrite)
        })?;
        for path in instance.outputs() {
            if path.is_dir() {
                return Err(RunError::Output(format!("`{}` is a folder; give the name of a file", path.display())));
            }
            if !overwrite && path.is_file() {
                let message = format!(
                    "`{}` exists; allow to replace it with --overwrite (`run.existing = \"overwrite\"`)",
                    path.display()
                );
                return Err(RunError::Output(message));
            }
            if let Some(folder) = path.parent().filter(|p| *p != Path::new("")) {
                self.make_folder(folder)?;
            }
        }
        Ok(())
    }

    /// Makes a folder and those it is in, and remembers which were missing.
    fn make_folder(&self, folder: &Path) -> Result<(), RunError> {
        let missing = |p: &&Path| *p != Path::new("") && !p.exists();
        let mut missing: Vec<PathBuf> = folder.ancestors().take_while(missing).map(Path::to_owned).collect();
        missing.reverse();
        if let Ok(mut made) = self.made.lock() {
            made.append(&mut missing);
        }
        std::fs::create_dir_all(folder)
            .map_err(|e| RunError::Output(format!("cannot make the folder `{}`: {e}", folder.display())))
    }
}

/// Runs the passes of a job in this process. A panic is a failure like others.
pub(super) fn do_work(job: &Job<'_>, backend: &dyn StageRunner) -> Result<Summary, RunError> {
    let work = || {
        let started = Instant::now();
        backend.preflight(job.instance).map_err(RunError::settled)?;
        let (mut values, mut summary) = (ArtifactStore::default(), Summary::default());
        for pass in &job.instance.plan.passes {
            job.check_cancel()?;
            // What fails once the user has stopped the run was stopped, whatever it says of itself.
            let done = backend.run_pass(job, pass, &mut values, &mut summary);
            done.map_err(|error| job.check_cancel().err().unwrap_or_else(|| error.settled()))?;
        }
        summary.seconds = started.elapsed().as_secs_f64();
        if job.cache.is_some() {
            summary.work = backend.work_size(job.instance, None);
        }
        Ok(summary)
    };
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(RunError::Internal(panic_text(panic.as_ref()))))
}

/// True where it reads standard input or writes to standard output, which a worker has no share in.
fn uses_standard_streams(instance: &Instance) -> bool {
    [instance.inputs(), instance.outputs()].concat().iter().any(|path| path == Path::new("-"))
}

/// Removes folders in which nothing was written, at the end of a run that failed: not before, since other items may be about to.
fn take_back(made: Vec<PathBuf>) {
    for folder in made.into_iter().rev() {
        // One that is not empty stays.
        let _ = std::fs::remove_dir(folder);
    }
}

/// Refuses a folder that is to be filled and has something in it.
fn check_folder(folder: &Path, overwrite: bool) -> Result<(), RunError> {
    let failed = |e| RunError::Output(format!("cannot read the folder `{}`: {e}", folder.display()));
    let occupied = std::fs::read_dir(folder).map_err(failed)?.next().is_some();
    if occupied && !overwrite {
        let help = "allow to replace what is in it with --overwrite (`run.existing = \"overwrite\"`)";
        return Err(RunError::Output(format!("the folder `{}` is not empty; {help}", folder.display())));
    }
    Ok(())
}

fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("unknown panic").to_owned()
}
