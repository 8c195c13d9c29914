//! Items at work in processes of their own, so that a crash in foreign code (a decoder, an encoder) ends one item and not
//! the batch.
//!
//! A batch has one long-lived worker for each item that may be at work at once. Orders go to its standard input and
//! replies come from its standard output, one JSON object per line. A worker whose standard input ends while it works
//! stops as if it had been sent SIGTERM: so the run is stopped, and so no worker outlives a run that was killed.

mod order;
mod pool;
mod serve;

use serde::{Deserialize, Serialize};

use super::paths::Paths;
use super::progress::Tick;
use super::run_error::RunError;
use super::summary::Summary;

pub use order::Order;
pub use pool::{Pool, Worker, WorkerProgram};
pub use serve::serve;

/// What a worker waits for before it gives a result its name: the result is on record.
const RECORDED: &str = "recorded";

/// What a worker says of its order.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Reply {
    /// How far it is.
    Tick(Tick),
    /// A file is whole and about to get a name, both of which follow; the worker waits for [`RECORDED`].
    Publishing(Paths),
    /// It is done.
    Done(Box<Summary>),
    /// It failed: exit status of the fault, and its message.
    Failed(u8, String),
}

impl From<Result<Summary, RunError>> for Reply {
    fn from(result: Result<Summary, RunError>) -> Self {
        match result {
            Ok(summary) => Self::Done(Box::new(summary)),
            Err(error) => Self::Failed(error.exit() as u8, error.into_message()),
        }
    }
}
