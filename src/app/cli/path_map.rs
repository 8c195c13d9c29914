//! `--path-map`: folders that are elsewhere on the machines that run the tasks.

use clap::Args;
use clap::builder::TypedValueParser;

use super::failure::Failure;
use super::job::path_text;
use crate::pipeline::tasks::{PathMap, PathRule};

#[derive(Debug, Args)]
pub(super) struct PathMapArgs {
    /// Rewrite paths of the plan that begin with the folder FROM, for a machine that has it at TO, as for storage that is mounted elsewhere;
    /// may be repeated; adds to the rules of the variable PLUMBLINE_PATH_MAP on that machine
    #[arg(long = "path-map", value_name = "FROM=TO", help_heading = "Other machines",
          value_parser = path_text().try_map(|text| PathRule::parse(&text)))]
    path_map: Vec<PathRule>,
}

impl PathMapArgs {
    /// The rules of the command line.
    pub(super) fn map(&self) -> Result<PathMap, Failure> {
        PathMap::new(self.path_map.clone()).map_err(|fault| Failure::usage(format!("--path-map: {fault}")))
    }
}
