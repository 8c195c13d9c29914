//! A cache of what is expensive to compute, by content: never of frames, and never trusted.
//!
//! An entry is a folder of files under a key, which is BLAKE3 over the kind of result, its version, and all that decides it: settings
//! and the contents of inputs ([`Key`]). It appears by one rename, and each file is compared with its digest when it is read; what is
//! damaged is removed, and computed again. The cache is private to its user, and that of another user is refused: who may write to
//! it decides what the program computes.
//!
//! ```text
//! CACHE/entries/9c/9c1e…/meta.json                      {"kind": "video.track", "files": [{"name", "bytes", "digest"}]}
//! CACHE/entries/9c/9c1e…/00000.window
//! CACHE/sources/77/77aa…                                digest of a file by its path, size and time
//! ```

use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use serde::{Deserialize, Serialize};

use super::paths::to_text;
use plumbline_num::files::open_regular;

/// Largest file of an entry, bytes: a window of 616 frames with the most points takes a tenth.
const MAX_FILE: u64 = 1 << 30;
/// Largest list of files, bytes, and most files of an entry.
const MAX_META: u64 = 16 << 20;
/// Largest cache, bytes, and as a fraction of the space that is free beside it.
const MAX_BYTES: u64 = 10 << 30;
const MAX_PART: u64 = 10;
/// Age after which what a killed run left is removed.
const LEFTOVER: Duration = Duration::from_hours(24);
/// The list of files of an entry.
const META: &str = "meta.json";

/// Which result: 64 hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key(String);

impl Key {
    /// Of a result of this kind, of version `version` of the algorithm, that `parts` decides.
    ///
    /// # Example
    /// ```
    /// use plumbline_app::pipeline::cache::Key;
    ///
    /// let key = |points: u32| Key::new("video.track", 1, &("b3:77aa", points));
    /// assert_eq!(key(600), key(600));
    /// assert_ne!(key(600), key(601));
    /// ```
    pub fn new(kind: &str, version: u32, parts: &impl Serialize) -> Self {
        // What cannot be written as JSON has no key of its own, so that it shares none.
        let text = serde_json::to_vec(&(kind, version, env!("CARGO_PKG_VERSION"), parts)).unwrap_or_default();
        Self(blake3::hash(&text).to_hex().to_string())
    }
}

/// A folder of results.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
}

#[derive(Debug, Serialize, Deserialize)]
struct Meta {
    kind: String,
    files: Vec<Stored>,
}

#[derive(Debug, Serialize, Deserialize)]
struct Stored {
    name: String,
    bytes: u64,
    digest: String,
}

/// A result that is there.
#[derive(Debug)]
pub struct Entry {
    folder: PathBuf,
    meta: Meta,
}

/// A result in the making; nothing of it is left unless it is [published](Self::publish).
#[derive(Debug)]
pub struct NewEntry {
    cache: Cache,
    key: Key,
    folder: tempfile::TempDir,
    meta: Meta,
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
    /// The cache in a folder, which is made if it is missing.
    ///
    /// # Errors
    /// A folder that cannot be made, or that belongs to another user.
    pub fn open(folder: &Path) -> io::Result<Self> {
        private_folder(&folder.join("entries"))?;
        private_folder(&folder.join("sources"))?;
        check_owner(folder)?;
        Ok(Self { folder: folder.to_owned() })
    }

    /// The folder where caches are unless one is named: `$XDG_CACHE_HOME/plumbline`, or `~/.cache/plumbline`.
    pub fn usual_folder() -> Option<PathBuf> {
        let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let base = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
        Some(base.join("plumbline"))
    }

    fn entry_folder(&self, key: &Key) -> PathBuf {
        self.folder.join("entries").join(&key.0[..2]).join(&key.0)
    }

    /// The result with this key; `None` where there is none, or its list of files cannot be read.
    pub fn find(&self, key: &Key) -> Option<Entry> {
        let folder = self.entry_folder(key);
        let file = File::open(folder.join(META)).ok()?;
        let mut text = Vec::new();
        (&file).take(MAX_META).read_to_end(&mut text).ok()?;
        let meta: Meta = serde_json::from_slice(&text).ok()?;
        // The time of the last use, by which results are evicted; a cache that is read-only keeps its order.
        let _ = file.set_modified(SystemTime::now());
        Some(Entry { folder, meta })
    }

    /// Begins a result.
    ///
    /// # Errors
    /// The system's error.
    pub fn begin(&self, kind: &str, key: &Key) -> io::Result<NewEntry> {
        let folder = tempfile::Builder::new().prefix(".new-").tempdir_in(self.folder.join("entries"))?;
        Ok(NewEntry {
            cache: self.clone(),
            key: key.clone(),
            folder,
            meta: Meta { kind: kind.to_owned(), files: Vec::new() },
        })
    }

