//! `plumbline schema`: the JSON schemas of the files that people write.

use clap::{Args, ValueEnum};

use super::tell;
use crate::pipeline::{Exit, handle_file_schema, schema};

/// Options of `plumbline schema`.
#[derive(Debug, Args)]
pub(super) struct SchemaArgs {
    /// Of which files
    #[arg(value_enum, default_value_t)]
    of: Of,
}

/// Files that people write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Of {
    /// Pipeline files
    #[default]
    Pipeline,
    /// Files of handles, for `deform`
    Handles,
}

impl SchemaArgs {
    pub(super) fn run(&self) -> Exit {
        match self.of {
            Of::Pipeline => tell(&format!("{:#}\n", schema())),
            Of::Handles => tell(&format!("{:#}\n", handle_file_schema())),
        }
        Exit::Done
    }
}
