//! Options of all commands that build a pipeline: how the job runs, and on which files.

use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use serde::Serialize;

use super::failure::Failure;
use crate::pipeline::PipelineFile;
use crate::pipeline::file::{entries_of, literal_path};
use crate::pipeline::items::is_glob;
use crate::pipeline::options::{Existing, ProgressMode, RunSettings};
use crate::pipeline::paths::{to_path, to_text};
use plumbline_shape::character::weights::WeightMethod;

/// Options of every command that computes something.
#[derive(Debug, Args)]
pub(super) struct JobArgs {
    #[command(flatten)]
    pub(super) again: AgainArgs,
    /// Take the defaults of the options from a file of settings, with tables by kind of stage such as [video.smooth]
    #[arg(long, value_name = "FILE.toml")]
    settings: Option<PathBuf>,
    /// Print the pipeline file that these options stand for, and exit
    #[arg(long)]
    pub(super) print_pipeline: bool,
    /// Threads for the whole run; 0 = all processors
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=512))]
    threads: u32,
    /// Also open files of this folder that an input names, such as buffers of glTF; may be repeated
    #[arg(long = "allow-path", value_name = "DIR")]
    allow_paths: Vec<PathBuf>,
    #[command(flatten)]
    cache: UseCacheArgs,
    /// Form of the progress messages
    #[arg(long, value_enum, default_value_t, value_name = "HOW")]
    progress: ProgressMode,
}

/// Options for what was computed before.
#[derive(Debug, Args)]
pub(super) struct UseCacheArgs {
    /// Folder of the cache of what was computed before, such as the tracks of a clip; the one that the variable PLUMBLINE_CACHE
    /// names, or the user's usual one, if left out
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Take nothing from a cache, and store nothing
    #[arg(long, conflicts_with_all = ["cache", "trust_cache", "force"])]
    no_cache: bool,
    /// Use a cache that belongs to another user, or that others may write to
    #[arg(long)]
    trust_cache: bool,
    /// Compute this anew, and store it: a result, such as tracks, or a stage, by name or kind; may be repeated
    #[arg(long, value_name = "STAGE")]
    force: Vec<String>,
}

impl UseCacheArgs {
    /// What is computed anew, as an assignment of a pipeline's setting, which is checked with the pipeline.
    pub(super) fn forced(&self) -> Option<String> {
        (!self.force.is_empty()).then(|| format!("run.force={}", serde_json::json!(self.force)))
    }

    /// Adds what the options say to the settings of a run.
    pub(super) fn apply(&self, run: &mut RunSettings, text: impl Fn(&Path) -> String) {
        if self.no_cache {
            run.cache = Some(String::new());
        }
        if let Some(folder) = &self.cache {
            run.cache = Some(text(folder));
        }
        run.trust_cache |= self.trust_cache;
        if !self.force.is_empty() {
            run.force.clone_from(&self.force);
        }
    }
}

/// Options for running a job again, or its rest.
#[derive(Debug, Args)]
pub(super) struct AgainArgs {
    /// What to do with results that exist: skip keeps those made from the same inputs, settings and version, and refuses all
    /// others; refuse refuses them; overwrite replaces them; if left out, skip for many inputs and refuse for one
    #[arg(long, value_enum, value_name = "HOW", hide_possible_values = true)]
    existing: Option<Existing>,
    /// Replace existing files: short for --existing overwrite
    #[arg(short = 'y', visible_short_alias = 'f', long, conflicts_with = "existing")]
    overwrite: bool,
    /// Write how each item ended as JSON, also where items fail or the run is interrupted
    #[arg(long, value_name = "FILE.json")]
    pub(super) results: Option<PathBuf>,
    /// Run only the items that failed, or were not started, in the run that wrote these --results
    #[arg(long, value_name = "FILE.json")]
    pub(super) retry_failed: Option<PathBuf>,
}

impl AgainArgs {
    /// What the options say of results that exist.
    pub(super) fn existing(&self) -> Option<Existing> {
        if self.overwrite { Some(Existing::Overwrite) } else { self.existing }
    }
}

/// The own options of a command that builds a pipeline.
pub(super) trait BuildsPipeline {
    /// The pipeline that the options stand for; how it runs is left open.
    fn pipeline(&self) -> Result<PipelineFile, Failure>;
}

/// A command that builds a pipeline.
#[derive(Debug, Args)]
pub(super) struct JobCommand<A: Args> {
    #[command(flatten)]
    own: A,
    #[command(flatten)]
    job: JobArgs,
}

impl<A: Args + BuildsPipeline> JobCommand<A> {
    /// Its own options, and how the job runs.
    pub(super) fn parts(&self) -> (&dyn BuildsPipeline, &JobArgs) {
        (&self.own, &self.job)
    }
}

impl JobArgs {
    /// The pipeline of a command, and how it runs.
    pub(super) fn complete(&self, command: &dyn BuildsPipeline) -> Result<PipelineFile, Failure> {
        let AgainArgs { existing, overwrite, .. } = self.again;
        let mut run = RunSettings {
            threads: self.threads,
            existing,
            overwrite,
            // Asked of the stage that encodes.
            strict: false,
            progress: self.progress,
            allow_paths: self.allow_paths.iter().map(|folder| literal_path(folder)).collect(),
            ..RunSettings::default()
        };
        self.cache.apply(&mut run, literal_path);
        Ok(PipelineFile { run: entries_of(&run, &RunSettings::default()), ..command.pipeline()? })
    }
}

/// How a mesh is bound to a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum WeightsArg {
    /// By a method.
    How(WeightMethod),
    /// By the weights of a file.
    File(PathBuf),
}

impl Default for WeightsArg {
    fn default() -> Self {
        Self::How(WeightMethod::default())
    }
}

impl FromStr for WeightsArg {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(serde_json::from_value(text.into()).map_or_else(|_| Self::File(text.into()), Self::How))
    }
}

impl fmt::Display for WeightsArg {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::How(how) => how.serialize(f),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl WeightsArg {
    /// The method; that of a file is the default, which the file overrides.
    pub(super) fn binding(&self) -> WeightMethod {
        if let Self::How(how) = self { *how } else { WeightMethod::default() }
    }

    /// The file as a setting.
    pub(super) fn file(&self) -> Option<String> {
        if let Self::File(path) = self { Some(literal_path(path)) } else { None }
    }
}

/// The input of a command whose `--output` names one file; `many` says what its inputs are, such as `meshes`.
pub(super) fn only_input<'a>(inputs: &'a [String], many: &str) -> Result<&'a str, Failure> {
    let [input] = inputs else {
        let count = inputs.len();
        return Err(Failure::usage(format!("--output names one file, but there are {count} {many}; use --out-dir")));
    };
    if may_be_many(input) {
        let message = format!("`{input}` may be many {many}, but --output names one file; use --out-dir");
        return Err(Failure::usage(message));
    }
    Ok(input)
}

/// Reads a path, of any bytes, as the text of a setting.
pub(super) fn path_text() -> impl TypedValueParser<Value = String> {
    OsStringValueParser::new().map(to_text)
}

/// Whether a name is a folder or a glob, which may be many files.
pub(super) fn may_be_many(input: &str) -> bool {
    let path = to_path(input);
    path.is_dir() || (is_glob(input) && !path.exists())
}