    /// Removes a result, such as a damaged one.
    ///
    /// # Errors
    /// The system's error.
    pub fn remove(&self, key: &Key) -> io::Result<()> {
        fs::remove_dir_all(self.entry_folder(key))
    }

    /// BLAKE3 of the content of a file. It is read once: as long as path, size, times and inode stay, the digest is looked up.
    ///
    /// # Errors
    /// A file that cannot be read, or that changes while it is.
    pub fn digest_of(&self, path: &Path) -> io::Result<String> {
        let mut file = open_regular(path)?;
        let state = |file: &File| -> io::Result<String> {
            let meta = file.metadata()?;
            let modified = meta.modified()?;
            #[cfg(unix)]
            let number = std::os::unix::fs::MetadataExt::ino(&meta);
            #[cfg(not(unix))]
            let number = 0;
            Ok(format!("{} {} {number} {modified:?}", to_text(path.canonicalize()?), meta.len()))
        };
        let before = state(&file)?;
        let name = blake3::hash(before.as_bytes()).to_hex().to_string();
        let memo = self.folder.join("sources").join(&name[..2]).join(&name);
        let is_digest = |text: &String| text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit());
        if let Some(known) = fs::read_to_string(&memo).ok().filter(is_digest) {
            return Ok(known);
        }
        let mut hasher = blake3::Hasher::new();
        io::copy(&mut file, &mut hasher)?;
        if state(&file)? != before {
            return Err(io::Error::other("the file changes while it is read"));
        }
        let digest = hasher.finalize().to_hex().to_string();
        // A cache that takes no memo reads the file again next time.
        let _ = fs::create_dir_all(memo.parent().unwrap_or(&self.folder)).and_then(|()| fs::write(&memo, &digest));
        Ok(digest)
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
        for left in folders_in(&self.folder.join("entries"))? {
            let is_new = left.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b".new-"));
            let age = left.metadata().and_then(|meta| meta.modified()).ok().and_then(|time| time.elapsed().ok());
            if is_new && age.is_some_and(|age| age > LEFTOVER) {
                fs::remove_dir_all(left)?;
            }
        }
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

    /// The size that a cache keeps to: ten gigabytes, or a tenth of what is free beside it.
    pub fn limit(&self) -> u64 {
        let free = plumbline_num::files::free_space(&self.folder).unwrap_or(u64::MAX);
        MAX_BYTES.min(free / MAX_PART)
    }

    fn entries(&self) -> io::Result<Vec<Found>> {
        let mut found = Vec::new();
        for shelf in folders_in(&self.folder.join("entries"))? {
            if shelf.file_name().is_some_and(|name| name.len() != 2) {
                continue;
            }
            for folder in folders_in(&shelf)? {
                // Another process may have removed it meanwhile.
                let Ok(files) = fs::read_dir(&folder) else { continue };
                let sizes = files.filter_map(|file| file.ok()?.metadata().ok());
                let bytes = sizes.map(|meta| meta.len()).sum();
                let used = folder.join(META).metadata().and_then(|meta| meta.modified());
                found.push(Found { used: used.unwrap_or(SystemTime::UNIX_EPOCH), bytes, folder });
            }
        }
        Ok(found)
    }
}

/// A result on disk.
struct Found {
    used: SystemTime,
    bytes: u64,
    folder: PathBuf,
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
        let message = "others may write to it, and decide by that what is computed; name a cache of your own, which only you may write to";
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, message));
    }
    Ok(())
}

#[cfg(not(unix))]
fn check_owner(_: &Path) -> io::Result<()> {
    Ok(())
}

impl Entry {
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
        let damaged = |what: &str| io::Error::new(io::ErrorKind::InvalidData, format!("damaged: {what}"));
        let stored = self.meta.files.get(index).ok_or_else(|| damaged("a file is missing"))?;
        if stored.name.contains(['/', '\\']) || stored.name.starts_with('.') || stored.bytes > MAX_FILE {
            return Err(damaged("the list of its files"));
        }
        let mut bytes = Vec::new();
        File::open(self.folder.join(&stored.name))?.take(stored.bytes + 1).read_to_end(&mut bytes)?;
        let digest = blake3::hash(&bytes).to_hex();
        if bytes.len() as u64 != stored.bytes || digest.as_str() != stored.digest {
            return Err(damaged(&stored.name));
        }
        Ok(bytes)
    }
}

impl NewEntry {
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

