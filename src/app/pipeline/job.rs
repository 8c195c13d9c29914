//! What the executor and the bodies of the stages agree on.

use std::any::Any;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::batch::Instance;
use super::cache::CacheUse;
use super::estimate::WorkSize;
use super::graph::{Edge, Graph};
use super::memory::ClipShape;
use super::paths::as_texts;
use super::plan::Pass;
use super::progress::TaskProgress;
use super::run_error::RunError;
use super::summary::Summary;
use crate::stages::DecodeSettings;
use plumbline_num::files::{AtomicFile, IfExists};
use plumbline_num::run::{Interrupt, Run};
use plumbline_num::time::Timestamp;
use plumbline_shape::mesh::ReadLimits;

/// One instance at work.
pub struct Job<'a> {
    /// The graph, its settings and its passes.
    pub instance: &'a Instance,
    /// Threads that this job may use, at least 1.
    pub threads: usize,
    /// Existing files may be replaced.
    pub overwrite: bool,
    /// Folders of files that an input may name, besides its own.
    pub allow_paths: &'a [PathBuf],
    /// The cache of what was computed before.
    pub cache: Option<&'a CacheUse>,
    /// What would be lost without a word more than a warning is an error: a clip that is cut short, a stream that cannot be kept.
    pub strict: bool,
    /// Where to report frames done.
    pub progress: &'a TaskProgress<'a>,
    /// Set when the user stops the run: look at it once per frame.
    pub cancel: &'a Arc<AtomicBool>,
    /// Puts a result on record before it gets its name: see [`Job::publishing`].
    pub publishing: Option<&'a Publishing<'a>>,
}

/// Hears of a file that is whole, and of the name that it is about to get. Where it fails the file does not get the name.
pub type Publishing<'a> = dyn Fn(&Path, &Path) -> Result<(), RunError> + Sync + 'a;

/// What a run asks of each of its jobs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct JobOptions {
    /// See [`Job::threads`].
    pub threads: usize,
    /// See [`Job::overwrite`].
    pub overwrite: bool,
    /// See [`Job::strict`].
    pub strict: bool,
    /// See [`Job::allow_paths`].
    #[serde(with = "as_texts")]
    pub allow_paths: Vec<PathBuf>,
    /// See [`Job::cache`].
    pub cache: Option<CacheUse>,
}

impl<'a> Job<'a> {
    /// The work of an instance.
    pub fn new(
        instance: &'a Instance,
        options: &'a JobOptions,
        progress: &'a TaskProgress<'a>,
        cancel: &'a Arc<AtomicBool>,
        publishing: Option<&'a Publishing<'a>>,
    ) -> Self {
        let JobOptions { threads, overwrite, strict, ref allow_paths, ref cache } = *options;
        Self { instance, threads, overwrite, allow_paths, cache: cache.as_ref(), strict, progress, cancel, publishing }
    }
}

impl Job<'_> {
    /// The graph of the instance.
    pub fn graph(&self) -> &Graph {
        &self.instance.graph
    }

    /// How a long call of this job runs: it stops once the user stops the run.
    #[must_use]
    pub fn run(&self) -> Run {
        Run::with_interrupt(&Interrupt::from_flag(Arc::clone(self.cancel)))
    }

    /// What happens to files that have the name of a result.
    pub fn if_exists(&self) -> IfExists {
        IfExists::overwrite(self.overwrite)
    }

    /// Limits of the readers of meshes and skeletons.
    #[must_use]
    pub fn read_limits(&self) -> ReadLimits {
        ReadLimits { allow_paths: self.allow_paths.to_vec(), ..ReadLimits::default() }
    }

    /// Call when `file` is whole and about to become `target`.
    ///
    /// # Errors
    /// [`RunError::Interrupted`] where the run that keeps the records is gone: a result that no run knows of would be in the way of
    /// the next one.
    pub fn publishing(&self, file: &Path, target: &Path) -> Result<(), RunError> {
        self.publishing.map_or(Ok(()), |publishing| publishing(file, target))
    }

    /// Call once per frame.
    ///
    /// # Errors
    /// [`RunError::Interrupted`] once the user stopped the run.
    pub fn check_cancel(&self) -> Result<(), RunError> {
        if self.cancel.load(Ordering::Relaxed) { Err(RunError::Interrupted) } else { Ok(()) }
    }
}

