//! `plumbline cache`: what a cache holds, and removing it.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::print;
use crate::pipeline::cache::{Cache, Usage};
use crate::pipeline::memory::human_bytes;
use crate::pipeline::units::ByteSize;
use crate::pipeline::{Exit, RunError};

#[derive(Debug, Args)]
pub(super) struct CacheArgs {
    #[command(subcommand)]
    command: CacheCommand,
    /// Folder of the cache; the one that the variable PLUMBLINE_CACHE names, or the user's usual one, if left out
    #[arg(long, global = true, value_name = "DIR")]
    cache: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
enum CacheCommand {
    /// Print how many results the cache holds, and their size
    Du,
    /// Remove results that were not used for longest, until the cache is no larger
    Gc {
        /// Largest size, such as 2GB; 10 GB, or a tenth of the free space, if left out
        #[arg(long, value_name = "SIZE")]
        limit: Option<ByteSize>,
    },
    /// Remove all results
    Clear,
}

impl CacheArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let named = || std::env::var_os("PLUMBLINE_CACHE").filter(|folder| !folder.is_empty()).map(PathBuf::from);
        let folder = self.cache.or_else(named).or_else(Cache::usual_folder);
        let folder = folder.ok_or_else(|| Failure::usage("no cache is known here: name one with --cache"))?;
        let failed = |e| RunError::Output(format!("the cache `{}` cannot be used: {e}", folder.display()));
        let cache = Cache::open(&folder).map_err(failed)?;
        let text =
            |usage: Usage, what: &str| format!("{} results, {}{what}\n", usage.entries, human_bytes(usage.bytes));
        let line = match self.command {
            CacheCommand::Du => text(cache.usage().map_err(failed)?, ""),
            CacheCommand::Gc { limit } => {
                let most = limit.map_or_else(|| cache.limit(), |size| size.0);
                text(cache.shrink(most).map_err(failed)?, " removed")
            }
            CacheCommand::Clear => text(cache.shrink(0).map_err(failed)?, " removed"),
        };
        print(&line);
        Ok(Exit::Done)
    }
}
