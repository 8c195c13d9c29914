//! A cache of what is expensive to compute, by content: never of frames, and never trusted.
//!
//! An entry is a folder of files under a key, which is BLAKE3 over the kind of result, its version, and all that decides it: settings
//! and the contents of inputs ([`Key`]). It appears by one rename, and each file is compared with its digest when it is read; what is
//! damaged is removed, and computed again. The cache is private to its user, and that of another user is refused: who may write to
//! it decides what the program computes.
//!
//! ```text
//! CACHE/entries/9c/9c1e…/meta.json     {"kind": "video.track", "parts": {"points": 600, …}, "files": [{"name", "bytes", "digest"}], …}
//! CACHE/entries/9c/9c1e…/00000.window
//! CACHE/sources/77/77aa…               digest of a file by its path, size, times and inode
//! CACHE/times.jsonl                    what past runs took, for the estimates of plans
//! ```

mod entry;
mod key;
mod sources;
#[cfg(test)]
mod tests;
mod why;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

pub use entry::{Entry, NewEntry};
use entry::{META, Meta};
pub use key::Key;
pub use sources::digest_of_file;
use sources::{digest_of, known_digest_of};
pub use why::{Difference, Explanation, source_name};

use super::estimate::past::TIMES_FILE;
use super::paths::to_path;

/// Largest cache, bytes, and as a fraction of the space that is free beside it.
const MAX_BYTES: u64 = 10 << 30;
const MAX_PART: u64 = 10;
/// What is written between two looks at the size of the whole cache, as a part of its limit: a look at ten thousand entries takes
/// a third of a second, and may not be taken for each of them.
const UNWATCHED_PART: u64 = 100;
/// Age after which what a killed run left is removed.
const LEFTOVER: Duration = Duration::from_hours(24);
/// Age after which the digest of a file is forgotten, and read again from the file.
const FORGOTTEN: Duration = Duration::from_hours(24 * 90);
/// How the names of folders of entries in the making begin.
const NEW: &str = ".new-";

/// How a run uses a cache.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheUse {
    /// The folder, as the text of a setting.
    pub folder: String,
    /// The user named it: that it cannot be used is worth a warning.
    pub named: bool,
    /// It may be another user's.
    pub trusted: bool,
    /// What is computed anew though it is there: results, such as `tracks`, or stages, by name or kind.
    pub force: Vec<String>,
}

impl CacheUse {
    /// The cache, whose folder is made if it is missing.
    ///
    /// # Errors
    /// As [`Cache::open`].
    pub fn open(&self) -> io::Result<Cache> {
        Cache::open(&to_path(&self.folder), self.trusted)
    }
}

/// A folder of results.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

/// Of what a result was made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Made {
    /// Kind of the result, such as `video.track`.
    pub kind: String,
    /// The files that the run read which made it, as [`source_name`] has them.
    pub sources: Vec<String>,
    /// Digest of the program.
    pub build: String,
    /// Milliseconds since 1970.
    pub made_ms: u64,
}

/// How much a cache holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Results.
    pub entries: usize,
    /// Bytes of them.
    pub bytes: u64,
}

impl Cache {
    /// The cache in a folder, which is made if it is missing; `trusted`: it may belong to another user.
    ///
    /// # Errors
    /// A folder that cannot be made, or that others may write to.
    pub fn open(folder: &Path, trusted: bool) -> io::Result<Self> {
        private_folder(&folder.join("entries"))?;
        private_folder(&folder.join("sources"))?;
        Self::checked(folder, trusted)
    }

    /// The cache in a folder, where there is one.
    ///
    /// # Errors
    /// A folder that is no cache, or that others may write to.
    pub fn existing(folder: &Path, trusted: bool) -> io::Result<Option<Self>> {
        match folder.join("entries").metadata() {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
            Ok(_) => Self::checked(folder, trusted).map(Some),
        }
    }

    fn checked(folder: &Path, trusted: bool) -> io::Result<Self> {
        if !trusted {
            check_owner(folder)?;
        }
        Ok(Self { folder: folder.to_owned() })
    }

    /// The folder where caches are unless one is named: `$XDG_CACHE_HOME/plumbline`, or `~/.cache/plumbline`.
    pub fn usual_folder() -> Option<PathBuf> {
        let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
        Some(base.join("plumbline"))
    }