/// Results that one pass hands to later ones, by stage and output port.
#[derive(Default)]
pub struct ArtifactStore {
    results: HashMap<(usize, &'static str), Box<dyn Any + Send>>,
    /// The names of the files to write, taken until the job has ended.
    pub(crate) claims: Vec<AtomicFile>,
}

impl ArtifactStore {
    /// Keeps the result of a stage's output port.
    pub fn put<T: Any + Send>(&mut self, stage: usize, port: &'static str, value: T) {
        self.results.insert((stage, port), Box::new(value));
    }

    /// Drops what a stage kept.
    pub fn forget(&mut self, stage: usize) {
        self.results.retain(|(from, _), _| *from != stage);
    }

    /// What a stage kept under `port`, if it is of this type.
    pub fn at<T: Any>(&self, stage: usize, port: &'static str) -> Option<&T> {
        self.results.get(&(stage, port)).and_then(|v| v.downcast_ref())
    }

    /// The result at the other end of `edge`.
    ///
    /// # Errors
    /// [`RunError::Internal`] where no earlier pass kept it, or kept another type.
    pub fn get<T: Any>(&self, edge: &Edge) -> Result<&T, RunError> {
        let value = self.at(edge.from, edge.output.name);
        value.ok_or_else(|| RunError::Internal(format!("no {} was handed on", edge.output.name)))
    }
}

/// What `probe` finds in an input.
#[derive(Clone, Debug)]
pub struct Probed {
    /// For people.
    pub text: String,
    /// For programs.
    pub json: serde_json::Value,
    /// What memory depends on; `None` without pictures.
    pub shape: Option<ClipShape>,
}

/// Bodies of the stages: what really reads, computes and writes.
pub trait StageRunner: Sync {
    /// Looks into a file; `playlists`: also into a playlist of files in its own folder.
    ///
    /// # Errors
    /// [`RunError::Input`] where it cannot be read.
    fn probe(&self, input: &Path, playlists: bool) -> Result<Probed, RunError>;

    /// Length of a clip, s, where its container states it.
    ///
    /// # Errors
    /// [`RunError::Input`] where it cannot be read.
    fn clip_seconds(&self, _input: &Path) -> Result<Option<f64>, RunError> {
        Ok(None)
    }

    /// Times of the frames of a clip that is decoded with these settings, ticks.
    ///
    /// # Errors
    /// [`RunError::Input`] where it cannot be read.
    fn frame_times(&self, input: &Path, _settings: &DecodeSettings) -> Result<Vec<Timestamp>, RunError> {
        Err(RunError::Internal(format!("the frames of {} are unknown", input.display())))
    }

    /// How much an instance has to do, by what its inputs state of themselves; `clip`: what is known of its clip.
    fn work_size(&self, _instance: &Instance, _clip: Option<&ClipShape>) -> WorkSize {
        WorkSize::default()
    }

    /// Refuses a job that must fail at its end, before any work is done.
    ///
    /// # Errors
    /// [`RunError::Output`] or [`RunError::Usage`] where a file cannot be written.
    fn preflight(&self, _instance: &Instance) -> Result<(), RunError> {
        Ok(())
    }

    /// Runs one pass of a job from its first frame to its last: reads its sources anew, takes what earlier passes handed on from
    /// `values`, puts there what `pass.hands_on` lists, writes the files of its sinks, and fills in `summary`.
    ///
    /// # Errors
    /// Whatever went wrong; no file may be left under its final name unless it is whole.
    fn run_pass(
        &self,
        job: &Job<'_>,
        pass: &Pass,
        values: &mut ArtifactStore,
        summary: &mut Summary,
    ) -> Result<(), RunError>;
}