    /// Makes the result known, unless another process did meanwhile, and keeps the cache to its limit.
    ///
    /// # Errors
    /// The system's error.
    pub fn publish(self) -> io::Result<()> {
        let mut file = File::create(self.folder.path().join(META))?;
        file.write_all(&serde_json::to_vec(&self.meta)?)?;
        file.sync_all()?;
        let target = self.cache.entry_folder(&self.key);
        private_folder(target.parent().unwrap_or(&self.cache.folder))?;
        match fs::rename(self.folder.path(), &target) {
            Ok(()) => {
                // It has another name now, and is not removed.
                let _ = self.folder.keep();
            }
            Err(_) if target.join(META).exists() => {}
            Err(error) => return Err(error),
        }
        self.cache.shrink(self.cache.limit()).map(|_| ())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cache() -> (tempfile::TempDir, Cache) {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::open(&folder.path().join("cache")).expect("a cache");
        (folder, cache)
    }

    fn store(cache: &Cache, key: &Key, bytes: &[u8]) {
        let mut entry = cache.begin("test", key).expect("begun");
        entry.write("a", bytes).expect("written");
        entry.publish().expect("published");
    }

    #[test]
    fn what_was_stored_is_found_and_what_was_not_published_is_not() {
        let (_folder, cache) = cache();
        let key = Key::new("test", 1, &"x");
        assert!(cache.find(&key).is_none());
        let mut dropped = cache.begin("test", &key).expect("begun");
        dropped.write("a", b"never").expect("written");
        drop(dropped);
        assert!(cache.find(&key).is_none());
        store(&cache, &key, b"content");
        // A second process that was as far.
        store(&cache, &key, b"content");
        let entry = cache.find(&key).expect("there");
        assert_eq!((entry.len(), entry.read(0).expect("whole")), (1, b"content".to_vec()));
        assert!(entry.read(1).is_err());
        assert_eq!(cache.usage().expect("read").entries, 1);
        assert_eq!(folders_in(&cache.folder.join("entries")).expect("read").len(), 1, "nothing is left over");
    }

    #[test]
    fn damage_is_found_when_it_is_read() {
        let (_folder, cache) = cache();
        let key = Key::new("test", 1, &"x");
        for change in [b"contenX".as_slice(), b"conten", b"content and more", b""] {
            store(&cache, &key, b"content");
            fs::write(cache.entry_folder(&key).join("a"), change).expect("written");
            let error = cache.find(&key).expect("there").read(0).expect_err("damaged");
            assert_eq!(error.kind(), io::ErrorKind::InvalidData);
            cache.remove(&key).expect("removed");
        }
        store(&cache, &key, b"content");
        let meta = cache.entry_folder(&key).join(META);
        let text = fs::read_to_string(&meta).expect("read").replace("\"a\"", "\"../../../secret\"");
        fs::write(&meta, text).expect("written");
        assert!(cache.find(&key).expect("there").read(0).is_err(), "no file outside is read");
        fs::write(&meta, "{").expect("written");
        assert!(cache.find(&key).is_none());
    }

    #[test]
    fn those_not_used_for_longest_go_first() {
        let (_folder, cache) = cache();
        let keys = ["a", "b", "c"].map(|k| Key::new("test", 1, &k));
        for (age, key) in (1..).zip(&keys) {
            store(&cache, key, &[0; 1000]);
            let meta = File::open(cache.entry_folder(key).join(META)).expect("there");
            meta.set_modified(SystemTime::now() - Duration::from_secs(1000 * age)).expect("set");
        }
        // Used again: the oldest is now the newest.
        assert!(cache.find(&keys[2]).is_some());
        let one = cache.usage().expect("read").bytes / 3;
        let removed = cache.shrink(2 * one).expect("shrunk");
        assert_eq!((removed.entries, removed.bytes), (1, one));
        assert_eq!(keys.map(|key| cache.find(&key).is_some()), [true, false, true]);
    }

    #[test]
    fn a_digest_is_of_the_content_and_follows_its_changes() {
        let (folder, cache) = cache();
        let path = folder.path().join("clip.mp4");
        fs::write(&path, "one").expect("written");
        let first = cache.digest_of(&path).expect("read");
        assert_eq!(
            (first.as_str(), cache.digest_of(&path).expect("read")),
            (blake3::hash(b"one").to_hex().as_str(), first.clone())
        );
        fs::write(&path, "three").expect("written");
        assert_ne!(cache.digest_of(&path).expect("read"), first);
    }

    #[cfg(unix)]
    #[test]
    fn a_cache_that_others_may_write_to_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let (_folder, cache) = cache();
        assert_eq!(cache.folder.metadata().expect("there").permissions().mode() & 0o777, 0o700);
        fs::set_permissions(&cache.folder, fs::Permissions::from_mode(0o777)).expect("set");
        assert_eq!(Cache::open(&cache.folder).expect_err("refused").kind(), io::ErrorKind::PermissionDenied);
    }
}