    /// Where it is.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn entries_folder(&self) -> PathBuf {
        self.folder.join("entries")
    }

    fn entry_folder(&self, hash: &str) -> PathBuf {
        self.entries_folder().join(&hash[..2]).join(hash)
    }

    /// The result with this key; `None` where there is none.
    ///
    /// # Errors
    /// An entry whose list of files is damaged, or cannot be read.
    pub fn find(&self, key: &Key) -> io::Result<Option<Entry>> {
        Entry::open(self.entry_folder(&key.hash), key)
    }

    /// Whether there is a result with this key, which is not looked into.
    pub fn has(&self, key: &Key) -> bool {
        self.entry_folder(&key.hash).join(META).is_file()
    }

    /// Begins a result, made by a run that read the files `sources`.
    ///
    /// # Errors
    /// The system's error.
    pub fn begin(&self, key: &Key, sources: &[PathBuf]) -> io::Result<NewEntry> {
        NewEntry::begin(self, key, sources.iter().map(|path| why::source_name(path)).collect())
    }

    /// Removes a result, such as a damaged one.
    ///
    /// # Errors
    /// The system's error.
    pub fn remove(&self, key: &Key) -> io::Result<()> {
        fs::remove_dir_all(self.entry_folder(&key.hash))
    }

    /// BLAKE3 of the content of a file. It is read once: as long as path, size, times and inode stay, the digest is looked up.
    ///
    /// # Errors
    /// A file that cannot be read, or that changes while it is.
    pub fn digest_of(&self, path: &Path) -> io::Result<String> {
        digest_of(path, Some(&self.folder.join("sources")))
    }

    /// The same where it is looked up: a file that nobody read is not read.
    pub fn known_digest_of(&self, path: &Path) -> Option<String> {
        known_digest_of(path, &self.folder.join("sources"))
    }

    /// What runs on which files made the results that are there; entries that cannot be read are passed over.
    ///
    /// # Errors
    /// The system's error.
    pub fn index(&self) -> io::Result<Vec<Made>> {
        let of_entry = |folder: PathBuf| {
            let (meta, _) = Meta::read(&folder).ok()??;
            let build = meta.parts.get("build").and_then(|build| build.as_str()).unwrap_or_default().to_owned();
            Some(Made { kind: meta.kind, sources: meta.sources, build, made_ms: meta.made })
        };
        Ok(self.entry_folders()?.into_iter().filter_map(of_entry).collect())
    }

    /// BLAKE3 of the program that runs: of another build nobody has compared every bit, and `cache_version` is raised by people.
    ///
    /// # Errors
    /// A program whose file cannot be read, or was replaced since it was started.
    pub fn program(&self) -> io::Result<String> {
        static PROGRAM: OnceLock<String> = OnceLock::new();
        if let Some(known) = PROGRAM.get() {
            return Ok(known.clone());
        }
        let digest = self.digest_of(&std::env::current_exe()?)?;
        Ok(PROGRAM.get_or_init(|| digest).clone())
    }

    /// What the cache holds.
    ///
    /// # Errors
    /// The system's error.
    pub fn usage(&self) -> io::Result<Usage> {
        let entries = self.entries()?;
        Ok(Usage { entries: entries.len(), bytes: entries.iter().map(|entry| entry.bytes).sum() })
    }

    /// Removes results, those first that were not used for longest, until the cache has `most` bytes or fewer, and what killed runs
    /// left; how much was removed.
    ///
    /// # Errors
    /// The system's error.
    pub fn shrink(&self, most: u64) -> io::Result<Usage> {
        for left in folders_in(&self.entries_folder())? {
            let is_new = left.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(NEW.as_bytes()));
            if is_new && is_older(&left, LEFTOVER) {
                fs::remove_dir_all(left)?;
            }
        }
        self.forget(FORGOTTEN)?;
        let mut entries = self.entries()?;
        entries.sort_by_key(|entry| entry.used);
        let mut total: u64 = entries.iter().map(|entry| entry.bytes).sum();
        let mut removed = Usage::default();
        for entry in entries {
            if total <= most {
                break;
            }
            fs::remove_dir_all(&entry.folder)?;
            total -= entry.bytes;
            removed = Usage { entries: removed.entries + 1, bytes: removed.bytes + entry.bytes };
        }
        Ok(removed)
    }

    /// Removes all results, the digests of files and the times of past runs.
    ///
    /// # Errors
    /// The system's error.
    pub fn clear(&self) -> io::Result<Usage> {
        self.forget(Duration::ZERO)?;
        match fs::remove_file(self.folder.join(TIMES_FILE)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        self.shrink(0)
    }

    /// Forgets digests of files that are older than `age`.
    fn forget(&self, age: Duration) -> io::Result<()> {
        for shelf in folders_in(&self.folder.join("sources"))? {
            for note in fs::read_dir(shelf)?.filter_map(Result::ok).map(|note| note.path()) {
                if is_older(&note, age) {
                    // Another process may have removed it meanwhile.
                    let _ = fs::remove_file(note);
                }
            }
        }
        Ok(())
    }

    /// The size that a cache keeps to: ten gigabytes, or a tenth of what is free beside it.
    pub fn limit(&self) -> u64 {
        let free = plumbline_num::files::free_space(&self.folder).unwrap_or(u64::MAX);
        MAX_BYTES.min(free / MAX_PART)
    }

    /// Keeps the cache to its limit, after `bytes` were added.
    fn added(&self, bytes: u64) -> io::Result<()> {
        /// Bytes that this process added since it looked last; at first it has not looked.
        static UNWATCHED: AtomicU64 = AtomicU64::new(u64::MAX);
        let limit = self.limit();
        let before = UNWATCHED.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |n| Some(n.saturating_add(bytes)));
        if before.unwrap_or(u64::MAX).saturating_add(bytes) < limit / UNWATCHED_PART {
            return Ok(());
        }
        UNWATCHED.store(0, Ordering::Relaxed);
        self.shrink(limit).map(|_| ())
    }

    /// Folders of results.
    fn entry_folders(&self) -> io::Result<Vec<PathBuf>> {
        let mut found = Vec::new();
        for shelf in folders_in(&self.entries_folder())? {
            if shelf.file_name().is_some_and(|name| name.len() == 2) {
                // Another process may have removed it meanwhile.
                found.extend(folders_in(&shelf).unwrap_or_default());
            }
        }
        Ok(found)
    }

    fn entries(&self) -> io::Result<Vec<Found>> {
        let found = |folder: PathBuf| {
            let used = folder.join(META).metadata().and_then(|meta| meta.modified());
            Found { used: used.unwrap_or(SystemTime::UNIX_EPOCH), bytes: folder_bytes(&folder), folder }
        };
        Ok(self.entry_folders()?.into_iter().map(found).collect())
    }
}

