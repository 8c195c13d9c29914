//! A result in the cache, and one in the making.

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use super::{Cache, Key, private_folder};
use plumbline_num::files::open_regular;

/// Largest file of an entry, bytes: a window of 616 frames with the most points takes a tenth.
const MAX_FILE: u64 = 1 << 30;
/// Largest list of files, bytes.
const MAX_META: u64 = 16 << 20;
/// The list of files of an entry.
pub(super) const META: &str = "meta.json";

/// What `meta.json` says.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Meta {
    pub(super) kind: String,
    /// What the key is the hash of.
    pub(super) parts: Map<String, Json>,
    /// The files that the run read which made it, for people.
    pub(super) sources: Vec<String>,
    /// When it was made, milliseconds since 1970.
    pub(super) made: u64,
    files: Vec<Stored>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Stored {
    name: String,
    bytes: u64,
    digest: String,
}

impl Meta {
    /// Reads that of an entry; `None` where there is no entry.
    pub(super) fn read(folder: &Path) -> io::Result<Option<(Self, File)>> {
        let file = match open_regular(&folder.join(META)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            opened => opened?,
        };
        let mut text = Vec::new();
        (&file).take(MAX_META).read_to_end(&mut text)?;
        let meta = serde_json::from_slice(&text).map_err(|_| damaged(META))?;
        Ok(Some((meta, file)))
    }
}

fn damaged(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, format!("damaged: {what}"))
}

/// A result that is there.
#[derive(Debug)]
pub struct Entry {
    folder: PathBuf,
    meta: Meta,
}

impl Entry {
    /// That of a key in its folder.
    pub(super) fn open(folder: PathBuf, key: &Key) -> io::Result<Option<Self>> {
        let Some((meta, file)) = Meta::read(&folder)? else { return Ok(None) };
        if meta.kind != key.kind || meta.parts != key.parts {
            return Err(damaged(META));
        }
        // The time of the last use, by which results are evicted; a cache that is read-only keeps its order.
        let _ = file.set_modified(SystemTime::now());
        Ok(Some(Self { folder, meta }))
    }

    /// Number of its files.
    pub fn len(&self) -> usize {
        self.meta.files.len()
    }

    /// It has no files.
    pub fn is_empty(&self) -> bool {
        self.meta.files.is_empty()
    }

    /// The content of file number `index`, as it was written.
    ///
    /// # Errors
    /// [`io::ErrorKind::InvalidData`] for a file that is not as it was written; otherwise the system's error.
    pub fn read(&self, index: usize) -> io::Result<Vec<u8>> {
        let stored = self.meta.files.get(index).ok_or_else(|| damaged("a file is missing"))?;
        if stored.name.contains(['/', '\\']) || stored.name.starts_with('.') || stored.bytes > MAX_FILE {
            return Err(damaged("the list of its files"));
        }
        let mut bytes = Vec::new();
        open_regular(&self.folder.join(&stored.name))?.take(stored.bytes + 1).read_to_end(&mut bytes)?;
        let digest = blake3::hash(&bytes).to_hex();
        if bytes.len() as u64 != stored.bytes || digest.as_str() != stored.digest {
            return Err(damaged(&stored.name));
        }
        Ok(bytes)
    }
}

/// A result in the making; nothing of it is left unless it is [published](Self::publish).
#[derive(Debug)]
pub struct NewEntry {
    cache: Cache,
    hash: String,
    folder: tempfile::TempDir,
    meta: Meta,
}

impl NewEntry {
    pub(super) fn begin(cache: &Cache, key: &Key, sources: Vec<String>) -> io::Result<Self> {
        let folder = tempfile::Builder::new().prefix(super::NEW).tempdir_in(cache.entries_folder())?;
        let made = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_millis() as u64);
        let meta = Meta { kind: key.kind.clone(), parts: key.parts.clone(), sources, made, files: Vec::new() };
        Ok(Self { cache: cache.clone(), hash: key.hash.clone(), folder, meta })
    }

    /// Adds a file.
    ///
    /// # Errors
    /// The system's error.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> io::Result<()> {
        let mut file = File::create(self.folder.path().join(name))?;
        file.write_all(bytes)?;
        file.sync_all()?;
        let digest = blake3::hash(bytes).to_hex().to_string();
        self.meta.files.push(Stored { name: name.to_owned(), bytes: bytes.len() as u64, digest });
        Ok(())
    }

    /// Makes the result known, in the place of an earlier one with its key, and keeps the cache to its limit.
    ///
    /// # Errors
    /// The system's error.
    pub fn publish(self) -> io::Result<()> {
        let mut file = File::create(self.folder.path().join(META))?;
        file.write_all(&serde_json::to_vec(&self.meta)?)?;
        file.sync_all()?;
        let target = self.cache.entry_folder(&self.hash);
        private_folder(target.parent().unwrap_or(&self.cache.folder))?;
        if target.exists() {
            // Another process may remove it, too.
            let _ = fs::remove_dir_all(&target);
        }
        match fs::rename(self.folder.path(), &target) {
            Ok(()) => {
                // It has another name now, and is not removed.
                let _ = self.folder.keep();
            }
            // Another process was as far.
            Err(_) if target.join(META).exists() => {}
            Err(error) => return Err(error),
        }
        self.cache.added(self.meta.files.iter().map(|file| file.bytes).sum())
    }
}
