//! Digests of files by content, looked up as long as a file stays as it was.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use crate::pipeline::paths::to_text;
use plumbline_num::files::open_regular;

/// Age of a change from which on another change shows in the times of a file: file systems count in steps of up to two seconds.
const SETTLED: Duration = Duration::from_secs(2);

/// BLAKE3 of the content of a file, which is read.
///
/// # Errors
/// A file that cannot be read, or that changes while it is.
pub fn digest_of_file(path: &Path) -> io::Result<String> {
    digest_of(path, None)
}

/// BLAKE3 of the content of a file; with a folder of notes it is read once, as long as path, size, times and inode stay.
///
/// # Errors
/// A file that cannot be read, or that changes while it is.
pub(super) fn digest_of(path: &Path, notes: Option<&Path>) -> io::Result<String> {
    let mut file = open_regular(path)?;
    let (before, changed) = state(path, &file)?;
    let note = notes.map(|notes| note_of(&before, notes));
    if let Some(known) = note.as_ref().and_then(|note| noted(note)) {
        return Ok(known);
    }
    let mut hasher = blake3::Hasher::new();
    io::copy(&mut file, &mut hasher)?;
    if state(path, &file)?.0 != before {
        return Err(io::Error::other("the file changes while it is read"));
    }
    let digest = hasher.finalize().to_hex().to_string();
    if let Some(note) = note.filter(|_| changed.elapsed().is_ok_and(|age| age > SETTLED)) {
        // Where none can be made, the file is read again next time.
        let _ = fs::create_dir_all(note.parent().unwrap_or(path)).and_then(|()| fs::write(&note, &digest));
    }
    Ok(digest)
}

/// The digest of a file where it is noted; the file is not read.
pub(super) fn known_digest_of(path: &Path, notes: &Path) -> Option<String> {
    let file = open_regular(path).ok()?;
    noted(&note_of(&state(path, &file).ok()?.0, notes))
}

/// The note of a file in this state.
fn note_of(state: &str, notes: &Path) -> PathBuf {
    let name = blake3::hash(state.as_bytes()).to_hex().to_string();
    notes.join(&name[..2]).join(&name)
}

fn noted(note: &Path) -> Option<String> {
    let is_digest = |text: &String| text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit());
    fs::read_to_string(note).ok().filter(is_digest)
}

/// What shows that a file was changed, and when it was.
fn state(path: &Path, file: &File) -> io::Result<(String, SystemTime)> {
    let meta = file.metadata()?;
    let modified = meta.modified()?;
    #[cfg(unix)]
    let of_system = {
        use std::os::unix::fs::MetadataExt;
        // The time of the last change of the inode cannot be set back.
        format!("{} {} {}.{:09}", meta.dev(), meta.ino(), meta.ctime(), meta.ctime_nsec())
    };
    #[cfg(not(unix))]
    let of_system = "";
    Ok((format!("{} {} {of_system} {modified:?}", to_text(path.canonicalize()?), meta.len()), modified))
}
