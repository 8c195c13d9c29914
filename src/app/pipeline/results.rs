//! The results of a run as a JSON document, for programs and for a later run of what failed.
//!
//! ```json
//! { "format": "plumbline.results", "version": 1, "program": "0.1.0", "exit_code": 3, "seconds": 12.3,
//!   "done": 1, "up_to_date": 0, "failed": 1, "not_started": 0,
//!   "items": [ { "key": "a", "input": "clips/a.mp4", "status": "failed", "exit_code": 65, "error": "…",
//!                "outputs": [], "seconds": 0.0, "cached": [], "warnings": [] } ] }
//! ```

use std::collections::HashSet;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::batch::Instance;
use super::execute::Report;
use super::paths::to_text;
use super::run_error::{Exit, RunError};
use crate::stages::files::write_whole;
use plumbline_num::document::{DocumentError, Kind, VERSION};
use plumbline_num::files::IfExists;

/// Files of results.
const KIND: Kind = Kind { name: "a file of results", format: "plumbline.results", max_bytes: 1 << 30 };

/// How one item ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Its results were written.
    Done,
    /// Its results were there.
    UpToDate,
    /// It failed, or was interrupted.
    Failed,
    /// The run ended before it.
    NotStarted,
}

/// One item of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ItemResult {
    /// Key of the instance.
    pub key: String,
    /// The file that it works on; of a run without a batch, the first that it reads.
    pub input: Option<String>,
    /// How it ended.
    pub status: Status,
    /// Exit status of its fault, 0 without one; `None` where it was not started.
    pub exit_code: Option<u8>,
    /// Why it failed.
    pub error: Option<String>,
    /// Files written, or up to date.
    pub outputs: Vec<String>,
    /// Wall time.
    pub seconds: f64,
    /// What of it came from the cache.
    #[serde(default)]
    pub cached: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The results of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Results {
    format: String,
    version: u32,
    /// Version of the program.
    pub program: String,
    /// Exit status of the run.
    pub exit_code: u8,
    /// Wall time.
    pub seconds: f64,
    /// Items whose results were written.
    pub done: usize,
    /// Items whose results were there.
    pub up_to_date: usize,
    /// Items that failed.
    pub failed: usize,
    /// Items before which the run ended.
    pub not_started: usize,
    /// The items, in order.
    pub items: Vec<ItemResult>,
}

impl Results {
    /// Of a run that ended with `exit`.
    pub fn of(report: &Report, instances: &[Instance], exit: Exit, seconds: f64) -> Self {
        let items: Vec<ItemResult> = report
            .items
            .iter()
            .zip(instances)
            .map(|(i, instance)| ItemResult::of(i.result.as_ref(), instance))
            .collect();
        let count = |status| items.iter().filter(|item| item.status == status).count();
        Self {
            format: KIND.format.to_owned(),
            version: VERSION,
            program: env!("CARGO_PKG_VERSION").to_owned(),
            exit_code: exit as u8,
            seconds,
            done: count(Status::Done),
            up_to_date: count(Status::UpToDate),
            failed: count(Status::Failed),
            not_started: count(Status::NotStarted),
            items,
        }
    }

    /// Reads a file of results.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn read(path: &Path) -> Result<Self, DocumentError> {
        KIND.read(path)
    }

    /// Refuses to write to a path where something other than results of an earlier run is, or that is no file.
    ///
    /// # Errors
    /// [`RunError::Output`].
    pub fn check_target(path: &Path) -> Result<(), RunError> {
        let shown = path.display();
        if path.is_dir() {
            return Err(RunError::Output(format!("`{shown}` is a folder; give the name of a file")));
        }
        if path.exists()
            && let Err(error) = Self::read(path)
        {
            let help = "results replace those of an earlier run only; give another name";
            return Err(RunError::Output(format!("`{shown}` exists and is {error}; {help}")));
        }
        match path.parent().filter(|folder| *folder != Path::new("") && !folder.is_dir()) {
            Some(folder) => Err(RunError::Output(format!("`{shown}`: there is no folder `{}`", folder.display()))),
            None => Ok(()),
        }
    }

    /// Writes the file; results of an earlier run are replaced.
    ///
    /// # Errors
    /// [`RunError::Output`].
    pub fn write(&self, path: &Path) -> Result<(), RunError> {
        let text = serde_json::to_string_pretty(self).map_err(|e| RunError::Internal(e.to_string()))?;
        write_whole(path, text + "\n", IfExists::Replace)
    }

    /// Keys of the items that this run was to make and did not: those that failed, and those that it did not come to.
    pub fn unfinished(&self) -> HashSet<&str> {
        let left = |item: &&ItemResult| matches!(item.status, Status::Failed | Status::NotStarted);
        self.items.iter().filter(left).map(|item| item.key.as_str()).collect()
    }
}

impl ItemResult {
    fn of(result: Option<&Result<super::summary::Summary, RunError>>, instance: &Instance) -> Self {
        let input = match &instance.item {
            Some(item) => Some(to_text(&item.path)),
            None => instance.inputs().first().map(to_text),
        };
        let mut out = Self {
            key: instance.key.clone(),
            input,
            status: Status::NotStarted,
            exit_code: None,
            error: None,
            outputs: Vec::new(),
            seconds: 0.0,
            cached: Vec::new(),
            warnings: Vec::new(),
        };
        match result {
            None => {}
            Some(Ok(summary)) => {
                out.status = if summary.up_to_date { Status::UpToDate } else { Status::Done };
                out.exit_code = Some(Exit::Done as u8);
                out.outputs = summary.outputs.iter().map(to_text).collect();
                out.seconds = summary.seconds;
                out.cached.clone_from(&summary.cached);
                out.warnings.clone_from(&summary.warnings);
            }
            Some(Err(error)) => {
                out.status = Status::Failed;
                out.exit_code = Some(error.exit() as u8);
                out.error = Some(error.to_string());
            }
        }
        out
    }
}
