//! The integration tests: one binary, since each extra one costs a link per edit.

mod cli;
mod pipeline;
mod pipeline_laws;
mod pipeline_run;
