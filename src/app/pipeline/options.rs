//! `[run]` and `[batch]`: how a pipeline is executed, as opposed to what it computes.

use std::path::PathBuf;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cache::{Cache, CacheUse};
use super::paths::to_text;

/// How progress is reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum ProgressMode {
    /// A bar on a terminal, plain lines otherwise
    #[default]
    Auto,
    /// One line every few seconds
    Plain,
    /// One JSON object per line, for programs
    Json,
    /// Nothing
    None,
}

/// What to do with results that exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Existing {
    /// Keep results made from the same inputs, settings and version, and refuse all others
    Skip,
    /// Refuse items whose results exist
    Refuse,
    /// Replace them
    Overwrite,
}

/// `[run]`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// Threads for the whole run, shared by all items at work; 0 = all processors
    #[schemars(range(min = 0, max = 512))]
    pub threads: u32,
    /// What to do with results that exist; if left out, skip in a batch and refuse otherwise
    pub existing: Option<Existing>,
    /// Existing files may be replaced: short for existing = "overwrite"
    pub overwrite: bool,
    /// Losses are errors, not warnings: a clip that is cut short, a stream that a container cannot store
    pub strict: bool,
    /// How progress is reported
    pub progress: ProgressMode,
    /// Folders of files that an input may name, such as the buffers of a glTF file, besides the folder of the input itself
    #[schemars(extend("format" = "path"))]
    pub allow_paths: Vec<String>,
    /// Folder of the cache of what was computed before, such as the tracks of a clip; "" for none; the one that the variable
    /// PLUMBLINE_CACHE names, or the user's usual one, if left out
    #[schemars(extend("format" = "path"))]
    pub cache: Option<String>,
    /// The cache may be one that others may write to
    pub trust_cache: bool,
    /// What is computed anew though it is in the cache: results, such as "tracks", or stages, by name or kind
    pub force: Vec<String>,
}

impl RunSettings {
    /// What to do with results that exist: [`Existing::Skip`] in a batch and [`Existing::Refuse`] otherwise, where nothing is set.
    pub fn existing(&self, batch: bool) -> Existing {
        match (self.existing, self.overwrite, batch) {
            (Some(existing), ..) => existing,
            (None, true, _) => Existing::Overwrite,
            (None, false, true) => Existing::Skip,
            (None, false, false) => Existing::Refuse,
        }
    }

    /// Threads for the whole run, at least 1; not more than four for each processor, and 64 in any case. Beyond that each only
    /// costs a stack and, where it decodes or encodes, its frames.
    pub fn thread_count(&self) -> usize {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        match self.threads {
            0 => processors,
            n => (n as usize).min((4 * processors).max(64)),
        }
    }

    /// The cache; `None`: nothing is cached.
    pub fn cache_use(&self) -> Option<CacheUse> {
        let variable = || std::env::var_os("PLUMBLINE_CACHE").map(to_text);
        let named = self.cache.clone().or_else(variable);
        let folder =
            named.clone().or_else(|| Cache::usual_folder().map(to_text)).filter(|folder| !folder.is_empty())?;
        Some(CacheUse { folder, named: named.is_some(), trusted: self.trust_cache, force: self.force.clone() })
    }

    /// Folders of files that an input may name, besides its own.
    pub fn allowed_folders(&self) -> Vec<PathBuf> {
        self.allow_paths.iter().map(PathBuf::from).collect()
    }
}

/// What to do when an item fails.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum OnError {
    /// The other items go on
    #[default]
    Continue,
    /// No further item is started
    Stop,
}

/// One glob, or a list of globs and files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a glob or a list of globs and files")]
pub enum Foreach {
    /// A glob, file or folder.
    One(String),
    /// Several, in this order.
    List(Vec<String>),
}

impl Foreach {
    /// The patterns.
    pub fn patterns(&self) -> &[String] {
        match self {
            Self::One(pattern) => std::slice::from_ref(pattern),
            Self::List(patterns) => patterns,
        }
    }

    /// There is no pattern.
    pub fn is_empty(&self) -> bool {
        self.patterns().is_empty()
    }
}

/// `[batch]`: the graph is instantiated once per item.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BatchSettings {
    /// What to work on: a glob such as `clips/**/*.{mp4,mov}`, a folder, or a list of globs, folders and files
    pub foreach: Foreach,
    /// Folders are searched at any depth; false takes only the files directly in them
    pub recurse: bool,
    /// Names an instance in messages; must differ between items
    pub key: String,
    /// Items at work at once; 0 = as many as processors and memory allow, for still pictures
    #[schemars(range(min = 0, max = 256))]
    pub jobs: u32,
    /// What to do when an item fails
    pub on_error: OnError,
    /// Further tries of an item after a temporary failure
    #[schemars(range(min = 0, max = 100))]
    pub retries: u32,
    /// Finding nothing to do is no error
    pub allow_empty: bool,
    /// Folder that relative patterns start from.
    #[serde(skip)]
    pub base: Option<PathBuf>,
}

impl Default for BatchSettings {
    fn default() -> Self {
        Self {
            foreach: Foreach::List(Vec::new()),
            recurse: true,
            key: "${item.path}".to_owned(),
            jobs: 1,
            on_error: OnError::default(),
            retries: 0,
            allow_empty: false,
            base: None,
        }
    }
}