/// A result on disk.
struct Found {
    used: SystemTime,
    bytes: u64,
    folder: PathBuf,
}

/// Size of the files in a folder; those that are removed meanwhile count nothing.
fn folder_bytes(folder: &Path) -> u64 {
    let files = fs::read_dir(folder).into_iter().flatten();
    files.filter_map(|file| file.ok()?.metadata().ok()).map(|meta| meta.len()).sum()
}

fn is_older(path: &Path, age: Duration) -> bool {
    let changed = path.metadata().and_then(|meta| meta.modified()).ok();
    changed.and_then(|time| time.elapsed().ok()).is_some_and(|found| found > age)
}

fn folders_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            found.push(entry.path());
        }
    }
    Ok(found)
}

fn private_folder(folder: &Path) -> io::Result<()> {
    let mut builder = fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

#[cfg(unix)]
fn check_owner(folder: &Path) -> io::Result<()> {
    use std::os::unix::fs::MetadataExt;
    let meta = folder.metadata()?;
    let user = rustix::process::geteuid().as_raw();
    if meta.uid() != user || meta.mode() & 0o022 != 0 {
        let message = "others may write to it, and decide by that what is computed; name a cache of your own, which only you may \
                       write to, or allow it with --trust-cache";
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, message));
    }
    Ok(())
}

#[cfg(not(unix))]
fn check_owner(_: &Path) -> io::Result<()> {
    Ok(())
}
