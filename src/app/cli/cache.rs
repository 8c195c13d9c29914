//! `plumbline cache`: what a cache holds, why it was computed, and removing it.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use clap::{Args, Subcommand};

use super::failure::Failure;
use super::print;
use crate::pipeline::cache::{Cache, Explanation, Usage};
use crate::pipeline::memory::human_bytes;
use crate::pipeline::options::RunSettings;
use crate::pipeline::paths::{shown, to_path, to_text};
use crate::pipeline::units::ByteSize;
use crate::pipeline::{Exit, RunError};
use crate::stages::kept::RESULTS;

#[derive(Debug, Args)]
pub(super) struct CacheArgs {
    #[command(subcommand)]
    command: CacheCommand,
    /// Folder of the cache; the one that the variable PLUMBLINE_CACHE names, or the user's usual one, if left out
    #[arg(long, global = true, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Use a cache that belongs to another user, or that others may write to
    #[arg(long, global = true)]
    trust_cache: bool,
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
    /// Print what the cache holds of a file, and in which settings or inputs each result differs from those computed before
    Why {
        /// The clip, photo or mesh
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Results to explain, such as tracks, or the kind of stage that makes them; all if left out
        #[arg(value_name = "STAGE")]
        stage: Option<String>,
    },
    /// Remove all results
    Clear,
}

impl CacheArgs {
    pub(super) fn run(self) -> Result<Exit, Failure> {
        let settings = RunSettings { cache: self.cache.map(to_text), ..RunSettings::default() };
        let used = settings.cache_use();
        let used = used.ok_or_else(|| Failure::usage("no cache is known here: name one with --cache"))?;
        let folder = to_path(&used.folder);
        let failed = |e| RunError::Output(format!("the cache `{}` cannot be used: {e}", folder.display()));
        // To look into a cache does not make one.
        let cache = Cache::existing(&folder, self.trust_cache).map_err(failed)?;
        let of = |usage: Usage, what: &str| format!("{} results, {}{what}\n", usage.entries, human_bytes(usage.bytes));
        let counted = |count: &dyn Fn(&Cache) -> std::io::Result<Usage>| {
            cache.as_ref().map_or(Ok(Usage::default()), count).map_err(failed)
        };
        let text = match self.command {
            CacheCommand::Du => of(counted(&Cache::usage)?, &format!(" in {}", folder.display())),
            CacheCommand::Gc { limit } => {
                let most = |cache: &Cache| limit.map_or_else(|| cache.limit(), |size| size.0);
                of(counted(&|cache| cache.shrink(most(cache)))?, " removed")
            }
            CacheCommand::Clear => of(counted(&Cache::clear)?, " removed"),
            CacheCommand::Why { file, stage } => {
                let found = cache.as_ref().map_or(Ok(Vec::new()), |cache| cache.why(&file)).map_err(failed)?;
                explained(&file, stage.as_deref(), &found)?
            }
        };
        print(&text);
        Ok(Exit::Done)
    }
}

/// Parts of a key that are the same for all results of a program: they are named where they differ.
const OF_PROGRAM: [&str; 4] = ["cache_version", "program", "platform", "build"];

/// What is known of the results of a file.
fn explained(file: &Path, stage: Option<&str>, found: &[Explanation]) -> Result<String, Failure> {
    let name = |kind: &str| RESULTS.iter().find(|result| result.stage == kind).map_or("result", |result| result.name);
    if let Some(stage) = stage.filter(|stage| !RESULTS.iter().any(|r| r.name == *stage || r.stage == *stage)) {
        let names: Vec<&str> = RESULTS.iter().map(|result| result.name).collect();
        return Err(Failure::usage(format!("`{stage}` is not kept (expected one of {})", names.join(", "))));
    }
    let asked = |e: &&Explanation| stage.is_none_or(|stage| stage == e.kind || stage == name(&e.kind));
    let mut text = String::new();
    for result in found.iter().filter(asked) {
        let Explanation { kind, made, bytes, parts, nearest } = result;
        let name = name(kind);
        // Writing to a string does not fail, here and below.
        let _ = writeln!(text, "{name}, {}, computed {}", human_bytes(*bytes), ago(*made));
        let named = parts.iter().filter(|(part, _)| !OF_PROGRAM.contains(&part.as_str()));
        let parts: Vec<String> = named.map(|(part, value)| format!("{part} {}", short(value))).collect();
        let _ = writeln!(text, "  of    {}", parts.join(", "));
        match nearest {
            None => text.push_str("  why   there was none before\n"),
            Some((then, differences)) => {
                let changes = differences.iter().map(|d| format!("{} was {}", d.part, short(&d.then)));
                let changes: Vec<String> = changes.collect();
                let _ = writeln!(text, "  why   of the {name} computed {}, {}", ago(*then), changes.join(", "));
            }
        }
    }
    if text.is_empty() {
        let what = stage.unwrap_or("results");
        text = format!("the cache has no {what} of `{}`: the next run computes them\n", file.display());
    }
    Ok(shown(&text).to_string())
}

/// Digests by their beginning, and no text longer than a line.
fn short(value: &str) -> String {
    /// Longest value that is printed whole, and characters of a digest that are, which differ between any two files of a user.
    const MAX_LONG: usize = 60;
    const DIGEST: usize = 8;
    if value.chars().count() <= MAX_LONG {
        return value.to_owned();
    }
    value.chars().take(DIGEST).chain(['…']).collect()
}

fn ago(time: SystemTime) -> String {
    let seconds = time.elapsed().map_or(0, |age| age.as_secs());
    let (count, unit) = match seconds {
        0..120 => (seconds, "seconds"),
        120..7200 => (seconds / 60, "minutes"),
        7200..172_800 => (seconds / 3600, "hours"),
        _ => (seconds / 86_400, "days"),
    };
    format!("{count} {unit} ago")
}
