//! The folder of a session: what was dropped on the page while one server ran.
//!
//! Its record lists the files as they were dropped, and is locked while the server runs; the kernel lets go of the lock however the
//! server ends. The next server removes what a session left whose lock is free, as the session would have done itself: each drop of
//! which every file is as it was dropped and no change is kept. What was saved there stays.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::recovery::{Recovery, private_folder, private_temporary_folder};
use crate::watched::{Stamp, stamp};
use plumbline_num::files::AtomicFile;

/// Names of the folders of sessions begin with it.
const PREFIX: &str = "session-";
/// The record, in the folder of a session: a line of JSON per file.
const RECORD: &str = ".files";
/// Locked in the folder of all sessions while one begins: another that begins must not take it for a leftover.
const TURN: &str = ".lock";

/// The folder of a session that runs.
#[derive(Debug)]
pub(super) struct SessionFolder {
    path: PathBuf,
    /// Holds the lock.
    record: Mutex<File>,
}

/// A file as it was dropped.
#[derive(Deserialize, Serialize)]
struct Dropped {
    /// Its path in the folder of the session.
    file: PathBuf,
    stamp: Stamp,
}

impl SessionFolder {
    /// A folder among those of other sessions, after what earlier ones left there was removed.
    pub(super) fn after_others(parent: &Path, recovery: Option<&Recovery>) -> io::Result<Self> {
        let turn = File::create(parent.join(TURN))?;
        // A file system without locks: nothing is removed there.
        let _ = turn.lock();
        for session in parent.read_dir()?.filter_map(Result::ok) {
            if session.file_name().to_string_lossy().starts_with(PREFIX) {
                remove_leftover(&session.path(), recovery);
            }
        }
        Self::in_folder(parent)
    }

    /// A folder in another one.
    pub(super) fn in_folder(parent: &Path) -> io::Result<Self> {
        let path = private_temporary_folder(PREFIX, parent)?.keep();
        let record = File::create_new(path.join(RECORD))?;
        let _ = record.try_lock();
        Ok(Self { path, record: Mutex::new(record) })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The folder of a drop.
    pub(super) fn drop_folder(&self, number: u64) -> io::Result<PathBuf> {
        let folder = self.path.join(number.to_string());
        private_folder(&folder)?;
        Ok(folder)
    }

    /// Lists the file that `written` becomes by renaming.
    pub(super) fn list(&self, file: &Path, written: &Path) -> io::Result<()> {
        let file = file.strip_prefix(&self.path).unwrap_or(file).to_owned();
        let mut line = serde_json::to_vec(&Dropped { file, stamp: stamp(written) })?;
        line.push(b'\n');
        self.record.lock().unwrap_or_else(PoisonError::into_inner).write_all(&line)
    }

    /// Removes what is as it was dropped, and the folder where nothing else is in it.
    pub(super) fn remove_unchanged(&self, recovery: Option<&Recovery>) {
        remove_unchanged(&self.path, recovery);
    }

    /// Lets go of the lock, as the kernel does when the program ends.
    #[cfg(test)]
    pub(super) fn release(&self) {
        self.record.lock().unwrap_or_else(PoisonError::into_inner).unlock().expect("it is held");
    }
}

fn remove_leftover(session: &Path, recovery: Option<&Recovery>) {
    match File::open(session.join(RECORD)) {
        Ok(record) if record.try_lock().is_ok() => remove_unchanged(session, recovery),
        Ok(_) => {}
        // It ended before it had a record; stays where something is in it.
        Err(_) => drop(std::fs::remove_dir(session)),
    }
}

fn remove_unchanged(session: &Path, recovery: Option<&Recovery>) {
    let dropped = read_record(session);
    let unsaved = recovery.map(Recovery::documents).unwrap_or_default();
    let folders: Vec<PathBuf> = entries(session).filter(|path| path.is_dir()).collect();
    for folder in &folders {
        let has_unsaved = unsaved.iter().any(|document| document.starts_with(folder));
        let is_unchanged = |file: PathBuf| {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let known = file.strip_prefix(session).ok().and_then(|file| dropped.get(file));
            AtomicFile::is_partial_name(&name) || known.is_some_and(|known| *known == stamp(&file))
        };
        if !has_unsaved && entries(folder).all(is_unchanged) {
            let _ = std::fs::remove_dir_all(folder);
        }
    }
    if folders.iter().all(|folder| !folder.exists()) {
        let _ = std::fs::remove_file(session.join(RECORD));
        let _ = std::fs::remove_dir(session);
    }
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    folder.read_dir().into_iter().flatten().filter_map(Result::ok).map(|entry| entry.path())
}

/// A line that was not written whole lists nothing.
fn read_record(session: &Path) -> BTreeMap<PathBuf, Stamp> {
    let lines = File::open(session.join(RECORD)).map(|file| BufReader::new(file).lines());
    let lines = lines.into_iter().flatten().map_while(Result::ok);
    let dropped = lines.filter_map(|line| serde_json::from_str::<Dropped>(&line).ok());
    dropped.map(|dropped| (dropped.file, dropped.stamp)).collect()
}
