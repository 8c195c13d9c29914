//! `plumbline schema`: the JSON schemas of the formats that are read.

use clap::Args;

use super::print;
use crate::pipeline::{Exit, FileFormat, schema_of_format};

/// Options of `plumbline schema`.
#[derive(Debug, Args)]
pub(super) struct SchemaArgs {
    /// Which files
    #[arg(value_enum, default_value_t, value_name = "FORMAT")]
    format: FileFormat,
}

impl SchemaArgs {
    pub(super) fn run(&self) -> Exit {
        print(&format!("{:#}\n", schema_of_format(self.format)));
        Exit::Done
    }
}
