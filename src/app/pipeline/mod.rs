//! The staged configuration: `file → plan → run`.
//!
//! A pipeline is a graph of stages with typed ports. [`read`] turns a TOML file into a checked [`Pipeline`], reporting every fault
//! at once with its line, column and a suggestion; [`Pipeline::instances`] fills it in for each item of the batch;
//! [`Plan`] cuts it into streaming passes; [`execute`](execute::execute) runs it. Commands build the same
//! [`PipelineFile`] that a file is read into.
//!
//! [`crate::stages`] holds the kinds of stages.

pub mod batch;
pub mod cache;
mod check;
mod connect;
pub mod describe;
pub mod draw;
pub mod estimate;
pub mod execute;
pub mod file;
pub mod graph;
pub mod items;
pub mod job;
pub mod kind;
mod lines_file;
mod load;
pub mod memory;
pub mod options;
mod overrides;
pub mod partial;
pub mod paths;
pub mod plan;
pub mod port;
pub mod port_value;
mod print;
pub mod problem;
pub mod progress;
pub mod records;
mod recover;
pub mod reference;
pub mod results;
pub(crate) mod run_error;
mod schema;
mod setting_paths;
pub(crate) mod settings;
pub mod shipped;
pub mod sizes;
pub mod solve;
pub mod suggest;
pub(crate) mod summary;
pub mod surfaces;
pub mod syntax;
pub mod tasks;
pub(crate) mod threads;
pub mod units;
mod warps;
pub mod worker;

pub use batch::Instance;
pub use check::{Pipeline, check, read};
pub use file::{PipelineFile, StageEntry};
pub use graph::Graph;
pub use job::{ArtifactStore, Job, Probed, StageRunner};
pub use plan::{Pass, Plan};
pub use print::print;
pub use problem::{Problem, Problems};
pub use run_error::{Exit, RunError};
pub use schema::{FileFormat, schema, schema_of_format};
pub use settings::{number_for, words_of};
pub use summary::{InputSummary, LinesSummary, Shake, ShakeSummary, Summary, SurfaceSummary, WindowSummary};
pub use syntax::Source;
